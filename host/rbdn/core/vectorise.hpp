// A net from a label image: the cracks between unlike pixels, simplified as far as the net stays planar.
#pragma once

#include <vector>

#include "crossings.hpp"
#include "mesh.hpp"

namespace rbdn {

// Replaces the mesh's vertices and edges by the outlines of `labels` (face of every pixel, row after row).
// Faces are kept as they are. New vertices within 2 px of an old one take over its id.
void vectorise(Mesh& mesh, Crossings& crossings, const std::vector<int>& labels);

}  // namespace rbdn
