// Deformation forces: mismatched pixels beside every edge, and the vertex moves they ask for (Eq. 1-6).
#pragma once

#include <vector>

#include "crossings.hpp"
#include "image.hpp"
#include "mesh.hpp"

namespace rbdn {

// Pixels in the four sensitivity regions of an edge (Fig. 3), each half counted apart; half 0 is at end a.
struct Disparity {
    float left_claimed[2] = {0, 0};   // pixels on the left that the right face claims
    float right_claimed[2] = {0, 0};  // pixels on the right that the left face claims
};

// Colours nearer than `eta` (in working units) belong together.
struct ClaimRule {
    float eta2;
};

enum class Which { kAllEdges, kMovedEdges };

// Counts, for every edge, the unbroken run of pixels next to it that the other face claims, at most `reach_px` deep.
// Where only every n-th line was listed, each of its pixels counts n times. Edges that are not asked for keep
// what `disparity` says of them.
void measure_disparity(const Mesh& mesh, const Crossings& crossings, const Image& image, const ClaimRule& rule,
                       int reach_px, Which which, std::vector<Disparity>& disparity);

double total_disparity(const std::vector<Disparity>& disparity);

// Displacement in px towards the left normal that each half of an edge asks for.
double half_displacement(const Disparity& d, int half, double edge_length);

// Moves every vertex to where its edges' halves ask, by least squares, `gain` of the way. Positions are not
// checked: see settle_moves().
void move_vertices(Mesh& mesh, const std::vector<Disparity>& disparity, int reach_px, double gain);

// Moves each vertex as far as its place allows: along the border, or inside it.
void displace_vertices(Mesh& mesh, const std::vector<Vec2>& moves);

// Takes moves back, around the faults first and at last everywhere, until the net is planar again.
void settle_moves(Mesh& mesh, Crossings& crossings);

}  // namespace rbdn
