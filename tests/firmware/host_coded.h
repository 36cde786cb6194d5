// COBS as a host does it, for C tests: any raw bytes may be framed, also such as no host would send.
#ifndef HOST_CODED_H
#define HOST_CODED_H

#include <stdint.h> // integers of known width

// Puts the frame of `size` raw bytes, its delimiter included, on `wire`; how many bytes that are, size + 2.
static inline unsigned host_coded(uint8_t *wire, const uint8_t *raw, unsigned size)
{
    unsigned code = 0, at = 1;
    for (unsigned i = 0; i < size; i++) {
        if (raw[i] == 0) {
            wire[code] = (uint8_t)(at - code);
            code = at++;
        } else {
            wire[at++] = raw[i];
        }
    }
    wire[code] = (uint8_t)(at - code);
    wire[at++] = 0;
    return at;
}

#endif
