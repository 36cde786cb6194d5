// Projection of surfaces into a view, and the intersection of rays with them.
#include "view.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "places.hpp"

namespace {

// Corners of something convex that holds the surface.
std::vector<Vec3> hull(const Surface &s)
{
    const Vec3 &o = s.origin;
    switch (s.shape) {
    case Shape::quad:
        return {o, o + s.u, o + s.u + s.v, o + s.v};
    case Shape::disc:
        return {o - s.u - s.v, o + s.u - s.v, o + s.u + s.v, o - s.u + s.v};
    default:
        break;
    }
    std::vector<Vec3> corners;
    const double wide = std::max(s.radius, s.top);
    for (const double i : {-1.0, 1.0})
        for (const double j : {-1.0, 1.0})
            for (const double k : {-1.0, 1.0})
                corners.push_back(s.shape == Shape::ellipsoid
                                      ? o + i * s.u + j * s.v + k * s.w
                                      : o + Vec3{i * wide, j < 0.0 ? 0.0 : -s.height, k * wide});
    return corners;
}

// Pixels that the surface can touch; false when there are none.
bool bound(const Surface &surface, const View &view, const Places &places, Box &box)
{
    constexpr double endless = 1e9;
    double x0 = endless, x1 = -endless, y0 = endless, y1 = -endless;
    int behind = 0;
    const std::vector<Vec3> corners = hull(surface);
    for (const Vec3 &corner : corners) {
        const Vec3 d = corner - view.eye;
        const double z = dot(d, view.forward);
        if (z < near_cm) {
            behind++;
            continue;
        }
        const double px = view.cx + view.fx * dot(d, view.right) / z;
        const double py = view.cy + view.fy * dot(d, view.down) / z;
        x0 = std::min(x0, px), x1 = std::max(x1, px);
        y0 = std::min(y0, py), y1 = std::max(y1, py);
    }
    if (behind == static_cast<int>(corners.size()))
        return false;
    if (behind > 0)
        x0 = y0 = -endless, x1 = y1 = endless;
    box = places.pixels_of(x0, x1, y0, y1);
    return box.x0 < box.x1 && box.y0 < box.y1;
}

Linear sum(const Linear &a, double k, const Linear &b) { return {a.x + k * b.x, a.y + k * b.y, a.c + k * b.c}; }

// Where a ray enters a solid bounded by the quadratic a t^2 + 2 b t + c = 0, negative inside, as 1/t; 0 when it
// passes by.
double inverse_of_entry(double a, double b, double c)
{
    const double discriminant = b * b - a * c;
    if (discriminant < 0.0)
        return 0.0;
    const double root = std::sqrt(discriminant);
    return b < 0.0 ? (root - b) / c : -a / (root + b); // the same, without cancellation
}

double curved_at(const Seen &seen, double px, double py)
{
    const Surface &s = *seen.surface;
    const double x = seen.towards[0].at(px, py), y = seen.towards[1].at(px, py), z = seen.towards[2].at(px, py);
    const auto &[from_x, from_y, from_z] = seen.eye;
    if (s.shape == Shape::ellipsoid)
        return in_front(inverse_of_entry(x * x + y * y + z * z, x * from_x + y * from_y + z * from_z,
                                         from_x * from_x + from_y * from_y + from_z * from_z - 1.0));
    const double widening = (s.top - s.radius) / s.height;
    const double r = widening * y, from_r = s.radius + widening * from_y; // of the cone beside the ray
    const double inverse = inverse_of_entry(x * x + z * z - r * r, x * from_x + z * from_z - r * from_r,
                                            from_x * from_x + from_z * from_z - from_r * from_r);
    if (inverse <= 0.0)
        return 0.0;
    const double up = from_y + y / inverse;
    return up >= 0.0 && up <= s.height ? in_front(inverse) : 0.0;
}

// Coordinates on the surface's own axes.
void turn_to_axes(const Surface &s, const View &view, Seen &seen)
{
    const Vec3 offset = view.eye - s.origin;
    const bool ellipsoid = s.shape == Shape::ellipsoid;
    const std::array<Vec3, 3> axes
        = ellipsoid ? std::array{(1.0 / dot(s.u, s.u)) * s.u, (1.0 / dot(s.v, s.v)) * s.v, (1.0 / dot(s.w, s.w)) * s.w}
                    : std::array{Vec3{1, 0, 0}, Vec3{0, -1, 0}, Vec3{0, 0, 1}};
    double unit = 1.0; // shortest length that counts as 1
    if (ellipsoid)
        unit = std::sqrt(std::min({dot(s.u, s.u), dot(s.v, s.v), dot(s.w, s.w)}));
    for (int k = 0; k < 3; k++) {
        seen.towards[k] = view.along(axes[k]);
        seen.eye[k] = dot(axes[k], offset);
    }
    const double far = std::sqrt(dot(offset, offset)) + 3.0 * s.radius + s.top + s.height;
    seen.slack = far / std::min(view.fx, view.fy) / unit;
}

} // namespace

