#include "grid.hpp"

#include <algorithm>
#include <cmath>
#include <span>

namespace nav {

namespace {

// Image x of a level ray; beyond the table that of its nearest end.
double pixel_of(double across, const View& view) {
    if (view.rays.empty()) return across * view.fx + view.cx;
    if (across <= view.rays.front()) return view.pixels.front();
    if (across >= view.rays.back()) return view.pixels.back();
    const std::size_t last = view.rays.size() - 1;
    const double spacing = (view.rays.back() - view.rays.front()) / static_cast<double>(last);
    std::size_t k = std::min(static_cast<std::size_t>((across - view.rays.front()) / spacing), last - 1);
    while (k > 0 && view.rays[k] > across) --k;
    while (k + 1 < last && view.rays[k + 1] <= across) ++k;
    const double rise = (view.pixels[k + 1] - view.pixels[k]) / (view.rays[k + 1] - view.rays[k]);
    return rise * (across - view.rays[k]) + view.pixels[k];
}

struct Place {
    const Front* front = nullptr;
    double depth_cm = 0.0;
};

// The fronts in each column, in their order: those of column c from begin[c] up to begin[c + 1].
struct Places {
    std::vector<std::size_t> begin;
    std::vector<Place> all;
};

Places by_column(const std::vector<Front>& fronts, std::size_t width) {
    Places out;
    out.begin.assign(width + 1, 0);
    for (const Front& front : fronts)
        for (const std::int64_t c : front.columns) ++out.begin[static_cast<std::size_t>(c) + 1];
    for (std::size_t c = 0; c < width; ++c) out.begin[c + 1] += out.begin[c];
    out.all.resize(out.begin[width]);
    std::vector<std::size_t> next(out.begin);
    for (const Front& front : fronts)
        for (std::size_t k = 0; k < front.columns.size(); ++k)
            out.all[next[static_cast<std::size_t>(front.columns[k])]++] = {&front, front.depth_cm[k]};
    return out;
}

struct Cell {
    float& evidence;
    std::int32_t& region;
    bool& brief;
};

// free_to_cm: floor is seen in its column up to here; over_cm: and nothing stands up to here, unless it is low
void judge(Cell cell, double depth_cm, double free_to_cm, double over_cm, const Floor& floor,
           std::span<const Place> places, const Rules& rules) {
    float before = cell.evidence;
    float change = depth_cm < free_to_cm && depth_cm > floor.nearest_cm ? rules.seen_empty : 0.0f;
    for (const Place& place : places) {  // was thought to be nearer: unknown
        const bool moved = depth_cm - place.depth_cm < -(rules.cell_cm + place.front->sigma_cm);
        if (moved && cell.region == place.front->region && before > 0.0f) change = std::max(rules.seen_empty, -before);
    }
    float most = rules.limit;
    for (const Place& place : places) {
        const Front& front = *place.front;
        const double off_cm = depth_cm - place.depth_cm;
        if (!(off_cm > front.from_cm && off_cm < front.to_cm)) continue;
        if (!(off_cm < front.sure_cm || std::abs(before) < rules.presumed)) continue;
        before = std::max(before, front.at_least);
        change = front.change, most = front.most, over_cm = 0.0;
        cell.brief = front.brief, cell.region = front.region;
    }
    if (change == 0.0f && depth_cm < over_cm && before > rules.looked_over && before < rules.presumed)
        change = std::max(rules.looked_over - before, rules.seen_empty);
    cell.evidence = std::min(std::max(before + change, -rules.limit), std::max(most, before));
}

}  // namespace

void paint(const Grid& grid, const View& view, const Floor& floor, const std::vector<Front>& fronts, const Rules& rules) {
    const std::size_t width = floor.free_cm.size();
    const Places places = by_column(fronts, width);
    const auto in_column = [&places](std::size_t c) {
        return std::span(places.all).subspan(places.begin[c], places.begin[c + 1] - places.begin[c]);
    };
    std::vector<double> free_to = floor.free_cm, over(width);
    for (std::size_t c = 0; c < width; ++c) {
        over[c] = floor.cut[c] ? 0.0 : floor.floor_cm[c];
        for (const Place& place : in_column(c))
            free_to[c] = std::min(free_to[c], place.depth_cm - 2 * place.front->sigma_cm);
        free_to[c] -= rules.cell_cm / 2;
    }
    for (std::size_t row = view.row0; row <= view.row1; ++row) {
        const double dz = grid.centres_cm[row] - view.z_cm;
        for (std::size_t col = view.col0; col <= view.col1; ++col) {
            const double dx = grid.centres_cm[col] - view.x_cm;
            const double depth = dx * view.sine + dz * view.cosine;
            if (!(depth > 1.0 && depth < view.range_cm)) continue;
            const double side = dx * view.cosine - dz * view.sine;
            if (!(side > view.left * depth && side < view.right * depth)) continue;
            const double column = std::floor((pixel_of(side / depth, view) + 0.5) / view.step_px);
            if (!(column >= 0 && column < static_cast<double>(width))) continue;
            const auto c = static_cast<std::size_t>(column);
            const std::size_t at = row * grid.side + col;
            if (grid.brief[at] && depth < floor.nearest_cm && !floor.cut[c]) {  // it would be seen, but for low things
                grid.evidence[at] = std::min(grid.evidence[at], 0.0f);
                grid.brief[at] = false;
            }
            double over_cm = over[c];
            for (const double end : {-rules.cell_cm / 3, rules.cell_cm / 3}) {  // near by, a cell is many columns wide
                const double other = std::floor((pixel_of((side + end) / depth, view) + 0.5) / view.step_px);
                const double last = static_cast<double>(width) - 1;
                over_cm = std::min(over_cm, over[static_cast<std::size_t>(std::min(std::max(other, 0.0), last))]);
            }
            judge({grid.evidence[at], grid.region[at], grid.brief[at]}, depth, free_to[c], over_cm, floor, in_column(c), rules);
        }
    }
}

}  // namespace nav
