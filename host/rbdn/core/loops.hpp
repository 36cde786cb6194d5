// Faces as closed walks along their edges, and faces that fell apart made into separate ones.
#pragma once

#include <vector>

#include "mesh.hpp"

namespace rbdn {

// One walk around a face, kept on the left hand; `edges[k]` leads from `vertices[k]` to the next.
struct Loop {
    int face = 0;  // or whatever group of faces was asked for
    std::vector<int> vertices;
    std::vector<int> edges;
    double area = 0;  // signed; positive for the outer loop, negative round a hole
};

// Loops of the groups that `group_of` puts faces into; edges inside a group are passed over.
// Groups must be numbered from 0; the outside stays kOutside.
std::vector<Loop> trace_loops(const Mesh& mesh, const std::vector<int>& group_of);

// The outer loop that each loop belongs to (itself for an outer loop), as an index into `loops`.
std::vector<int> owners_of_loops(const Mesh& mesh, const std::vector<Loop>& loops);

// Gives every piece but the largest of a face in several pieces a face of its own. Returns how many were made.
int split_faces(Mesh& mesh);

}  // namespace rbdn
