// The paper's own rules to the letter, so that every experiment can show them beside ours.
//
// What differs from the paper, because the net would tear otherwise:
// - moves are taken back where they would fold the net, and changes of its shape where they would tear it;
// - vertices on the image border slide along it, those inside stay inside;
// - faces that fell apart become separate ones, since a polygon is one piece.
// What it leaves open, and how it is read here:
// - forces push along the normal of their edge, and each half of an edge acts on the vertex at its end;
// - thorns are closed at vertices of any degree, which at two edges is the paper's deletion;
// - merging goes from the nearest colours on;
// - the cycle also stops when the disparity falls no further, or after the cycles that the configuration allows;
// - a region is fragmented where more than one pixel in twenty, and more than make a polygon, are beyond eta, once
//   a frame; its squares are a net begun anew there, and the largest polygon they merge to keeps the region's id.
// It has none of what ours adds: no thin polygons merged, no contacts snapped, no refreshing, no grouping of polygons,
// no colours but RGB, no means kept over the first cycle. Displacements known in advance are used where given.
#pragma once

#include <vector>

#include "forces.hpp"
#include "image.hpp"
#include "mesh.hpp"

namespace rbdn {

// Conditions 1 to 3 of section 2.2 for every pixel whose centre lies in one of the four sensitivity regions of an
// edge, rectangles of half its length and `reach_px` height. `labels` holds the face of every pixel.
std::vector<Disparity> measure_literal_disparity(const Mesh& mesh, const std::vector<int>& labels, const Image& image,
                                                 double eta, int reach_px);

// Moves every vertex by the sum of its forces (Eq. 1-6). Positions are not checked: see settle_moves().
void move_by_forces(Mesh& mesh, const std::vector<Disparity>& disparity);

// Section 3: a face with too few pixels near its mean is begun anew, as squares. Returns how many faces were made.
int fragment_ill_filled(Mesh& mesh, std::vector<int>& labels, const Image& image, double eta, double least_area_px,
                        int square_px);

}  // namespace rbdn
