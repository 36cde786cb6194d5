// Polygon merging: by colour, by size and by thinness (section 2.3 of the paper).
#pragma once

#include <vector>

#include "mesh.hpp"

namespace rbdn {

struct MergeRule {
    double eta;         // colours nearer than this, in working units, are one polygon
    double min_area_px;
    double min_width_px;  // of 2 area / perimeter; anti-aliased edges make slivers larger than min_area
    double lightness_gain = 1.0;  // more than 1: lightness counts more than in the working space
    double sharp_jump = 0.0;      // in working units, lightness in full; above this an outline is kept
};

// Merges until nothing is left to merge; faces' sums and means must be up to date. `jumps`, of every edge
// (jumps.hpp), keep alike faces apart; empty where they do not matter. Returns how many were merged.
int merge_faces(Mesh& mesh, const MergeRule& rule, const std::vector<float>& jumps);

// Merges the faces nearest in colour, however far apart, until no more than `most_faces` are left.
int merge_to_fit(Mesh& mesh, int most_faces);

}  // namespace rbdn
