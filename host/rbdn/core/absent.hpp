// Regions that are gone, kept in mind for a while: what hid them may let them go again.
#pragma once

#include <cstdint>
#include <vector>

#include "image.hpp"
#include "mesh.hpp"

namespace rbdn {

// A region as it was last seen, or a new one.
struct Sight {
    ColourSum sum;
    double x_sum = 0;  // over as many places as the colours
    double y_sum = 0;

    void add(const Colour& colour, int x, int y);
    Vec2 middle() const;
};

class AbsentRegions {
public:
    void remember(std::int64_t id, const Sight& last, int frame);

    // The absent region that something new is: of its colour, `same_colour` at most apart, and not farther from its
    // last place than it may have moved. kNoRegion if there is none. It is not absent any more then.
    std::int64_t recognise(const Sight& seen, double same_colour, int frame);

    void forget_old(int frame);

private:
    struct Absent {
        std::int64_t id;
        Colour mean;
        Vec2 middle;
        int frame;
    };
    std::vector<Absent> absent_;
};

}  // namespace rbdn
