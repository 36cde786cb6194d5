// Which of several outlines holds each pixel of a raster, decided at the pixel's centre.
//
// Outlines that tile the plane tile the raster: where two share a side, each pixel goes to one of them, and
// none grows by its border's width.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace nav {

struct Outline {
    const double* xy;      // (points, 2), of image pixels
    std::size_t points;
    std::uint16_t kind;    // loops of one kind that follow each other are one shape, even-odd
};

// (rows, cols): the kind that holds the point (column, row) * step + (step - 1) / 2, `none` where no one does.
std::vector<std::uint16_t> fill(const std::vector<Outline>& outlines, std::size_t rows, std::size_t cols, double step,
                                std::uint16_t none);

}  // namespace nav
