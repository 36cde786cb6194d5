#include "relief.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "polygon.hpp"

namespace depth {

namespace {

// Area over the smallest rectangle round it, and the relief that goes with it; an ellipse has pi/4.
struct Filled {
    double share;
    Relief relief;
};
constexpr std::array<Filled, 4> BY_FILLING{{
    {0.80, {0.30, 0.09}},
    {0.86, {0.28, 0.11}},
    {0.93, {0.12, 0.11}},
    {0.98, {0.02, 0.07}},
}};
constexpr Relief HOLLOW{0.0, 0.2};
constexpr Relief UNKNOWN{0.15, 0.25};
constexpr double MIN_SOLIDITY = 0.87;    // area over that of the convex hull
constexpr double MIN_BEND_PX = 1.5;      // a side may leave its chord by this
constexpr double BEND_SHARE = 0.015;     // or by so much of the outline's length
constexpr double FACE_AREA_SHARE = 0.04; // by which the straight sides may miss the area

}  // namespace

bool may_be_one_face(const std::vector<Vec2>& outer_loop) {
    const Loop sides = simplified(outer_loop, std::max(MIN_BEND_PX, BEND_SHARE * loop_length(outer_loop)));
    if (sides.size() < 3 || sides.size() > 4 || !is_convex(sides)) return false;
    const double area = std::abs(signed_area(outer_loop));
    return std::abs(std::abs(signed_area(sides)) - area) < FACE_AREA_SHARE * area;
}

Relief relief_of(const std::vector<Vec2>& outer_loop, bool cut) {
    if (cut) return UNKNOWN;
    const Loop hull = convex_hull(outer_loop);
    const double area = std::abs(signed_area(outer_loop)), hull_area = signed_area(hull);
    const Rectangle box = smallest_rectangle(hull);
    if (!(area > 0) || !(hull_area > 0) || !(box.width * box.height > 0)) return UNKNOWN;
    if (area < MIN_SOLIDITY * hull_area) return HOLLOW;
    const double filled = area / (box.width * box.height);
    if (filled <= BY_FILLING.front().share) return BY_FILLING.front().relief;
    for (std::size_t k = 1; k < BY_FILLING.size(); ++k) {
        const auto &[low, a] = BY_FILLING[k - 1];
        const auto &[high, b] = BY_FILLING[k];
        if (filled > high) continue;
        const double t = (filled - low) / (high - low);
        return {a.k + t * (b.k - a.k), a.sigma_k + t * (b.sigma_k - a.sigma_k)};
    }
    return BY_FILLING.back().relief;
}

}  // namespace depth
