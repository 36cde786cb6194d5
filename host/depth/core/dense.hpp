// Small dense symmetric systems.
#pragma once

#include <cstddef>
#include <vector>

namespace depth {

// Inverse of a symmetric positive definite matrix (n, n), row-major; false where it is not one.
bool invert_spd(std::vector<double>& a, std::size_t n);

}  // namespace depth
