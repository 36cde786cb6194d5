// Which pixel of the last image a turned camera sees at each pixel.
#pragma once

namespace rbdn {

// Writes, for every pixel row after row, the index of the pixel nearest the place interpolated between `nodes`; -1
// beyond the image. The nodes are places (x, y) for every `step_px`-th pixel of every `step_px`-th row, `columns` of
// them a row, from the first to one beyond the last. Up to 2^21 px a side.
void turned_pixels(const float* nodes, int columns, int step_px, int width, int height, int* source);

}  // namespace rbdn
