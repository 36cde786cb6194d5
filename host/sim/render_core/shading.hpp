// Colour of a point on a surface: texture filtered to the pixel's footprint, lamp, sky and shadow.
#pragma once

#include "view.hpp"

// Linear BGR of the surface where the ray through a pixel meets it at the given inverse depth.
Vec3 shade(const Scene &scene, const Seen &seen, const View &view, double px, double py, double inverse_depth);
