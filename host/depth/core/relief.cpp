#include "relief.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "polygon.hpp"

namespace depth {

namespace {

// Of outlines with few corners, by the share of the smallest rectangle round them that they fill.
struct Filled {
    double share;
    Relief relief;
};
using Table = std::array<Filled, 6>;
// Four sides: cups and slanted faces, slanted faces and cans, frontal faces.
constexpr Table FOUR_SIDES{{
    {0.790, {0.30, 0.08}},
    {0.840, {0.18, 0.18}},
    {0.900, {0.035, 0.18}},
    {0.945, {0.075, 0.16}},
    {0.963, {0.045, 0.11}},
    {0.985, {0.005, 0.05}},
}};
// More: round things too small to show it, cups, boxes over a corner and cans, nearly frontal boxes.
constexpr Table MORE_SIDES{{
    {0.790, {0.30, 0.08}},
    {0.840, {0.18, 0.13}},
    {0.900, {0.08, 0.16}},
    {0.945, {0.155, 0.12}},
    {0.963, {0.11, 0.09}},
    {0.985, {0.01, 0.05}},
}};
constexpr Relief ROUND{0.31, 0.06};   // balls and fruits
constexpr Relief NECKED{0.145, 0.06};  // bottles
constexpr Relief HOLLOW{0.0, 0.2};    // chairs, foliage: what is between belongs to it, and is not seen
constexpr Relief UNKNOWN{0.15, 0.25};
constexpr std::size_t MIN_ROUND_CORNERS = 7;
constexpr double ROUND_SOLIDITY = 0.95;   // area over that of the convex hull
constexpr double MIN_SOLIDITY = 0.80;
constexpr double MIN_BEND_PX = 1.5;       // a side of an angular thing may leave its chord by this
constexpr double BEND_SHARE = 0.015;      // or by so much of the outline's length
constexpr double STRAIGHT = 0.6;          // of both, for what has four sides and no fifth
constexpr double FACE_AREA_SHARE = 0.04;  // by which the straight sides may miss the area

Loop straight_sides(const Loop& outer_loop, double share = 1.0) {
    return simplified(outer_loop, share * std::max(MIN_BEND_PX, BEND_SHARE * loop_length(outer_loop)));
}

}  // namespace

bool may_be_one_face(const std::vector<Vec2>& outer_loop) {
    const Loop sides = straight_sides(outer_loop);
    if (sides.size() < 3 || sides.size() > 4 || !is_convex(sides)) return false;
    const double area = std::abs(signed_area(outer_loop));
    return std::abs(std::abs(signed_area(sides)) - area) < FACE_AREA_SHARE * area;
}

Relief relief_of(const std::vector<Vec2>& outer_loop, bool cut) {
    if (cut) return UNKNOWN;
    const Loop hull = convex_hull(outer_loop);
    const double area = std::abs(signed_area(outer_loop)), hull_area = signed_area(hull);
    if (!(area > 0) || !(hull_area > 0)) return UNKNOWN;
    if (area < MIN_SOLIDITY * hull_area) return HOLLOW;
    if (straight_sides(outer_loop).size() >= MIN_ROUND_CORNERS) return area < ROUND_SOLIDITY * hull_area ? NECKED : ROUND;
    const Table& table = straight_sides(outer_loop, STRAIGHT).size() <= 4 ? FOUR_SIDES : MORE_SIDES;
    const Rectangle box = smallest_rectangle(hull);
    const double filled = area / (box.width * box.height);
    if (filled <= table.front().share) return table.front().relief;
    for (std::size_t k = 1; k < table.size(); ++k) {
        const auto& [low, a] = table[k - 1];
        const auto& [high, b] = table[k];
        if (filled > high) continue;
        const double t = (filled - low) / (high - low);
        return {a.k + t * (b.k - a.k), a.sigma_k + t * (b.sigma_k - a.sigma_k)};
    }
    return table.back().relief;
}

}  // namespace depth
