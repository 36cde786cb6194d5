// The regions of a picture, column by column from the lower border up.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace nav {

// Stretches of one region upwards in a column. Pixels are counted column after column, lowest first.
struct Columns {
    std::size_t cols = 0, rows = 0, kinds = 0;
    std::vector<std::uint16_t> labels;               // (cols, rows)
    std::vector<std::int64_t> starts, ends, owner;   // of each stretch: first pixel, one behind the last, kind
    std::vector<std::int64_t> lowest;                // (kinds, cols) pixels below the first one; -1 where none is
    std::vector<std::int64_t> pixels, at_border;     // (kinds) how many, and how many of them at the lower border
};

// Of an image of kinds (rows, cols), top row first.
Columns columns_of(const std::uint16_t* image, std::size_t rows, std::size_t cols, std::size_t kinds);

enum class Ground : std::uint8_t { none = 0, floor = 1, mixed = 2 };  // mixed: floor up to a foot, if one is known

// Upwards in each column: the first pixel that is not floor, the top one where all are.
struct FirstOther {
    std::vector<std::int64_t> row;         // mixed kinds counted as floor where no foot is known
    std::vector<std::uint8_t> open_ended;  // all are floor
    std::vector<std::int64_t> sure_row;    // and not counted as floor
};

// ground: (kinds); foot: (cols) pixels above the lower border, -1 where none is known
FirstOther first_other(const std::uint16_t* labels, std::size_t cols, std::size_t rows, const std::uint8_t* ground,
                       const std::int64_t* foot);

// In each column the foot of the first thing above the floor. A ray's slope is how far it falls for each cm ahead.
struct Feet {
    std::vector<std::int64_t> kind;                    // its kind, or `nothing` where only floor is seen
    std::vector<std::uint8_t> cut;                     // no floor is seen at all
    std::vector<double> slope, depth_cm;               // of the ray to it, and how far it is
    std::vector<std::uint8_t> sure;                    // all before it is surely floor
    std::vector<double> floor_cm, free_cm;             // up to where floor is seen, and up to where at the least
};
struct Plane {
    double height_cm;    // of the camera
    double farthest_cm;
    double sigma_slope;
};

// slopes: (cols, rows) of the pixels' rays, lowest first; ids: (kinds)
Feet feet_of(const FirstOther& first, const std::uint16_t* labels, const double* slopes, std::size_t rows,
             const std::int64_t* ids, std::int64_t nothing, const Plane& plane);

}  // namespace nav
