#include "fill.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace nav {

namespace {

// First of `count` cells whose centre is not before a place.
std::size_t first_from(double place, std::size_t count) {
    return static_cast<std::size_t>(std::clamp(std::ceil(place), 0.0, static_cast<double>(count)));
}

}  // namespace

std::vector<std::uint16_t> fill(const std::vector<Outline>& outlines, std::size_t rows, std::size_t cols, double step,
                                std::uint16_t none) {
    std::vector<std::uint16_t> out(rows * cols, none);
    std::vector<std::uint8_t> flips(rows * (cols + 1), 0);  // where a row passes from outside to inside or back
    const double scale = 1 / step, centre = 0.5 * (step - 1);
    for (std::size_t begin = 0, end = 0; begin < outlines.size(); begin = end) {
        const std::uint16_t kind = outlines[begin].kind;
        std::size_t top = rows, bottom = 0, left = cols, right = 0;
        for (end = begin; end < outlines.size() && outlines[end].kind == kind; ++end) {
            const Outline& loop = outlines[end];
            for (std::size_t p = 0; p < loop.points; ++p) {
                const double* a = loop.xy + 2 * p;
                const double* b = loop.xy + 2 * (p + 1 < loop.points ? p + 1 : 0);
                if (a[1] > b[1]) std::swap(a, b);  // the same crossings for both neighbours
                const double x0 = (a[0] - centre) * scale, y0 = (a[1] - centre) * scale;
                const double y1 = (b[1] - centre) * scale;
                const std::size_t first = first_from(y0, rows), last = first_from(y1, rows);
                if (first >= last) continue;
                const double rise = ((b[0] - centre) * scale - x0) / (y1 - y0);
                for (std::size_t r = first; r < last; ++r) {
                    const std::size_t c = first_from(x0 + (static_cast<double>(r) - y0) * rise, cols);
                    flips[r * (cols + 1) + c] ^= 1;
                    left = std::min(left, c), right = std::max(right, c);
                }
                top = std::min(top, first), bottom = std::max(bottom, last);
            }
        }
        for (std::size_t r = top; r < bottom; ++r) {
            std::uint8_t* flip = &flips[r * (cols + 1)];
            std::uint8_t inside = 0;
            for (std::size_t c = left; c <= right; ++c) {
                inside ^= flip[c], flip[c] = 0;
                if (inside && c < cols) out[r * cols + c] = kind;
            }
        }
    }
    return out;
}

}  // namespace nav
