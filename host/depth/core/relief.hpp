// From the depth of a silhouette to the mean depth of the visible surface.
//
// An outline that occludes lies behind the surface it bounds: on a ball at the circle of tangency, on an
// upright cylinder at its sides. With w = sqrt(A) Z / f, the region's width in cm,
//
//     Z_surface = Z_outline - k w.
//
// A far ball of radius r shows a disc of area pi r^2 whose mean depth is (2/3) r before its rim: k = 0.38.
// A near one shows less of itself, and aside of the way its near rim moves most: 0.30. An upright cylinder's mean is (pi/4) r before its sides,
// k = 0.35 at twice as high as wide, but its lower rim, nearer than the sides, pulls its outline forward:
// 0.20. A frontal face has k = 0. A box seen over a corner has 0.13, give or take as much again; so has a
// slanted face, about nothing.
//
// The constants are means and standard deviations over 1570 things as host.sim.tabletop_scenes draws them
// (boxes turned by up to 45 degrees, some of their faces alone, balls, cans, cups, bottles, fruits; 46 to
// 132 cm away, the camera level, 7 to 17 cm above the table), their outlines and surfaces in closed form,
// the outline read as a forward moving camera reads it: one 1/Z, points weighted by the square of their
// motion along the normal. test_relief_core.py draws such things anew and checks what is said here.
#pragma once

#include <vector>

#include "space.hpp"

namespace depth {

// How far the visible surface stands before its outline, in widths of the region.
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
