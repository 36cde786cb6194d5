// Distortion by OpenCV's five terms, and its inverse by Newton's method.
#include "places.hpp"

#include <algorithm>
#include <cmath>

namespace {

// Image point that the lens makes of a pinhole's, and the derivatives of the former by the latter.
Place distorted(const View &view, double px, double py)
{
    const double x = (px - view.cx) * view.per_fx, y = (py - view.cy) * view.per_fy;
    const auto &[k1, k2, p1, p2, k3] = view.distortion;
    const double r2 = x * x + y * y;
    const double radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    const double slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3)); // d radial / dx = x * slope
    const double cross = x * y * slope + 2.0 * (p1 * x + p2 * y);
    Place place;
    place.x = view.cx + view.fx * (x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x));
    place.y = view.cy + view.fy * (y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y);
    place.right_x = radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x;
    place.right_y = view.fy * view.per_fx * cross;
    place.down_x = view.fx * view.per_fy * cross;
    place.down_y = radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x;
    return place;
}

Place undistorted(const View &view, double px, double py)
{
    double x = px, y = py;
    Place step;
    for (int k = 0; k < 12; k++) {
        step = distorted(view, x, y);
        const double det = step.right_x * step.down_y - step.down_x * step.right_y;
        const double off_x = px - step.x, off_y = py - step.y;
        x += (step.down_y * off_x - step.down_x * off_y) / det;
        y += (step.right_x * off_y - step.right_y * off_x) / det;
        if (std::abs(off_x) + std::abs(off_y) < 1e-9)
            break;
    }
    const double det = step.right_x * step.down_y - step.down_x * step.right_y;
    return {x, y, step.down_y / det, -step.right_y / det, -step.down_x / det, step.right_x / det};
}

Box clipped(double x0, double x1, double y0, double y1, const Places &places)
{
    const double left = -places.pad, right = places.width + places.pad;
    const double upper = -places.pad, lower = places.height + places.pad;
    return {static_cast<int>(std::floor(std::clamp(x0 - 1.0, left, right))),
            static_cast<int>(std::ceil(std::clamp(x1 + 2.0, left, right))),
            static_cast<int>(std::floor(std::clamp(y0 - 1.0, upper, lower))),
            static_cast<int>(std::ceil(std::clamp(y1 + 2.0, upper, lower)))};
}

} // namespace

Places::Places(const View &view, int margin)
    : width(view.width), height(view.height), pad(margin), view_(view), x0_(-margin - 1.0),
      x1_(view.width + margin), y0_(-margin - 1.0), y1_(view.height + margin)
{
    if (view.distortion == std::array<double, 5>{})
        return;
    table_.reserve(static_cast<std::size_t>(width + 2 * pad) * (height + 2 * pad));
    for (int y = -pad; y < height + pad; y++)
        for (int x = -pad; x < width + pad; x++) {
            const Place &place = table_.emplace_back(undistorted(view, x, y));
            x0_ = std::min(x0_, place.x - 1.0), x1_ = std::max(x1_, place.x + 1.0);
            y0_ = std::min(y0_, place.y - 1.0), y1_ = std::max(y1_, place.y + 1.0);
        }
    // A curve lies off its chord by at most an eighth of its second difference times the steps squared.
    for (int y = -pad; y < height + pad; y++)
        for (int x = -pad + 1; x + 1 < width + pad; x++) {
            const Place before = at(x - 1, y), here = at(x, y), after = at(x + 1, y);
            const double turn = std::max(std::abs(before.x - 2.0 * here.x + after.x),
                                         std::abs(before.y - 2.0 * here.y + after.y));
            bend_ = std::max(bend_, turn * block * block / 8.0);
        }
}

Box Places::pixels_of(double x0, double x1, double y0, double y1) const
{
    if (table_.empty())
        return clipped(x0, x1, y0, y1, *this);
    x0 = std::max(x0, x0_), x1 = std::min(x1, x1_), y0 = std::max(y0, y0_), y1 = std::min(y1, y1_);
    if (x0 >= x1 || y0 >= y1)
        return {};
    constexpr int steps = 32; // along each side, between which the lens bends it by far less than a pixel
    double left = 1e9, right = -1e9, upper = 1e9, lower = -1e9;
    for (int k = 0; k <= steps; k++) {
        const double x = x0 + (x1 - x0) * k / steps, y = y0 + (y1 - y0) * k / steps;
        for (const Place &p :
             {distorted(view_, x, y0), distorted(view_, x, y1), distorted(view_, x0, y), distorted(view_, x1, y)}) {
            left = std::min(left, p.x), right = std::max(right, p.x);
            upper = std::min(upper, p.y), lower = std::max(lower, p.y);
        }
    }
    return clipped(left, right, upper, lower, *this);
}