bool see(const Surface &surface, const View &view, const Places &places, Seen &seen)
{
    seen.surface = &surface;
    if (!bound(surface, view, places, seen.box))
        return false;
    if (!surface.planar()) {
        turn_to_axes(surface, view, seen);
        return true;
    }
    const double distance = dot(surface.normal, surface.origin - view.eye);
    if (distance >= 0.0) // seen from behind, or edge on
        return false;
    const Linear towards = view.along(surface.normal);
    seen.inverse_depth = {towards.x / distance, towards.y / distance, towards.c / distance};
    const Vec3 offset = view.eye - surface.origin;
    for (int k = 0; k < 2; k++) {
        const Vec3 &edge = k == 0 ? surface.u : surface.v;
        const Vec3 along = unit(edge);
        seen.length[k] = std::sqrt(dot(edge, edge));
        seen.on[k] = sum(view.along(along), dot(offset, along), seen.inverse_depth);
        const Linear &d = seen.inverse_depth, &on = seen.on[k];
        seen.inside[2 * k] = on;
        seen.inside[2 * k + 1] = sum({-on.x, -on.y, -on.c}, seen.length[k], d);
    }
    return true;
}

double inverse_depth_at(const Seen &seen, double px, double py)
{
    switch (seen.surface->shape) {
    case Shape::quad:
        return quad_inverse_depth(seen, px, py);
    case Shape::disc: {
        const double inverse = in_front(seen.inverse_depth.at(px, py));
        const double a = seen.on[0].at(px, py), b = seen.on[1].at(px, py), r = seen.length[0] * inverse;
        return a * a + b * b <= r * r ? inverse : 0.0;
    }
    default:
        return curved_at(seen, px, py);
    }
}

bool may_touch(const Seen &seen, double px, double py)
{
    const Surface &s = *seen.surface;
    if (s.planar())
        return true;
    const bool ellipsoid = s.shape == Shape::ellipsoid;
    const Vec3 d = {seen.towards[0].at(px, py), ellipsoid ? seen.towards[1].at(px, py) : 0.0, seen.towards[2].at(px, py)};
    const Vec3 n = cross({seen.eye[0], ellipsoid ? seen.eye[1] : 0.0, seen.eye[2]}, d);
    const double reach = (ellipsoid ? 1.0 : std::max(s.radius, s.top)) + seen.slack;
    return dot(n, n) <= reach * reach * dot(d, d);
}

// Outlines of convex bodies are convex, so what all corners show fills the pixel. Of a cone that goes for the side
// alone only where the rays enter well away from its ends.
bool covers(const Seen &seen, const std::array<double, 4> &corner_x, const std::array<double, 4> &corner_y,
            std::array<double, 4> &inverse_depth)
{
    double nearest = 0.0, farthest = 1e9, lowest = 1e9, highest = -1e9, steepest = 0.0;
    for (int k = 0; k < 4; k++) {
        inverse_depth[k] = inverse_depth_at(seen, corner_x[k], corner_y[k]);
        if (inverse_depth[k] == 0.0)
            return false;
        nearest = std::max(nearest, inverse_depth[k]), farthest = std::min(farthest, inverse_depth[k]);
        const double rise = seen.towards[1].at(corner_x[k], corner_y[k]);
        const double up = seen.eye[1] + rise / inverse_depth[k];
        lowest = std::min(lowest, up), highest = std::max(highest, up);
        steepest = std::max(steepest, std::abs(rise));
    }
    if (nearest > 0.5 / near_cm)
        return false;
    if (seen.surface->shape == Shape::ellipsoid)
        return true;
    const double bulge = 2.0 * (1.0 / farthest - 1.0 / nearest) + 0.05;
    const double margin = steepest * bulge + (highest - lowest) + 0.05;
    return lowest > margin && highest < seen.surface->height - margin;
}
