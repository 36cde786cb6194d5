// One picture of a scene in linear light, and what is true of it.
#pragma once

#include <cstdint>
#include <vector>

#include "view.hpp"

struct Truth {
    std::vector<float> depth;     // along the optical axis at each pixel's centre, 0 where nothing is
    std::vector<uint16_t> part;   // at each pixel's centre, 0 where nothing is
    std::vector<uint16_t> object; // likewise
    std::vector<double> area;     // visible pixels of each part, fractions included; [0] is nothing
    std::vector<double> mean_z;   // depth averaged over that area, 0 without one
};

// Light at the pixels, BGR interleaved, by rows. psf_px is the standard deviation of a Gaussian blur before the
// pixels' own integration; 0 for none.
std::vector<float> render(const Scene &scene, const View &view, double psf_px);

Truth truth(const Scene &scene, const View &view);
