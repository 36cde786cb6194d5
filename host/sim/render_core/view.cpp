// Projection of surfaces into a view, and the intersection of rays with them.
#include "view.hpp"

#include <algorithm>
#include <vector>

namespace {

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
    const double top = s.shape == Shape::sphere ? o.y - s.radius : o.y - s.height;
    const double bottom = s.shape == Shape::sphere ? o.y + s.radius : o.y;
    std::vector<Vec3> corners;
    for (const double x : {o.x - s.radius, o.x + s.radius})
        for (const double y : {top, bottom})
            for (const double z : {o.z - s.radius, o.z + s.radius})
                corners.push_back({x, y, z});
    return corners;
}

// Pixels that the surface can touch; false when there are none.
bool bound(const Surface &surface, const View &view, int pad, Seen &seen)
{
    double x0 = 1e9, x1 = -1e9, y0 = 1e9, y1 = -1e9;
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
    const double left = -pad, right = view.width + pad, upper = -pad, lower = view.height + pad;
    if (behind > 0)
        x0 = left, x1 = right, y0 = upper, y1 = lower;
    seen.x0 = static_cast<int>(std::floor(std::clamp(x0 - 1.0, left, right)));
    seen.x1 = static_cast<int>(std::ceil(std::clamp(x1 + 2.0, left, right)));
    seen.y0 = static_cast<int>(std::floor(std::clamp(y0 - 1.0, upper, lower)));
    seen.y1 = static_cast<int>(std::ceil(std::clamp(y1 + 2.0, upper, lower)));
    return seen.x0 < seen.x1 && seen.y0 < seen.y1;
}

Linear sum(const Linear &a, double k, const Linear &b) { return {a.x + k * b.x, a.y + k * b.y, a.c + k * b.c}; }

double accept(double inverse_depth)
{
    return inverse_depth > 0.0 && inverse_depth < 1.0 / near_cm ? inverse_depth : 0.0;
}

// Nearer root of the quadratic a t^2 + 2 b t + c = 0 as 1/t; a negative discriminant counts as none,
// or as zero when `force` is set.
double inverse_of_near_root(double a, double b, double c, bool force)
{
    double discriminant = b * b - a * c;
    if (discriminant < 0.0) {
        if (!force)
            return 0.0;
        discriminant = 0.0;
    }
    // t = c / (-b + sqrt): stable, since in front of the camera b < 0
    return (-b + std::sqrt(discriminant)) / c;
}

double curved_at(const Surface &s, const View &view, double px, double py, bool force)
{
    const Vec3 d = view.ray(px, py), o = view.eye - s.origin;
    if (s.shape == Shape::sphere) {
        const double c = dot(o, o) - s.radius * s.radius;
        return c <= 0.0 ? 0.0 : accept(inverse_of_near_root(dot(d, d), dot(d, o), c, force));
    }
    const double c = o.x * o.x + o.z * o.z - s.radius * s.radius;
    if (c <= 0.0)
        return 0.0;
    const double inverse = inverse_of_near_root(d.x * d.x + d.z * d.z, d.x * o.x + d.z * o.z, c, force);
    if (inverse <= 0.0)
        return 0.0;
    const double up = -(o.y + d.y / inverse);
    return force || (up >= 0.0 && up <= s.height) ? accept(inverse) : 0.0;
}

} // namespace

bool see(const Surface &surface, const View &view, int pad, Seen &seen)
{
    seen.surface = &surface;
    if (!bound(surface, view, pad, seen))
        return false;
    if (!surface.planar())
        return true;
    const double distance = dot(surface.normal, surface.origin - view.eye);
    if (distance >= 0.0) // seen from behind, or edge on
        return false;
    const Linear towards = view.along(surface.normal);
    seen.inverse_depth = {towards.x / distance, towards.y / distance, towards.c / distance};
    const Vec3 offset = view.eye - surface.origin;
    std::array<Linear, 2> on; // coordinates on the surface, divided by depth
    for (int k = 0; k < 2; k++) {
        const Vec3 &edge = k == 0 ? surface.u : surface.v;
        const Vec3 dual = (1.0 / dot(edge, edge)) * edge;
        on[k] = sum(view.along(dual), dot(offset, dual), seen.inverse_depth);
    }
    if (surface.shape == Shape::quad)
        seen.inside = {on[0], sum(seen.inverse_depth, -1.0, on[0]), on[1], sum(seen.inverse_depth, -1.0, on[1])};
    else
        seen.inside = {on[0], on[1], {}, {}};
    return true;
}

double inverse_depth_at(const Seen &seen, const View &view, double px, double py)
{
    const Surface &surface = *seen.surface;
    if (!surface.planar())
        return curved_at(surface, view, px, py, false);
    const double inverse = accept(seen.inverse_depth.at(px, py));
    if (inverse == 0.0)
        return 0.0;
    if (surface.shape == Shape::disc) {
        const double a = seen.inside[0].at(px, py), b = seen.inside[1].at(px, py);
        return a * a + b * b <= inverse * inverse ? inverse : 0.0;
    }
    for (const Linear &edge : seen.inside)
        if (edge.at(px, py) < 0.0)
            return 0.0;
    return inverse;
}

double inverse_depth_near(const Seen &seen, const View &view, double px, double py)
{
    const Surface &surface = *seen.surface;
    return surface.planar() ? accept(seen.inverse_depth.at(px, py)) : curved_at(surface, view, px, py, true);
}
