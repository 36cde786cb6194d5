// Samples of the present outline. Every one lies between two regions and may show the depth of either,
// so it is listed twice, once for each side.
#pragma once

#include <vector>

#include "frame_view.hpp"
#include "space.hpp"

namespace depth {

struct Sample {
    int region;        // row of the region it is seen for
    int pair;          // boundary it belongs to
    int side;          // 0 when that region is on the left, 1 on the right
    double length_px;  // outline it stands for
    Vec2 offset;       // px from the region's middle
    Vec3 ray;
    Vec2 along;        // direction of the outline, as rays
};

struct Boundary {
    int left = 0, right = 0;  // rows of the regions
    double length_px = 0.0;
};

struct Samples {
    std::vector<Sample> rows;  // both sides of a point next to each other, the left one first
    std::vector<Boundary> boundaries;
    double spacing_px = 0.0;   // between points, on long boundaries
};

// Picks points `spacing_px` apart along every boundary, closer on short ones, farther apart where there would
// be more than `most` of them.
//
// border_px: how far from the image border a sample must lie
Samples pick_samples(const FrameView& frame, const Camera& camera, const std::vector<Vec2>& middle,
                     double border_px, double spacing_px, std::size_t most);

}  // namespace depth
