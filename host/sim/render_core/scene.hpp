// What there is to see: surfaces with their materials, a lamp, and what throws shadows on the floor.
// World axes x right, y down, z forward; lengths in cm; colours BGR, linear, 1 = white paper.
#pragma once

#include <cstdint>
#include <vector>

#include "vec3.hpp"

enum class Pattern { plain, wood, tiles };

struct Material {
    Pattern pattern = Pattern::plain;
    Vec3 colour;             // mean albedo
    double contrast = 0.0;   // of the noise, relative to the colour
    double scale_cm = 5.0;   // of the noise; plank width of wood, tile side of tiles
    uint32_t seed = 0;
    double gloss = 0.0; // brightness of the lamp's reflection, relative to white paper
};

enum class Shape { quad, disc, ellipsoid, cone };

struct Surface {
    Shape shape = Shape::quad;
    Vec3 origin;       // quad: a corner; disc, ellipsoid: centre; cone: centre of the base
    Vec3 u, v;         // quad: edges from the corner; disc: two radii at a right angle; ellipsoid: two half axes
    Vec3 w;            // ellipsoid: the third half axis
    Vec3 normal;       // quad, disc: unit, towards the side that can be seen
    double radius = 0; // ellipsoid: mean half axis; cone: at the base
    double top = 0;    // cone: radius at its upper end
    double height = 0; // cone: upwards (towards -y)
    int part = 0;      // 1 and up
    int object = 0;    // 1 and up
    Material material;
    bool shadowed = false; // takes shadows of the occluders (the floor)

    bool planar() const { return shape == Shape::quad || shape == Shape::disc; }
};

// Something above the floor, as its shadow needs it.
struct Occluder {
    double x = 0, z = 0;           // middle of the footprint
    double half_u = 0, half_v = 0; // of a rectangle; 0 for a round one
    double cos_yaw = 1, sin_yaw = 0;
    double radius = 0; // of a round footprint; 0 for a rectangle
    double height = 0; // of its upper end above the floor
    double base = 0;   // of its lower end
};

struct Light {
    Vec3 lamp;            // position
    double ambient = 0.3; // from everywhere
    double sky = 0.3;     // on what faces upwards, half of it on walls
    double direct = 0.5;  // from the lamp, at full incidence, at reference_cm
    double reference_cm = 250.0;
};

struct Scene {
    std::vector<Surface> surfaces;
    std::vector<Occluder> occluders;
    Light light;
    double floor_y = 0.0;
};
