// Is the net still a plane graph? Everything that changes it asks here before the change is kept.
#pragma once

#include <vector>

#include "crossings.hpp"
#include "mesh.hpp"

namespace rbdn {

// Edges at fault: faces out of order along a row or column, neighbouring edges of a vertex that disagree about
// the face between them, or edges that cross. Sorted, each once; empty for a plane graph.
std::vector<int> find_faults(const Mesh& mesh, const Crossings& crossings);

}  // namespace rbdn
