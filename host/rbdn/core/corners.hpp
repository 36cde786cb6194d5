// Corners that the net cuts off with a short edge, made whole for output.
#pragma once

#include "mesh.hpp"

namespace rbdn {

// A copy of the net in which every short edge between two long ones is replaced by the point where those meet.
// Mismatch counts cannot see such a cut, which hides a few pixels; the vertices' places can.
Mesh with_whole_corners(const Mesh& mesh);

}  // namespace rbdn
