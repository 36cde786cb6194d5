// Points in the image plane and the few operations the net needs on them.
#pragma once

#include <cmath>

namespace rbdn {

// Pixel k covers [k, k + 1) on both axes; y grows downwards.
struct Vec2 {
    double x = 0.0;
    double y = 0.0;
};

inline Vec2 operator+(Vec2 a, Vec2 b) { return {a.x + b.x, a.y + b.y}; }
inline Vec2 operator-(Vec2 a, Vec2 b) { return {a.x - b.x, a.y - b.y}; }
inline Vec2 operator*(double s, Vec2 a) { return {s * a.x, s * a.y}; }
inline double dot(Vec2 a, Vec2 b) { return a.x * b.x + a.y * b.y; }
inline double cross(Vec2 a, Vec2 b) { return a.x * b.y - a.y * b.x; }
inline double length(Vec2 a) { return std::sqrt(dot(a, a)); }

// As std::floor and std::ceil for coordinates, which fit an int; without SSE4 those are function calls.
inline int floor_px(double v) {
    const int whole = static_cast<int>(v);
    return whole - (v < whole);
}
inline int ceil_px(double v) {
    const int whole = static_cast<int>(v);
    return whole + (v > whole);
}

// The normal that points to the left face of an edge with direction `along`.
inline Vec2 left_normal(Vec2 along) {
    const double size = length(along);
    return {along.y / size, -along.x / size};
}

// Grows with atan2(d.y, d.x), from -2 to 2, without its cost.
inline double turn_of(Vec2 d) {
    const double size = std::abs(d.x) + std::abs(d.y);
    if (size == 0.0) return 0.0;
    const double rise = d.y / size;
    if (d.x >= 0.0) return rise;
    return d.y >= 0.0 ? 2.0 - rise : -2.0 - rise;
}

// Nearest point of a segment, as the fraction of the way from `a` to `b`.
inline double nearest_fraction(Vec2 p, Vec2 a, Vec2 b) {
    const Vec2 along = b - a;
    const double size2 = dot(along, along);
    if (size2 <= 0.0) return 0.0;
    const double t = dot(p - a, along) / size2;
    return t < 0.0 ? 0.0 : t > 1.0 ? 1.0 : t;
}

inline bool inside_triangle(Vec2 p, Vec2 a, Vec2 b, Vec2 c) {
    const double u = cross(b - a, p - a);
    const double v = cross(c - b, p - b);
    const double w = cross(a - c, p - c);
    return (u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0);
}

}  // namespace rbdn
