// A number kept within a limit either way.
#ifndef WITHIN_H
#define WITHIN_H

#include <stdint.h> // integers of known width

static inline int32_t within(int32_t value, int32_t limit)
{
    if (value > limit)
        return limit;
    return value < -limit ? -limit : value;
}

#endif
