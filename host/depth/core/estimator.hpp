// The whole of the room: one call per frame from the net's view and the pose to depths.
#pragma once

#include <optional>
#include <vector>

#include "area.hpp"
#include "ego_motion.hpp"
#include "frame_view.hpp"
#include "fuse.hpp"
#include "movers.hpp"
#include "outline.hpp"
#include "path.hpp"
#include "vertex.hpp"

namespace depth {

struct Config {
    OdometryNoise odometry;
    AreaConfig area;
    VertexConfig vertex;
    OutlineConfig outline;
    FuseConfig fuse;
};

// What odometry says of where a frame was taken.
struct Reading {
    Mat3 rotation;  // camera to world
    Vec3 position_cm;
    double t_s = 0.0;
    double travel_sigma_cm = 0.0;  // of the distance since the run began; 0 where it is not said
    double turn_sigma_rad = 0.0;   // of the rotation since the last frame; likewise
};

struct RegionDepth {
    Answer area, vertex;
    OutlineAnswer outline;
    std::optional<Fused> fused;
    bool moving = false;
};

struct Depths {
    std::vector<RegionDepth> regions;  // row by row as the frame has them
    VertexDepths vertices;
};

class Estimator {
  public:
    Estimator(const Camera& camera, const Config& config);

    Depths update(const FrameView& frame, const Reading& reading);

    // The frame just taken in: pose and corrections.
    const Path& path() const { return path_; }
    const std::vector<Correction>& corrections() const { return outline_.corrections(); }
    int present() const { return present_; }

  private:
    void join_corners(const FrameView& frame, VertexDepths& found) const;
    void at_rest_no_surer(const FrameView& frame, VertexDepths& now);

    Camera camera_;
    Config config_;
    Path path_;
    EgoMotion ego_;
    OutlineMethod outline_;
    AreaMethod area_;
    VertexMethod vertex_;
    Movers movers_;
    Memory memory_;
    std::vector<std::int64_t> last_ids_;
    VertexDepths last_vertices_;
    int present_ = -1;
    int moved_ = 0;  // the last frame that was clearly elsewhere than the one before it
};

}  // namespace depth
