// One picture of a scene in linear light, and what is true of it.
#pragma once

#include <cstdint>
#include <vector>

#include "places.hpp"
#include "view.hpp"

constexpr int blur_radius = 3;
constexpr int render_pad = blur_radius + 1; // one more: a pixel is judged by its neighbours

struct Truth {
    std::vector<float> depth;     // along the optical axis at each pixel's centre, 0 where nothing is
    std::vector<uint16_t> part;   // at each pixel's centre, 0 where nothing is
    std::vector<uint16_t> object; // likewise
    std::vector<double> area;     // visible pixels of each part, fractions included; [0] is nothing
    std::vector<double> mean_z;   // depth averaged over that area, 0 without one
};

// Light at the pixels, BGR interleaved, by rows. psf_px is the standard deviation of a Gaussian blur before the
// pixels' own integration; 0 for none. The rows are shared evenly among the views, from the top; each is of
// one lens, whose places with a pad of render_pad are given.
std::vector<float> render(const Scene &scene, const std::vector<View> &views, const Places &places, double psf_px);

// Areas and mean depths stay empty where they are not asked for: they take most of the time.
Truth truth(const Scene &scene, const View &view, const Places &places, bool areas);
