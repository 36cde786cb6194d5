// Brightness and sharp edges of a picture, tile by tile. Green stands for brightness.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace nav {

// A picture (height, width, 3), top row first.
struct Pixels {
    const std::uint8_t* data;
    std::size_t height, width;
    const std::uint8_t* row(std::size_t y) const { return data + 3 * width * y; }
};

// How many tiles across and down; where they do not divide it, their sizes differ by a pixel.
struct Tiling {
    std::size_t across, down;
};

// Every step-th pixel of every step-th row: (ceil(height / step), ceil(width / step), 3).
std::vector<std::uint8_t> thinned(const Pixels& picture, std::size_t step);

// Mean brightness (down, across) of every `every`-th row, of the first `rows` ones.
std::vector<float> tile_means(const Pixels& picture, std::size_t every, std::size_t rows, const Tiling& tiles);

// What makes an edge sharp: most of the step in brightness over a wide stretch lies within a short one.
struct Sharp {
    std::size_t step_px;  // the short one
    std::size_t wide_px;  // to either side of it
    std::uint8_t levels;  // a smaller step is noise
};

// Of every `every`-th row: share (down, across) of the pixels at sharp edges, and mean brightness.
struct Tiles {
    std::vector<float> sharp, brightness;
};
Tiles sharp_tiles(const Pixels& picture, std::size_t every, const Sharp& sharp, const Tiling& tiles);

// What each row of a thinned picture has in it.
struct Rows {
    std::vector<std::uint8_t> spread;  // from its darkest to its brightest pixel
    std::vector<std::uint8_t> alike;   // it is the same in another picture, to the last bit
};
Rows compare_rows(const Pixels& picture, const Pixels& other);

}  // namespace nav
