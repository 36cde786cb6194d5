// From the depth of a silhouette to the mean depth of the visible surface.
#pragma once

#include <vector>

#include "space.hpp"

namespace depth {

// How far the visible surface stands before its outline, in widths of the region: with
// w = sqrt(A) Z / f, the region's width in cm, Z_surface = Z_outline - k w.
struct Relief {
    double k = 0.0;
    double sigma_k = 0.0;
};

// cut: whether the image border or a nearer thing takes part of the outline, so that its shape says nothing
Relief relief_of(const std::vector<Vec2>& outer_loop, bool cut);

// Whether an outline has three or four straight sides, as the face of a box or a board has. Round things
// and boxes seen over a corner have outlines that slant too, but not as one plane.
bool may_be_one_face(const std::vector<Vec2>& outer_loop);

}  // namespace depth
