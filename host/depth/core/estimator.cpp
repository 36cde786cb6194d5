#include "estimator.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace depth {

namespace {

constexpr double LEAP_CM = 200.0;   // between two frames, more than any robot drives
constexpr double AGREES = 3.0;      // standard errors between two depths of one corner
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
      config_(config),
      path_(config.odometry),
      ego_(camera),
      outline_(camera, config.outline),
      area_(camera, config.area),
      vertex_(camera, config.vertex),
      movers_(camera),
      memory_(config.fuse) {}

Depths Estimator::update(const FrameView& frame, const Reading& reading) {
    // not a number counts as a leap: it would stay in the path for good
    if (present_ >= 0 && !(length(reading.position_cm - path_.at(present_).read_cm) <= LEAP_CM))
        *this = Estimator(camera_, config_);  // a robot put elsewhere, or odometry begun anew: another run
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
    join_corners(frame, out.vertices);
    at_rest_no_surer(frame, out.vertices);
    ego_.remember(frame, now);
    last_ids_ = frame.vertex_ids, last_vertices_ = out.vertices;
    std::set<int> kept = outline_.frames();
    kept.merge(area_.frames());
    kept.merge(vertex_.frames());
    kept.merge(movers_.frames());
    kept.merge(memory_.frames());
    kept.insert(moved_);
    path_.keep(kept);
    return out;
}

// A corner seen as a point and as the end of outlines: their mean where they agree, else the outlines, which
// do not slide along an edge.
void Estimator::join_corners(const FrameView& frame, VertexDepths& found) const {
    const std::vector<Corner>& corners = outline_.corners();
    for (std::size_t i = 0; i < corners.size(); ++i) {
        if (!(corners[i].rho > 0)) continue;
        double rho = corners[i].rho, sigma = corners[i].sigma_rho;
        const double z = found.xyz_cm[i].z;
        if (z > 0) {
            const double point = 1 / z, point_sigma = found.sigma_cm[i] / (z * z);
            if (std::abs(point - rho) < AGREES * std::hypot(sigma, point_sigma)) {
                // both are of the same pixels: the mean is no surer than they are in the mean
                const double a = 1 / (sigma * sigma), b = 1 / (point_sigma * point_sigma), w = a / (a + b);
                rho = w * rho + (1 - w) * point, sigma = w * sigma + (1 - w) * point_sigma;
            }
        }
        if (!(sigma < config_.vertex.max_relative_sigma * rho)) continue;
        found.xyz_cm[i] = (1 / rho) * camera_.ray(frame.vertex_px[i]);
        found.sigma_cm[i] = sigma / (rho * rho);
    }
}

// New noise on corners that were seen from here before is no news of their depth.
void Estimator::at_rest_no_surer(const FrameView& frame, VertexDepths& now) {
    if (path_.distance_cm(moved_, present_) >= config_.outline.min_step_cm) {
        moved_ = present_;
        return;
    }
    std::unordered_map<std::int64_t, double> last;
    for (std::size_t i = 0; i < last_ids_.size(); ++i) last[last_ids_[i]] = last_vertices_.sigma_cm[i];
    for (std::size_t i = 0; i < frame.vertex_ids.size(); ++i)
        if (const auto it = last.find(frame.vertex_ids[i]); it != last.end() && it->second > now.sigma_cm[i])
            now.sigma_cm[i] = it->second;
}

}  // namespace depth
