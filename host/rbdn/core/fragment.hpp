// Fragmentation: pixels that fit their polygon no longer are cut out of it, locally (section 3 of the paper).
#pragma once

#include <vector>

#include "crossings.hpp"
#include "image.hpp"
#include "mesh.hpp"

namespace rbdn {

// Which pixels are off, looked at on every second pixel of every second row: news is larger than that.
struct OffMap {
    static constexpr int kStep = 2;
    int width = 0;  // of the map
    int height = 0;
    std::vector<char> off;  // 1 where the pixel and most of its neighbours are far from their face's mean
};

// `gate` is the distance, in working units, beyond which a pixel is far.
OffMap off_pixels(const Mesh& mesh, const Crossings& crossings, const Image& image, double gate);

// Pixels of the blobs that are news: large enough, and not mostly off in the last frame already (`known`), which
// would be shading.
std::vector<int> new_off_pixels(const Mesh& mesh, const OffMap& off, const OffMap& known);

// Cuts pixels out of their faces into faces of their own, in squares, so that the deformation can regroup them.
// Returns how many faces were made.
int fragment_faces(Mesh& mesh, std::vector<int>& labels, const std::vector<int>& pixels, int square_px);

// Labels of the pixels of a turned camera: `source[k]` is the old pixel seen at k, negative where nothing was
// seen; such pixels become new faces, in squares.
std::vector<int> turn_labels(Mesh& mesh, const std::vector<int>& labels, const std::vector<int>& source,
                             int square_px);

}  // namespace rbdn
