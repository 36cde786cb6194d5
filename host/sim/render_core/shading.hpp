// Colour of a point on a surface: texture filtered to the pixel's footprint, lamp, sky and shadow.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "view.hpp"

// The four corners of a cell of value noise, kept because the next pixel most often lies in the same cell.
struct NoiseCell {
    int32_t x = INT32_MIN, y = INT32_MIN;
    std::array<double, 4> corners{};
};

constexpr int noise_octaves = 2;
using NoiseCells = std::array<NoiseCell, noise_octaves>;

// Shades what one view sees.
class Shader {
public:
    Shader(const Scene &scene, const View &view, const std::vector<Seen> &seen);

    // Linear BGR of a surface, an index into seen, where the ray through a pixel meets it at the given inverse depth.
    Vec3 at(int which, double px, double py, double inverse_depth);

private:
    const Scene &scene_;
    const View &view_;
    const std::vector<Seen> &seen_;
    std::vector<NoiseCells> cells_; // by surface
};
