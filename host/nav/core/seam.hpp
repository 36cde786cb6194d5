// Where upwards in a picture the colour changes, strip by strip.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "tiles.hpp"

namespace nav {

// Mean colours of blocks of a picture, to whole levels, as red, green, blue: (width / wide, height / high, 3), the
// lowest block first.
std::vector<float> strips(const Pixels& picture, std::size_t high, std::size_t wide);

// Change of mean colour from the `window` pixels below each pixel to as many from it on, hue in full and
// brightness by a share `light` only: (strips, rows - 2 * window + 1), the first one at pixel `window`.
//
// colours: (strips, rows, 3), lowest pixel first
std::vector<float> colour_steps(const float* colours, std::size_t strips, std::size_t rows, std::size_t window,
                                double light);

// Whether a strip's foot lies, to so many pixels, where the median line through its neighbours' has it. Up to
// `search` strips on either side are asked, those where one was found; most of them must agree.
std::vector<std::uint8_t> agreed(const std::vector<std::int64_t>& foot, const std::vector<std::uint8_t>& found,
                                 std::size_t search, double agree_px);

}  // namespace nav
