// Corners that the net cuts off with a short edge, made whole for output.
#pragma once

#include "profiles.hpp"

namespace rbdn {

// A copy of the net in which every short edge between two long ones is replaced by the point where those meet, if
// the image shows the corner's own colour there. Mismatch counts cannot see such a cut, which hides a few pixels.
Mesh with_whole_corners(const View& view);

}  // namespace rbdn
