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
        return c <= 0.0 ? 0.0 : in_front(inverse_of_near_root(dot(d, d), dot(d, o), c, force));
    }
    const double c = o.x * o.x + o.z * o.z - s.radius * s.radius;
    if (c <= 0.0)
        return 0.0;
    const double inverse = inverse_of_near_root(d.x * d.x + d.z * d.z, d.x * o.x + d.z * o.z, c, force);
    if (inverse <= 0.0)
        return 0.0;
    const double up = -(o.y + d.y / inverse);
    return force || (up >= 0.0 && up <= s.height) ? in_front(inverse) : 0.0;
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

double inverse_depth_at(const Seen &seen, const View &view, double px, double py)
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
        return curved_at(*seen.surface, view, px, py, false);
    }
}

double inverse_depth_near(const Seen &seen, const View &view, double px, double py)
{
    const Surface &surface = *seen.surface;
    return surface.planar() ? in_front(seen.inverse_depth.at(px, py)) : curved_at(surface, view, px, py, true);
}

bool may_touch(const Seen &seen, const View &view, double px, double py)
{
    const Surface &s = *seen.surface;
    if (s.planar())
        return true;
    // how far off the ray through the pixel's centre a ray through its corner can be at the surface
    const Vec3 d = view.ray(px, py), o = view.eye - s.origin;
    const double far = std::sqrt(dot(o, o)) + s.radius + s.height;
    const double slack = far / std::min(view.fx, view.fy);
    const Vec3 n = s.shape == Shape::sphere ? cross(o, d) : Vec3{0.0, o.z * d.x - o.x * d.z, 0.0};
    const double along2 = s.shape == Shape::sphere ? dot(d, d) : d.x * d.x + d.z * d.z;
    const double reach = s.radius + slack;
    return dot(n, n) <= reach * reach * along2;
}
