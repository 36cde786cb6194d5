// Vectors and rotations in space, and points in the image: the few operations that depth needs.
#pragma once

#include <array>
#include <cmath>

namespace depth {

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

struct Vec3 {
    double x = 0.0;
    double y = 0.0;
    double z = 0.0;
};

inline Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator*(double s, Vec3 a) { return {s * a.x, s * a.y, s * a.z}; }
inline double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline double length(Vec3 a) { return std::sqrt(dot(a, a)); }

// Row-major.
struct Mat3 {
    std::array<double, 9> m{1, 0, 0, 0, 1, 0, 0, 0, 1};

    double operator()(int row, int column) const { return m[static_cast<std::size_t>(3 * row + column)]; }
    double& operator()(int row, int column) { return m[static_cast<std::size_t>(3 * row + column)]; }
};

inline Vec3 operator*(const Mat3& a, Vec3 v) {
    return {a(0, 0) * v.x + a(0, 1) * v.y + a(0, 2) * v.z, a(1, 0) * v.x + a(1, 1) * v.y + a(1, 2) * v.z,
            a(2, 0) * v.x + a(2, 1) * v.y + a(2, 2) * v.z};
}

inline Mat3 operator*(const Mat3& a, const Mat3& b) {
    Mat3 out;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) out(i, j) = a(i, 0) * b(0, j) + a(i, 1) * b(1, j) + a(i, 2) * b(2, j);
    return out;
}

inline Mat3 transposed(const Mat3& a) {
    Mat3 out;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) out(i, j) = a(j, i);
    return out;
}

// Rotation by the vector `w`, its length the angle in rad.
inline Mat3 rotation_by(Vec3 w) {
    const double angle = length(w);
    if (angle < 1e-15) return {};
    const Vec3 u = (1 / angle) * w;
    const double c = std::cos(angle), s = std::sin(angle), v = 1 - c;
    return {{c + u.x * u.x * v, u.x * u.y * v - u.z * s, u.x * u.z * v + u.y * s,  //
             u.y * u.x * v + u.z * s, c + u.y * u.y * v, u.y * u.z * v - u.x * s,  //
             u.z * u.x * v - u.y * s, u.z * u.y * v + u.x * s, c + u.z * u.z * v}};
}

// Angle in rad of a rotation.
inline double angle_of(const Mat3& r) {
    // by the sine where the cosine says nothing of small angles
    const Vec3 w{r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1)};
    return std::atan2(length(w), r(0, 0) + r(1, 1) + r(2, 2) - 1);
}

}  // namespace depth
