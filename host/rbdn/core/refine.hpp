// Sub-pixel outlines: where the blurred step between two regions really lies, without touching the net.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "loops.hpp"
#include "mesh.hpp"

namespace rbdn {

// An image in linear light, where a pixel on an edge is the true mixture of its two sides.
class LinearImage {
public:
    LinearImage();

    // `bgr` is (height, width, 3), sRGB; it is not copied and must outlive the use of the image.
    void load(const std::uint8_t* bgr, int width, int height);

    // Red, green, blue; bilinear. p must lie at least half a pixel inside the image.
    std::array<float, 3> at(Vec2 p) const;

private:
    const std::uint8_t* bgr_ = nullptr;
    int width_ = 0;
    int height_ = 0;
    std::array<float, 256> linear_{};
};

// One measured point of an outline.
struct OutlinePoint {
    Vec2 p;
    Vec2 normal;  // unit, from the left region into the right one
    int left;     // region indices
    int right;
    double length_px;  // stretch of outline it stands for
    double sigma_px;   // along the normal
};

struct Refinement {
    std::vector<OutlinePoint> outline;
    std::vector<Vec2> vertices;         // refined positions, by vertex of the mesh
    std::vector<double> vertex_sigma;   // px; NaN where the edges do not make a corner
    std::vector<double> area;           // by region
    std::vector<double> area_sigma;
};

// Measures every edge between two regions. `region_of` gives each face's region, `labels` each pixel's face.
Refinement refine(const Mesh& mesh, const LinearImage& image, const std::vector<int>& labels,
                  const std::vector<int>& region_of, int region_count);

}  // namespace rbdn
