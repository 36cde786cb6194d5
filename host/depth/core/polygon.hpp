// Plane geometry of outlines: a loop is a closed polygon, its last point joined to its first; loops
// together are an outer loop first, then its holes, whatever way each of them turns.
#pragma once

#include <vector>

#include "space.hpp"

namespace depth {

using Loop = std::vector<Vec2>;
using Loops = std::vector<Loop>;

// Positive where the loop turns from x towards y.
double signed_area(const Loop& loop);

// Area of the outer loop less that of the holes.
double polygon_area(const Loops& loops);

double loop_length(const Loop& loop);

// Length of all loops together.
double outline_length(const Loops& loops);

struct Moments {
    double area = 0.0;
    Vec2 centre;                          // centroid
    double xx = 0.0, yy = 0.0, xy = 0.0;  // central second moments over the area
};

// All zero where the holes leave nothing.
Moments polygon_moments(const Loops& loops);

// Corners of the convex hull, turning from x towards y; no three of them on a line.
Loop convex_hull(const std::vector<Vec2>& points);

// The rectangle of least area round a convex polygon, turned any way.
struct Rectangle {
    double width = 0.0, height = 0.0;
};
Rectangle smallest_rectangle(const Loop& hull);

// A loop with fewer points, none of those left out farther than `tolerance` from what remains
// (Douglas and Peucker).
Loop simplified(const Loop& loop, double tolerance);

// Whether a loop bends one way only and goes round once.
bool is_convex(const Loop& loop);

// Mean of 1/(a + b x + c y) over the loops, exact; nan where the denominator is not positive at every
// corner of the outer loop, or where the loops enclose nothing.
//
// With L = a + b x + c y and g the length of its gradient, ln(L)/g along the gradient has the divergence
// 1/L, so that the integral is a sum over the edges of the mean of ln(L) on each.
double mean_of_inverse(const Loops& loops, double a, double b, double c);

}  // namespace depth
