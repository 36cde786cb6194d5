// Texture, light and shadow.
#include "shading.hpp"

#include <algorithm>
#include <array>
#include <cstdint>

namespace {

constexpr double shininess = 60.0; // Blinn's exponent: painted wood, skin of fruit

// A point on a surface in the surface's own coordinates (cm), and how far one pixel reaches in each.
struct Spot {
    double u = 0, v = 0;
    double reach_u = 0, reach_v = 0;
};

uint32_t hash(int32_t x, int32_t y, uint32_t seed)
{
    uint32_t h = seed * 0x9E3779B9u + static_cast<uint32_t>(x) * 0x85EBCA6Bu + static_cast<uint32_t>(y) * 0xC2B2AE35u;
    h ^= h >> 15, h *= 0x2C1B3C6Du, h ^= h >> 12, h *= 0x297A2D39u, h ^= h >> 15;
    return h;
}

double lattice(int32_t x, int32_t y, uint32_t seed) { return hash(x, y, seed) * (2.0 / 4294967295.0) - 1.0; }

// std::floor and std::lerp are calls on a plain x86-64, and this is the innermost loop.
int32_t floor_of(double x)
{
    const auto down = static_cast<int32_t>(x);
    return down - (x < down);
}

double mix(double a, double b, double t) { return a + t * (b - a); }

double smooth(double t) { return t * t * t * (t * (6.0 * t - 15.0) + 10.0); }

// Value noise of wavelengths of about two lattice steps and more, in -1..1, mean 0.
double value_noise(double x, double y, uint32_t seed, NoiseCell &cell)
{
    const int32_t ix = floor_of(x), iy = floor_of(y);
    if (ix != cell.x || iy != cell.y)
        cell = {ix, iy,
                {lattice(ix, iy, seed), lattice(ix + 1, iy, seed), lattice(ix, iy + 1, seed),
                 lattice(ix + 1, iy + 1, seed)}};
    const double sx = smooth(x - ix), sy = smooth(y - iy);
    const auto &[a, b, c, d] = cell.corners;
    return mix(mix(a, b, sx), mix(c, d, sx), sy);
}

// Two octaves with lattice steps of step_u and step_v; an octave fades out before a pixel covers half of its
// step, so that nothing is drawn that the pixel grid cannot hold.
double noise(const Spot &spot, double step_u, double step_v, uint32_t seed, NoiseCells &cells)
{
    double sum = 0.0, gain = 0.65;
    for (uint32_t octave = 0; octave < noise_octaves; octave++) {
        const double covered = std::max(spot.reach_u / step_u, spot.reach_v / step_v);
        const double fade = std::clamp(2.0 - 2.5 * covered, 0.0, 1.0);
        if (fade == 0.0)
            break;
        sum += gain * fade * value_noise(spot.u / step_u, spot.v / step_v, seed + octave, cells[octave]);
        gain *= 0.55, step_u *= 0.45, step_v *= 0.45;
    }
    return sum;
}

// Share of [x - reach / 2, x + reach / 2] covered by lines of width `line` at every multiple of `period`.
double line_cover(double x, double reach, double period, double line)
{
    const auto integral = [&](double t) { // length of line in 0..t
        const double n = floor_of(t / period);
        return n * line + std::min(t - n * period, line);
    };
    const double width = std::max(reach, 1e-6 * period), middle = x + 0.5 * line;
    return (integral(middle + 0.5 * width) - integral(middle - 0.5 * width)) / width;
}

// Brightness of the planks under the footprint, relative, mean 0: each plank has its own.
double plank_tone(double x, double reach, double plank, uint32_t seed)
{
    const double left = (x - 0.5 * reach) / plank, right = (x + 0.5 * reach) / plank;
    const int32_t first = floor_of(left), last = floor_of(right);
    const auto tone = [&](int32_t k) { return lattice(k, 0, seed); };
    if (last == first)
        return tone(first);
    if (last > first + 1) // several under one pixel: their mean
        return 0.0;
    return (tone(first) * (last - left) + tone(last) * (right - last)) / (right - left);
}

Vec3 albedo(const Material &m, const Spot &spot, NoiseCells &cells)
{
    double light = 1.0;
    switch (m.pattern) {
    case Pattern::plain:
        light += m.contrast * noise(spot, m.scale_cm, m.scale_cm, m.seed, cells);
        break;
    case Pattern::wood: // grain along v
        light += m.contrast * (0.8 * noise(spot, 0.18 * m.scale_cm, 5.0 * m.scale_cm, m.seed, cells)
                               + 0.35 * plank_tone(spot.u, spot.reach_u, m.scale_cm, m.seed + 7));
        light *= 1.0 - 0.35 * line_cover(spot.u, spot.reach_u, m.scale_cm, 0.15);
        break;
    case Pattern::tiles: {
        const double grout_u = line_cover(spot.u, spot.reach_u, m.scale_cm, 0.5);
        const double grout_v = line_cover(spot.v, spot.reach_v, m.scale_cm, 0.5);
        light += m.contrast * noise(spot, 0.2 * m.scale_cm, 0.2 * m.scale_cm, m.seed, cells);
        light *= 1.0 - 0.3 * (grout_u + grout_v - grout_u * grout_v);
        break;
    }
    }
    return std::max(light, 0.0) * m.colour;
}

// Reach of one pixel along a direction in the tangent plane: the point moves with the ray and with the depth
// at which the ray meets the plane.
double reach(const View &view, const Vec3 &ray, const Vec3 &normal, double depth, const Vec3 &along)
{
    const double towards = dot(normal, ray);
    if (std::abs(towards) < 1e-9)
        return 1e9;
    const Vec3 slide = along - (dot(along, ray) / towards) * normal; // dot(d ray, slide) * depth = d point . along
    return depth * (std::abs(dot(view.right, slide)) / view.fx + std::abs(dot(view.down, slide)) / view.fy);
}

Spot planar_spot(const Seen &seen, double px, double py, double depth)
{
    Spot spot;
    for (int k = 0; k < 2; k++) { // quotient of two linear functions, and its derivatives
        const Linear &on = seen.on[k], &d = seen.inverse_depth;
        const double at = on.at(px, py) * depth;
        const double reach_here = depth * (std::abs(on.x - at * d.x) + std::abs(on.y - at * d.y));
        (k == 0 ? spot.u : spot.v) = at;
        (k == 0 ? spot.reach_u : spot.reach_v) = reach_here;
    }
    return spot;
}

// Also finds the normal.
Spot curved_spot(const Seen &seen, const View &view, double px, double py, double depth, Vec3 &normal)
{
    const Surface &s = *seen.surface;
    std::array<double, 3> at{}; // on the surface's own axes
    for (int k = 0; k < 3; k++)
        at[k] = seen.eye[k] + depth * seen.towards[k].at(px, py);
    const double around = std::atan2(at[0], -at[2]);
    Vec3 along_u, along_v;
    Spot spot;
    spot.u = s.radius * around;
    if (s.shape == Shape::ellipsoid) {
        normal = unit((at[0] / dot(s.u, s.u)) * s.u + (at[1] / dot(s.v, s.v)) * s.v + (at[2] / dot(s.w, s.w)) * s.w);
        along_u = unit(std::cos(around) * s.u + std::sin(around) * s.w);
        along_v = cross(along_u, normal);
        spot.v = s.radius * std::asin(std::clamp(at[1], -1.0, 1.0));
    } else {
        normal = unit({std::sin(around), (s.top - s.radius) / s.height, -std::cos(around)});
        along_u = {std::cos(around), 0.0, std::sin(around)};
        along_v = cross(along_u, normal);
        spot.v = -at[1];
    }
    const Vec3 ray = view.ray(px, py);
    spot.reach_u = reach(view, ray, normal, depth, along_u);
    spot.reach_v = reach(view, ray, normal, depth, along_v);
    return spot;
}

double distance_to(const Occluder &o, double x, double z)
{
    const double dx = x - o.x, dz = z - o.z;
    if (o.radius > 0.0)
        return std::sqrt(dx * dx + dz * dz) - o.radius;
    const double a = std::abs(o.cos_yaw * dx - o.sin_yaw * dz) - o.half_u;
    const double b = std::abs(o.sin_yaw * dx + o.cos_yaw * dz) - o.half_v;
    const double out_a = std::max(a, 0.0), out_b = std::max(b, 0.0);
    return std::sqrt(out_a * out_a + out_b * out_b) + std::min(std::max(a, b), 0.0);
}

// The ambient light's share near the foot of something; beyond this much of its reach no float tells it from 1.
constexpr double contact_cm = 3.5, contact_ends = 16.0;

// Share of the lamp's and of the ambient light that things standing about leave on the floor.
void shadow(const Scene &scene, const Vec3 &point, double &lamp, double &ambient)
{
    const double height = scene.floor_y - scene.light.lamp.y;
    const double slope_x = (scene.light.lamp.x - point.x) / height;
    const double slope_z = (scene.light.lamp.z - point.z) / height;
    const double slope2 = slope_x * slope_x + slope_z * slope_z;
    const double slope = std::sqrt(slope2), per_slope2 = slope2 > 0.0 ? 1.0 / slope2 : 0.0;
    for (const Occluder &o : scene.occluders) {
        const double size = o.radius > 0.0 ? o.radius : o.half_u + o.half_v;
        const double away = size + slope * o.height + 0.3 * o.height + 14.0;
        const double dx = point.x - o.x, dz = point.z - o.z;
        const double distance2 = dx * dx + dz * dz;
        if (distance2 > away * away)
            continue;
        const double reach = size + contact_ends * contact_cm;
        if (distance2 < reach * reach) {
            const double contact = std::max(distance_to(o, point.x, point.z), 0.0);
            ambient *= 1.0 - 0.5 * std::exp(-(contact + o.base) / contact_cm);
        }
        // Where the ray to the lamp comes nearest to the middle; too far even there, it passes.
        const double top = o.base + 0.85 * (o.height - o.base);
        const double nearest_up = std::clamp(-(dx * slope_x + dz * slope_z) * per_slope2, 0.0, top);
        const double near_x = dx + nearest_up * slope_x, near_z = dz + nearest_up * slope_z;
        const double blocked = size + 2.0 + 0.3 * top;
        if (near_x * near_x + near_z * near_z > blocked * blocked)
            continue;
        double passed = 1.0;
        for (const double part : {0.2, 0.5, 0.85}) { // where the ray to the lamp is at this part of the height
            const double up = o.base + part * (o.height - o.base), soft = 2.0 + 0.3 * up;
            const double d = distance_to(o, point.x + slope_x * up, point.z + slope_z * up);
            const double t = std::clamp(0.5 + 0.5 * d / soft, 0.0, 1.0);
            passed = std::min(passed, t * t * (3.0 - 2.0 * t));
        }
        lamp *= passed;
    }
}

} // namespace

