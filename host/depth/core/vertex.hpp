// Depth of the net's vertices by triangulation (Eq. 7-13), x and y jointly, over all kept frames of a run.
//
// Eq. 7-9 are Y/Z = y/f in two frames with Z_j = Z_i - dZ. Here the camera may move and turn in any way:
// a vertex towards (x, y) with inverse depth rho in the present frame is seen by an earlier one, k, at
//
//     (x_k, y_k) = first two of (R_k (x, y, 1) + rho t_k), divided by the third,
//
// which for pure forward motion is Eq. 10 in both coordinates. (x, y, rho) are fitted to all frames
// together, so that the sensitivity of Eq. 13 enters with both coordinates and a vertex near the focus of
// expansion gets the large sigma it deserves. A vertex is a track of the net and may have slid from one
// corner to another: what the present position and some one depth cannot explain has no weight, and
// where too little is explained there is no depth.
#pragma once

#include <cstdint>
#include <set>
#include <utility>
#include <vector>

#include "answer.hpp"
#include "frame_view.hpp"
#include "path.hpp"
#include "space.hpp"

namespace depth {

struct VertexConfig {
    int history = 12;                // frames kept
    double noise_px = 0.1;           // a vertex is never taken to be better than this beforehand
    double default_sigma_px = 0.5;   // of a vertex that does not know its own
    double model_share = 0.01;       // model error of a region's mean even on a flat face
    double min_step_cm = 0.3;        // a frame nearer than this to the last one kept is not kept
    double max_relative_sigma = 0.3; // a depth worse than this is declined
};

// Row i belongs to vertex i of the frame; nan where the motion supports no depth.
struct VertexDepths {
    std::vector<Vec3> xyz_cm;         // in the present camera
    std::vector<double> sigma_cm;     // of z
    std::vector<double> sensitivity;  // px of image motion for one cm of travel, Eq. 13 in x and y
};

class VertexMethod {
  public:
    VertexMethod(const Camera& camera, const VertexConfig& config);

    // Takes in the vertices of a frame, and says where they are.
    VertexDepths update(const FrameView& frame, const Path& path, int present);

    // Depth of a region, averaged over its surface, from the plane through its own corners; the sensitivity
    // is their mean. The region's `corners` name the points of its outer loop, one each.
    //
    // found: what `update` said of the same frame
    // own_share: share of the region's outline that is not the outline of something nearer
    Answer region(const RegionView& region, const FrameView& frame, const VertexDepths& found,
                  double own_share) const;

    // Frames that the path must keep.
    std::set<int> frames() const;

  private:
    struct Sight {  // of one vertex in one frame
        std::int64_t id;
        Vec2 ray;
        double sigma_px;
    };
    struct Kept {
        int frame;
        std::vector<Sight> sights;  // by id
    };

    Camera camera_;
    VertexConfig config_;
    std::vector<Kept> kept_;                              // oldest first
    std::vector<std::pair<std::int64_t, int>> row_of_id_; // of the present frame, by id
};

}  // namespace depth
