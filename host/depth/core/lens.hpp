// Takes the lens's distortion out of image points: OpenCV's five terms.
#pragma once

#include <array>
#include <cmath>

#include "space.hpp"

namespace depth {

class Lens {
  public:
    Lens(double fx, double fy, double cx, double cy, const std::array<double, 5>& terms)
        : fx_(fx), fy_(fy), cx_(cx), cy_(cy), terms_(terms) {
        for (const double t : terms) bends_ = bends_ || t != 0;
    }

    bool bends() const { return bends_; }

    // Where a camera without distortion, with the same focal lengths and centre, would see what is at `px`.
    Vec2 ideal(Vec2 px) const {
        if (!bends_) return px;
        const double u = (px.x - cx_) / fx_, v = (px.y - cy_) / fy_;
        const auto [k1, k2, p1, p2, k3] = terms_;
        double x = u, y = v;
        for (int i = 0; i < 5; ++i) {
            const double r2 = x * x + y * y, stretch = 1 + ((k3 * r2 + k2) * r2 + k1) * r2;
            if (!(stretch > 0)) break;
            const double dx = 2 * p1 * x * y + p2 * (r2 + 2 * x * x), dy = p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
            x = (u - dx) / stretch, y = (v - dy) / stretch;
        }
        for (int i = 0; i < MORE_STEPS; ++i) {  // that leaves up to 0.1 px in the corners of a wide lens
            const double r2 = x * x + y * y, stretch = 1 + ((k3 * r2 + k2) * r2 + k1) * r2;
            const double off_x = u - (x * stretch + 2 * p1 * x * y + p2 * (r2 + 2 * x * x));
            const double off_y = v - (y * stretch + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y);
            if (!(std::abs(off_x) * fx_ > CLOSE_PX || std::abs(off_y) * fy_ > CLOSE_PX)) break;
            x += off_x, y += off_y;
        }
        return {x * fx_ + cx_, y * fy_ + cy_};
    }

    // A unit vector across a line at `px`, likewise; `at` is the ideal place of `px`.
    Vec2 ideal_normal(Vec2 at, Vec2 normal) const {
        if (!bends_) return normal;
        const double x = (at.x - cx_) / fx_, y = (at.y - cy_) / fy_;
        const auto [k1, k2, p1, p2, k3] = terms_;
        const double r2 = x * x + y * y, stretch = 1 + ((k3 * r2 + k2) * r2 + k1) * r2;
        const double grow = 2 * ((3 * k3 * r2 + 2 * k2) * r2 + k1);  // of the stretch, by half of r2
        // what the lens makes of a step, turned round: (xx xy; yx yy) by x and y
        const double xx = stretch + grow * x * x + 2 * p1 * y + 6 * p2 * x, xy = grow * x * y + 2 * p1 * x + 2 * p2 * y;
        const double yy = stretch + grow * y * y + 6 * p1 * y + 2 * p2 * x;
        const double u = -normal.y / fx_, v = normal.x / fy_;
        const Vec2 along{(yy * u - xy * v) * fx_, (xx * v - xy * u) * fy_};
        const double size = 1 / length(along);
        return {along.y * size, -along.x * size};
    }

  private:
    static constexpr int MORE_STEPS = 20;
    static constexpr double CLOSE_PX = 1e-6;

    double fx_, fy_, cx_, cy_;
    std::array<double, 5> terms_;
    bool bends_ = false;
};

}  // namespace depth
