// Which pixel of the last image a turned camera sees at each pixel.
#include "turn.hpp"

#include <cstddef>
#include <vector>

namespace rbdn {

namespace {

// To the nearest whole number, an even one where two are as near. Whatever lies off [0, beyond) comes out off it.
float whole_up_to(float beyond, float v) {
    constexpr float kMagic = 12582912.0F;  // 1.5 * 2^23: the fraction does not fit beside it
    const float above = v > -2.0F ? v : -2.0F;  // also where v is no number
    const float within = above < beyond ? above : beyond;
    return (within + kMagic) - kMagic;
}

// Values between neighbouring nodes, `step_px` for each interval.
void spread(const std::vector<float>& nodes, int step_px, std::vector<float>& out) {
    const auto per_px = 1.0F / static_cast<float>(step_px);
    for (std::size_t k = 0; k + 1 < nodes.size(); ++k) {
        const float first = nodes[k], rise = nodes[k + 1] - nodes[k];
        float* values = &out[k * step_px];
        for (int n = 0; n < step_px; ++n) values[n] = first + static_cast<float>(n) * per_px * rise;
    }
}

}  // namespace

void turned_pixels(const float* nodes, int columns, int step_px, int width, int height, int* source) {
    const std::size_t size = static_cast<std::size_t>(columns - 1) * step_px;
    std::vector<float> node_x(columns), node_y(columns), at_x(size), at_y(size);
    const auto per_px = 1.0F / static_cast<float>(step_px);
    const auto beyond_x = static_cast<float>(width), beyond_y = static_cast<float>(height);
    for (int y = 0; y < height; ++y) {
        const float* above = nodes + 2 * static_cast<std::size_t>(y / step_px) * columns;
        const float* below = above + 2 * static_cast<std::size_t>(columns);
        const float down = static_cast<float>(y % step_px) * per_px;
        for (int k = 0; k < columns; ++k) {
            node_x[k] = above[2 * k] + down * (below[2 * k] - above[2 * k]);
            node_y[k] = above[2 * k + 1] + down * (below[2 * k + 1] - above[2 * k + 1]);
        }
        spread(node_x, step_px, at_x);
        spread(node_y, step_px, at_y);
        int* out = source + static_cast<std::size_t>(y) * width;
        for (int x = 0; x < width; ++x) {
            const float fx = whole_up_to(beyond_x, at_x[x]), fy = whole_up_to(beyond_y, at_y[x]);
            const bool inside = fx >= 0.0F && fy >= 0.0F && fx < beyond_x && fy < beyond_y;
            const int place = static_cast<int>(fy) * width + static_cast<int>(fx);
            out[x] = inside ? place : -1;
        }
    }
}

}  // namespace rbdn
