// Colour steps across edges, lightness in full: what tells an outline from shading.
//
// Two colours of one hue differ little once lightness is discounted, and so do the lit and the dark side of one
// thing. But lightness jumps at an outline, while it drifts where a surface turns from the light.
#pragma once

#include <vector>

#include "crossings.hpp"
#include "image.hpp"
#include "mesh.hpp"

namespace rbdn {

// Step across every edge in working units, less what the slopes beside it explain; 0 for edges between faces whose
// means are farther apart than `most_apart`, which need no second look. `lightness_gain` undoes the discount.
std::vector<float> measure_jumps(const Mesh& mesh, const Crossings& crossings, const Image& image,
                                 double most_apart, double lightness_gain);

// How much neighbouring faces differ where nothing steps: the median over all edges.
double typical_difference(const Mesh& mesh, double lightness_gain);

}  // namespace rbdn
