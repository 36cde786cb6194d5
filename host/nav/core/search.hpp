// A* over a grid of cells.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace nav {

// Neither array is changed; all are (rows, cols).
struct Field {
    std::size_t rows, cols;
    const bool* shut;
    const float* cost;   // of entering a cell, per cell's side
    const float* ahead;  // estimate of what is left from each cell
    const bool* there;   // cells that are the target
};

// Cells from the first one to the target, as row * cols + column; empty where none can be got to. Of equal ways
// that over the earlier cells is gone on with first.
std::vector<std::size_t> search(const Field& field, std::size_t first);

}  // namespace nav
