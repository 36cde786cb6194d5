// How a thing stands on the floor, by the feet seen of it in the columns of a picture.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "edges.hpp"

namespace nav {

// Where the columns look to, and from how high.
struct Across {
    std::span<const double> rays;  // x/z of the middle of every column
    double height_cm;
};

struct Stance {
    double nearest = 0.0;  // slope of its feet where it is nearest
    double mean = 0.0;     // of its feet; along edges that of its mean depth
    bool is_wall = false;  // or has most of it behind a thing that the net made one with it
    std::optional<Line> line;                  // on which a wall's feet lie
    std::optional<std::vector<double>> edges;  // slopes in all columns covered, of what is no wall and has them
    bool hangs = false;                        // over at the sides, or ends in points there; without edges
    double touching = 0.0;                     // share of its columns that touch the floor; likewise
};

// rms: of feet about the line of an edge. The shape has three feet at least.
Stance stance_of(const Shape& shape, const Across& across, double rms);

// Whether the feet of something wide lie on one line, which goes on below the image.
bool is_straight_wall(const Shape& shape, const Across& across);

// Of values, between its neighbours in proportion; puts them in order.
double quantile(std::vector<double>& values, double part);

// The nearest of feet told in steps of rows, which are evened out where there are enough.
double nearest_slope(std::vector<double> slopes);

// Whether the outer feet are much flatter than the nearest on both sides that are in the picture.
//
// On one side alone they are so along a slanted front, which stands on the floor all the way.
bool hangs_over(const Shape& shape, double nearest);

}  // namespace nav
