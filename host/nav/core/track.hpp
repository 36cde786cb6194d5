// How the places of one thing, seen one after the other, lie to the view.
#pragma once

#include <array>
#include <vector>

namespace nav {

struct Sight {
    double t_s, x_cm, z_cm;
};

// A unit vector from the camera to a thing.
struct Ray {
    double x, z;
};

// An even motion through places, by least squares: along the ray, and aside to the right of it.
struct EvenMotion {
    double along_cm_s, aside_cm_s;
    double stray_along_cm, stray_aside_cm;  // rms of the places about it
    double lever2_s2;                       // sum of the squares of the times from their middle
};
EvenMotion even_motion(const std::vector<Sight>& places, const Ray& ray);

// How far apart places lie, aside of the ray and along it.
struct Extent {
    double aside_cm, along_cm;
};
Extent extent(const std::vector<Sight>& places, const Ray& ray);

}  // namespace nav
