#include "contour_map.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace depth {

namespace {

struct Step {
    int dx, dy;
};

// Far ones first, so that painting in this order leaves the nearest on top.
std::vector<Step> nearest_last() {
    constexpr int R = ContourMap::REACH_CELLS;
    std::vector<Step> out;
    for (int dy = -R; dy <= R; ++dy)
        for (int dx = -R; dx <= R; ++dx)
            if (dx * dx + dy * dy <= R * R) out.push_back({dx, dy});
    std::stable_sort(out.begin(), out.end(),
                     [](Step a, Step b) { return a.dx * a.dx + a.dy * a.dy > b.dx * b.dx + b.dy * b.dy; });
    return out;
}

}  // namespace

void ContourMap::file(const FrameView& frame, const Camera& camera, double border_px) {
    static const std::vector<Step> STEPS = nearest_last();
    rows_ = camera.height / CELL_PX + 1 + 2 * MARGIN;
    columns_ = camera.width / CELL_PX + 1 + 2 * MARGIN;
    const std::size_t layer = static_cast<std::size_t>(rows_) * static_cast<std::size_t>(columns_);
    cells_.assign(4 * layer, NONE);
    points_.clear();
    struct Place {
        std::size_t at;  // in the layer
        int first, second;  // directions the normal lies between
    };
    std::vector<Place> places;
    for (std::size_t i = 0; i < frame.outline_px.size() && points_.size() < NONE; ++i) {
        const Vec2 p = frame.outline_px[i], n = frame.outline_normal[i];
        if (!(p.x > border_px && p.x < camera.width - 1 - border_px && p.y > border_px &&
              p.y < camera.height - 1 - border_px))
            continue;
        const int column = static_cast<int>(std::lround(p.x / CELL_PX)) + MARGIN;
        const int row = static_cast<int>(std::lround(p.y / CELL_PX)) + MARGIN;
        points_.push_back({static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(n.x),
                           static_cast<float>(n.y), frame.outline_left[i], frame.outline_right[i]});
        const bool flip = n.y < 0 || (n.y == 0 && n.x < 0);
        const double x = flip ? -n.x : n.x, y = flip ? -n.y : n.y;  // now from 0 up to 180 degrees
        const int first = x >= y ? 0 : x >= 0 ? 1 : -x <= y ? 2 : 3;
        places.push_back({static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
                              static_cast<std::size_t>(column),
                          first, (first + 1) % 4});
    }
    for (const Step step : STEPS) {
        const std::ptrdiff_t offset = static_cast<std::ptrdiff_t>(step.dy) * columns_ + step.dx;
        for (std::size_t i = 0; i < places.size(); ++i) {
            const std::size_t at = places[i].at + static_cast<std::size_t>(offset);
            cells_[static_cast<std::size_t>(places[i].first) * layer + at] = static_cast<std::uint16_t>(i);
            cells_[static_cast<std::size_t>(places[i].second) * layer + at] = static_cast<std::uint16_t>(i);
        }
    }
}

}  // namespace depth