Shader::Shader(const Scene &scene, const View &view, const std::vector<Seen> &seen)
    : scene_(scene), view_(view), seen_(seen), cells_(seen.size())
{
}

Vec3 Shader::at(int which, double px, double py, double inverse_depth)
{
    const Seen &seen = seen_[which];
    const Scene &scene = scene_;
    const View &view = view_;
    const Surface &s = *seen.surface;
    const double depth = 1.0 / inverse_depth;
    const Vec3 ray = view.ray(px, py), point = view.eye + depth * ray;

    Vec3 normal = s.normal;
    const Spot spot = s.planar() ? planar_spot(seen, px, py, depth) : curved_spot(seen, view, px, py, depth, normal);

    const Light &light = scene.light;
    const Vec3 to_lamp = light.lamp - point;
    const double distance2 = dot(to_lamp, to_lamp);
    const double incidence = std::max(dot(normal, to_lamp), 0.0) / std::sqrt(distance2);
    double lamp = light.direct * incidence * light.reference_cm * light.reference_cm / distance2;
    double ambient = light.ambient + light.sky * (0.5 - 0.5 * normal.y);
    if (s.shadowed)
        shadow(scene, point, lamp, ambient);
    Vec3 colour = (lamp + ambient) * albedo(s.material, spot, cells_[which]);
    if (s.material.gloss > 0.0) {
        const Vec3 half = unit(unit(to_lamp) - unit(ray));
        const double shine = s.material.gloss * std::pow(std::max(dot(normal, half), 0.0), shininess);
        colour = colour + Vec3{shine, shine, shine};
    }
    return colour;
}
