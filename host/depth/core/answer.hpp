// What a method says of a region: a depth with its standard error, or why there is none.
#pragma once

#include <string>

namespace depth {

struct Answer {
    double depth_cm = 0.0;
    double sigma_cm = 0.0;
    double sensitivity = 0.0;  // change of what is measured for one cm of travel
    std::string declined;      // why there is no depth; empty where there is one

    bool known() const { return declined.empty(); }
};

inline Answer decline(std::string why) {
    Answer out;
    out.declined = std::move(why);
    return out;
}

}  // namespace depth
