// Fragmentation: pixels that fit their polygon no longer are cut out of it, locally (section 3 of the paper).
#pragma once

#include <vector>

#include "crossings.hpp"
#include "image.hpp"
#include "mesh.hpp"

namespace rbdn {

// One byte a pixel: 1 where the pixel and most of its neighbours are far from their face's mean.
std::vector<char> off_pixels(const Mesh& mesh, const Crossings& crossings, const Image& image, double gate);

// Cuts new off-pixels into faces of their own, in squares, so that the deformation can regroup them. Blobs that
// were mostly off in the last frame already (`known`) are shading, not news. Returns how many faces were made.
int fragment_faces(Mesh& mesh, std::vector<int>& labels, const std::vector<char>& off,
                   const std::vector<char>& known, int square_px);

// Labels of the pixels of a turned camera: `source[k]` is the old pixel seen at k, negative where nothing was
// seen; such pixels become new faces, in squares.
std::vector<int> turn_labels(Mesh& mesh, const std::vector<int>& labels, const std::vector<int>& source,
                             int square_px);

}  // namespace rbdn
