// Takes the lens's distortion out of image points: OpenCV's five terms.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

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
        Vec2 out;
        straighten<1>(&px, &out);
        return out;
    }

    // The same of many places: some side by side take less time than one after the other.
    void ideal(const Vec2* px, std::size_t count, Vec2* out) const {
        std::size_t n = 0;
        for (; n + SIDE_BY_SIDE <= count; n += SIDE_BY_SIDE) straighten<SIDE_BY_SIDE>(px + n, out + n);
        for (; n < count; ++n) straighten<1>(px + n, out + n);
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
    // Each of them stops by itself, so that the others do not matter.
    template <std::size_t N>
    void straighten(const Vec2* px, Vec2* out) const {
        if (!bends_) {
            std::copy(px, px + N, out);
            return;
        }
        double u[N], v[N], x[N], y[N], off_x[N], off_y[N];
        for (std::size_t i = 0; i < N; ++i) u[i] = x[i] = (px[i].x - cx_) / fx_, v[i] = y[i] = (px[i].y - cy_) / fy_;
        const auto [k1, k2, p1, p2, k3] = terms_;
        for (int step = 0; step < 5; ++step)
            for (std::size_t i = 0; i < N; ++i) {
                const double a = x[i], b = y[i];
                const double r2 = a * a + b * b, stretch = 1 + ((k3 * r2 + k2) * r2 + k1) * r2;
                const double dx = 2 * p1 * a * b + p2 * (r2 + 2 * a * a), dy = p1 * (r2 + 2 * b * b) + 2 * p2 * a * b;
                x[i] = stretch > 0 ? (u[i] - dx) / stretch : a;  // beyond what the lens can show
                y[i] = stretch > 0 ? (v[i] - dy) / stretch : b;
            }
        for (int step = 0; step < MORE_STEPS; ++step) {  // that leaves up to 0.1 px in the corners of a wide lens
            for (std::size_t i = 0; i < N; ++i) {
                const double a = x[i], b = y[i];
                const double r2 = a * a + b * b, stretch = 1 + ((k3 * r2 + k2) * r2 + k1) * r2;
                off_x[i] = u[i] - (a * stretch + 2 * p1 * a * b + p2 * (r2 + 2 * a * a));
                off_y[i] = v[i] - (b * stretch + p1 * (r2 + 2 * b * b) + 2 * p2 * a * b);
            }
            bool far = false;
            for (std::size_t i = 0; i < N; ++i)
                if (std::abs(off_x[i]) * fx_ > CLOSE_PX || std::abs(off_y[i]) * fy_ > CLOSE_PX)
                    x[i] += off_x[i], y[i] += off_y[i], far = true;
            if (!far) break;
        }
        for (std::size_t i = 0; i < N; ++i) out[i] = {x[i] * fx_ + cx_, y[i] * fy_ + cy_};
    }

    static constexpr std::size_t SIDE_BY_SIDE = 4;
    static constexpr int MORE_STEPS = 20;
    static constexpr double CLOSE_PX = 1e-6;

    double fx_, fy_, cx_, cy_;
    std::array<double, 5> terms_;
    bool bends_ = false;
};

}  // namespace depth
