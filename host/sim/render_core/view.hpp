// A camera in the world, and where the rays through its pixels meet surfaces.
#pragma once

#include <array>

#include "scene.hpp"

// A linear function of pixel coordinates.
struct Linear {
    double x = 0, y = 0, c = 0;
    double at(double px, double py) const { return x * px + y * py + c; }
};

// Without distortion; `distortion` is for Places alone. Everything else counts pixels as this pinhole does.
struct View {
    Vec3 eye;
    Vec3 right, down, forward; // camera axes in the world
    double fx = 1, fy = 1, cx = 0, cy = 0;
    int width = 0, height = 0;
    std::array<double, 5> distortion{};      // OpenCV's k1, k2, p1, p2, k3
    double per_fx = 1 / fx, per_fy = 1 / fy; // every ray needs them

    // Ray through a pixel, with unit component along the optical axis: eye + z * ray has depth z.
    Vec3 ray(double px, double py) const
    {
        return ((px - cx) * per_fx) * right + ((py - cy) * per_fy) * down + forward;
    }
    // dot(ray(px, py), a)
    Linear along(const Vec3 &a) const
    {
        const double gx = dot(right, a) / fx, gy = dot(down, a) / fy;
        return {gx, gy, dot(forward, a) - cx * gx - cy * gy};
    }
};

// Pixels x0 <= x < x1, y0 <= y < y1.
struct Box {
    int x0 = 0, x1 = 0, y0 = 0, y1 = 0;
};

class Places;

// A surface as one view sees it. For planar ones inverse depth and the two coordinates on the surface,
// divided by depth, are linear in the image: that makes edges straight and tests cheap. On the others the
// point at depth z has the coordinates eye[k] + z * towards[k].at(px, py): of an ellipsoid along its half axes, in
// their lengths; of a cone (x, radius there, z) from its axis, in cm.
struct Seen {
    const Surface *surface = nullptr;
    Linear inverse_depth;
    std::array<Linear, 2> on;       // cm along u and v from the origin, divided by depth
    std::array<double, 2> length{}; // of u and v
    std::array<Linear, 4> inside;   // quad: all >= 0 inside
    std::array<Linear, 3> towards;
    std::array<double, 3> eye{};
    double slack = 0; // how far from a curved surface, in its coordinates, a pixel's rays may pass its centre's
    Box box;          // pixels that may show it
};

// Nearer than this to the camera's plane nothing is seen.
constexpr double near_cm = 0.5;

// False when nothing of the surface can be seen in the pixels of `places`.
bool see(const Surface &surface, const View &view, const Places &places, Seen &seen);

// What lies behind the camera or too near to it counts as no hit.
inline double in_front(double inverse_depth)
{
    return inverse_depth > 0.0 && inverse_depth < 1.0 / near_cm ? inverse_depth : 0.0;
}

// Inverse depth at which the ray through a pixel meets a quad; 0 when it does not.
inline double quad_inverse_depth(const Seen &seen, double px, double py)
{
    const bool hit = (seen.inside[0].at(px, py) >= 0.0) & (seen.inside[1].at(px, py) >= 0.0)
                     & (seen.inside[2].at(px, py) >= 0.0) & (seen.inside[3].at(px, py) >= 0.0);
    return hit ? in_front(seen.inverse_depth.at(px, py)) : 0.0;
}

// The same for any surface.
double inverse_depth_at(const Seen &seen, double px, double py);

// False when the surface surely shows nowhere in the pixel.
bool may_touch(const Seen &seen, double px, double py);

// True only when a curved surface surely fills the pixel with these corners; its inverse depths there bound it from
// behind, for it bulges towards the camera.
bool covers(const Seen &seen, const std::array<double, 4> &corner_x, const std::array<double, 4> &corner_y,
            std::array<double, 4> &inverse_depth);
