#include "samples.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <unordered_map>

namespace depth {

namespace {
constexpr double FEWEST_SAMPLES = 10;  // samples of a boundary where it has so many
}

Samples pick_samples(const FrameView& frame, const Camera& camera, const std::vector<Vec2>& middle,
                     double border_px, double spacing_px, std::size_t most) {
    Samples out;
    std::unordered_map<std::int64_t, int> known;
    const std::size_t n = frame.outline_px.size(), regions = frame.regions.size();
    std::vector<int> boundary(n, -1);
    for (std::size_t i = 0; i < n; ++i) {
        const Vec2 p = frame.outline_px[i];
        if (!(p.x > border_px && p.x < camera.width - 1 - border_px && p.y > border_px &&
              p.y < camera.height - 1 - border_px))
            continue;
        const int left = frame.outline_left[i], right = frame.outline_right[i];
        const auto key = static_cast<std::int64_t>(left) * static_cast<std::int64_t>(regions) + right;
        const auto [it, fresh] = known.try_emplace(key, static_cast<int>(out.boundaries.size()));
        if (fresh) out.boundaries.push_back({left, right, 0.0});
        boundary[i] = it->second;
        out.boundaries[static_cast<std::size_t>(it->second)].length_px += frame.outline_length_px[i];
    }
    double all_px = 0;
    for (const Boundary& b : out.boundaries) all_px += b.length_px;
    out.spacing_px = std::max(spacing_px, all_px / static_cast<double>(most));
    std::vector<double> since(out.boundaries.size(), 0.0), gap(out.boundaries.size());
    for (std::size_t b = 0; b < gap.size(); ++b) {
        gap[b] = std::min(out.spacing_px, out.boundaries[b].length_px / FEWEST_SAMPLES);
        since[b] = gap[b] / 2;
    }
    for (std::size_t i = 0; i < n; ++i) {
        if (boundary[i] < 0) continue;
        const auto b = static_cast<std::size_t>(boundary[i]);
        since[b] += frame.outline_length_px[i];
        if (since[b] < gap[b]) continue;
        const double length_px = std::max(gap[b], frame.outline_length_px[i]);
        since[b] = std::min(since[b] - gap[b], gap[b]);
        const Vec2 p = frame.outline_px[i], normal = frame.outline_normal[i];
        const Vec3 ray = camera.ray(p);
        const Vec2 along{-normal.y / camera.fx, normal.x / camera.fy};
        for (int side = 0; side < 2; ++side) {
            const int region = side == 0 ? out.boundaries[b].left : out.boundaries[b].right;
            out.rows.push_back({region, boundary[i], side, length_px,
                                p - middle[static_cast<std::size_t>(region)], ray, along});
        }
    }
    return out;
}

}  // namespace depth
