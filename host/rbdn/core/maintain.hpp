// Maintenance of the net's shape: insertion, deletion, thorns, contacts (section 2.3 of the paper).
//
// Every operation is a transaction: the net is changed, checked, and restored where the change would have torn
// it; then it is tried again without the vertices at fault.
#pragma once

#include <functional>
#include <set>
#include <vector>

#include "crossings.hpp"
#include "forces.hpp"
#include "mesh.hpp"

namespace rbdn {

// Ids of vertices that an operation must leave alone.
using Spared = std::set<std::int64_t>;

// An operation on the net; returns how many changes it made.
using Operation = std::function<int(Mesh&, const Spared&)>;

// Applies the operation so that the net stays planar, or not at all. Returns how many changes were kept.
// `saved` is a copy of the mesh, before and after.
int transact(Mesh& mesh, Crossings& crossings, Mesh& saved, const Operation& operation);

// A new vertex in the middle of edges that fit badly though their forces balance (Fig. 6).
int insert_vertices(Mesh& mesh, const std::vector<Disparity>& disparity, const Spared& spared);

// Vertices on a straight line, and edges too short to matter.
int delete_vertices(Mesh& mesh, const Spared& spared);

// Thorns: two edges enclosing a small angle are closed from their common vertex.
int zip_thorns(Mesh& mesh, const Spared& spared);

// A vertex that touches an edge of the same face is joined to it, so that regions may touch and part.
int snap_contacts(Mesh& mesh, const Spared& spared);

// The same for a vertex pressed against the image border.
int snap_to_border(Mesh& mesh, const Spared& spared);

}  // namespace rbdn
