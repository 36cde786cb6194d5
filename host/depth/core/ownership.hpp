// Whose outline is it? An edge between two regions shows the depth of the nearer one only.
#pragma once

#include <array>
#include <vector>

#include "joint_fit.hpp"
#include "samples.hpp"

namespace depth {

// What is known of a region beside its depth.
struct Extent {
    double outline_px = 0.0;  // length of its whole outline
    bool touches_border = false;
};

// Which side may use each boundary between two regions, {left, right}.
//
// The side whose depth explains the boundary's motion owns it. Where both do, one of them may have its
// depth from this very boundary: the one whose depth does not fit the rest of its outline. Where that does
// not tell either, the nearer one owns the boundary, unless it surrounds the other, for what surrounds is
// behind. Where depths agree too, a region that surrounds the other (or is cut by the image border, when
// the other is not) may not use it; otherwise, as between two faces of a box, both may.
//
// cost: mean truncated cost of every boundary under the depth of either side, 0..1
// rho: inverse depth of either side at the boundary
std::vector<std::array<bool, 2>> edge_owners(const std::vector<Boundary>& boundaries,
                                             const std::vector<std::array<double, 2>>& cost,
                                             const std::vector<std::array<double, 2>>& rho,
                                             const std::vector<Extent>& extents);

// The same for a fit's samples: which rows their regions may use, 0 or 1.
std::vector<double> own_rows(const Samples& samples, const std::vector<double>& row_cost,
                             const std::vector<RegionState>& state, const std::vector<Extent>& extents);

}  // namespace depth
