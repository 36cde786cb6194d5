#include "estimator.hpp"

#include <algorithm>
#include <cmath>

namespace depth {

namespace {

constexpr double MISFIT_PX = 0.25;  // an outline that fits some depth so well stands still, whatever its middle does

// Towards the middle of a region's outline.
Vec3 middle_ray(const RegionView& region, const Camera& camera) {
    Vec2 low{INFINITY, INFINITY}, high{-INFINITY, -INFINITY};
    for (const Vec2 p : region.loops.front()) {
        low = {std::min(low.x, p.x), std::min(low.y, p.y)};
        high = {std::max(high.x, p.x), std::max(high.y, p.y)};
    }
    return camera.ray(0.5 * (low + high));
}

}  // namespace

Estimator::Estimator(const Camera& camera, const Config& config)
    : camera_(camera),
      path_(config.odometry),
      ego_(camera),
      outline_(camera, config.outline),
      area_(camera, config.area),
      vertex_(camera, config.vertex),
      movers_(camera),
      memory_(config.fuse) {}

Depths Estimator::update(const FrameView& frame, const Reading& reading) {
    const int now = ++present_;
    path_.add(now, reading.rotation, reading.position_cm, reading.t_s, reading.travel_sigma_cm,
              reading.turn_sigma_rad);
    const std::optional<EgoMotion::Jerk> jerk = ego_.guess(frame, last_vertices_, path_, now);
    for (const std::int64_t id : frame.changed) {
        memory_.forget(id);
        area_.forget(id);
        movers_.forget(id);
    }
    memory_.forget_unseen(now);
    area_.forget_unseen(now);
    std::vector<double> expected;
    for (const RegionView& region : frame.regions) {
        const std::optional<Fused> before = memory_.predict(region.id, path_, now);
        expected.push_back(before ? 1 / before->depth_cm : 0.0);
    }
    const std::vector<OutlineAnswer> outlines = outline_.update(frame, path_, now, ego_, jerk, expected);
    const std::vector<char> moving = movers_.update(frame, path_, now);
    Depths out;
    out.vertices = vertex_.update(frame, path_, now);
    for (std::size_t r = 0; r < frame.regions.size(); ++r) {
        const RegionView& region = frame.regions[r];
        RegionDepth depth;
        depth.outline = outlines[r];
        depth.area = area_.update(region, frame, path_, now, depth.outline.own_share);
        depth.vertex = vertex_.region(region, frame, out.vertices, depth.outline.own_share);
        depth.moving = moving[r] && (!depth.outline.surface.known() || depth.outline.misfit_px > MISFIT_PX);
        if (depth.moving) {
            // no depth explains its motion, and none that was found before is worth keeping
            depth.area = depth.vertex = depth.outline.surface = decline("it moves by itself");
            memory_.forget(region.id);
        }
        depth.fused = memory_.update(region.id, combine({&depth.area, &depth.vertex, &depth.outline.surface}),
                                     middle_ray(region, camera_), path_, now);
        out.regions.push_back(std::move(depth));
    }
    ego_.remember(frame, now);
    last_vertices_ = out.vertices;
    std::set<int> kept = outline_.frames();
    kept.merge(area_.frames());
    kept.merge(vertex_.frames());
    kept.merge(movers_.frames());
    kept.merge(memory_.frames());
    path_.keep(kept);
    return out;
}

}  // namespace depth
