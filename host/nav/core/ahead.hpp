// What a straight drive over the map would meet.
#pragma once

#include <cstddef>
#include <cstdint>

namespace nav {

// A window of cells, ends included; evidence and centres are those of the whole map of `side` x `side`.
struct Window {
    const float* evidence;
    const double* centres_cm;
    std::size_t side, row0, row1, col0, col1;
};

// A disc that goes along a heading.
struct Disc {
    double x_cm, z_cm, sine, cosine;
    double radius_cm;
    double wide_cm;  // what it keeps sideways of a filled cell's middle
};

struct Meeting {
    double room_cm, unseen_cm, blind_cm;  // until it touches a filled cell, one not known to be free, one never looked at
    std::int64_t row, col;                // the filled one; -1 where there is none
};

// Log-odds above which a cell is filled, and below which it is free, or was looked at.
struct Kinds {
    float filled, free, looked;
};

// reach_cm: what is told where it meets none
Meeting meet(const Window& window, const Disc& disc, const Kinds& kinds, double half_cell_cm, double reach_cm);

// Distances (side, side) of float, by cell.
struct Distances {
    const float* cm;
    std::size_t side;
    double half_cm, cell_cm;  // of the map
};

// The least of them along a straight line, every half cell from `from_cm` on.
float least_along(const Distances& distances, double x0, double z0, double x1, double z1, double from_cm);

}  // namespace nav
