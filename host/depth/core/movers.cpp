#include "movers.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "polygon.hpp"
#include "robust.hpp"

namespace depth {

namespace {

constexpr std::size_t HISTORY = 8;      // frames of each track
constexpr std::size_t FEWEST = 4;       // to tell a steady motion from a jump
constexpr int FORGET_MOVER_FRAMES = 10;
constexpr double MIDDLE_PX = 0.2;       // standard error of a middle,
constexpr double MIDDLE_SHARE = 0.004;  // and more where the region is large
constexpr double OUTLINE_PX = 0.3;      // of an outline, for the size
constexpr double LEAST_SHIFT_PX = 3.0;  // over the track
constexpr double SURE = 10.0;           // or so many times what a middle may be off
constexpr double LEAST_CHI2 = 50.0;
constexpr double STEADY = 0.12;         // rest of the middles' track over the shift
constexpr double RESHAPED = 0.25;       // change of a width beyond the size's, over the shift

}  // namespace

std::vector<char> Movers::update(const FrameView& frame, const Path& path, int present) {
    std::vector<char> out;
    for (const RegionView& region : frame.regions) {
        if (region.touches_border) {
            tracks_.erase(region.id);
            out.push_back(0);
            continue;
        }
        const Moments m = polygon_moments(region.loops);
        const Sight now{present, m.centre, {std::sqrt(12 * m.xx), std::sqrt(12 * m.yy)}, std::sqrt(std::max(m.area, 1.0))};
        Track& track = tracks_[region.id];
        if (!track.sights.empty() && present - track.sights.back().frame > FORGET_MOVER_FRAMES) track = {};
        track.moves = moves(track, path, now);
        out.push_back(track.moves);
        track.sights.push_back(now);
        if (track.sights.size() > HISTORY) track.sights.erase(track.sights.begin());
    }
    std::erase_if(tracks_, [&](const auto& t) { return present - t.second.sights.back().frame > FORGET_MOVER_FRAMES; });
    return out;
}

std::set<int> Movers::frames() const {
    std::set<int> out;
    for (const auto& [id, track] : tracks_)
        for (const Sight& s : track.sights) out.insert(s.frame);
    return out;
}

bool Movers::moves(const Track& track, const Path& path, const Sight& now) const {
    if (track.sights.size() < FEWEST) return false;
    const Vec3 p = camera_.ray(now.middle);
    double turn_rad = 0;
    for (const Sight& then : track.sights) turn_rad = std::max(turn_rad, path.move(now.frame, then.frame).turn_sigma_rad);
    const double middle_px = std::hypot(std::hypot(MIDDLE_PX, MIDDLE_SHARE * now.size), turn_rad * camera_.focal());
    const double log_size = OUTLINE_PX / now.size;
    double rho = 1e-3;
    Vec2 drift;  // px a frame
    std::array<double, 9> a{};
    double rest = 0;
    for (int round = 0; round < 6; ++round) {
        a = {}, rest = 0;
        std::array<double, 3> g{};
        for (const Sight& then : track.sights) {
            const Move move = path.move(now.frame, then.frame);
            const Vec3 q = move.turn * p + rho * move.shift_cm;
            if (!(q.z > 0.05)) return false;
            const double age = now.frame - then.frame;
            const Vec2 seen = camera_.pixel(q);
            const double x = then.middle.x - (seen.x - age * drift.x), y = then.middle.y - (seen.y - age * drift.y);
            const double s = std::log(then.size / now.size) + std::log(q.z / (move.turn * p).z);
            const Vec3& t = move.shift_cm;
            const double jx = (t.x - q.x / q.z * t.z) * camera_.fx / q.z, jy = (t.y - q.y / q.z * t.z) * camera_.fy / q.z;
            const double js = -t.z / q.z;
            const double w = 1 / square(middle_px), v = 1 / square(log_size);
            a[0] += w * (jx * jx + jy * jy) + v * js * js;
            a[1] -= w * jx * age, a[2] -= w * jy * age;
            a[4] += w * age * age, a[8] += w * age * age;
            g[0] += w * (jx * x + jy * y) + v * js * s;
            g[1] -= w * age * x, g[2] -= w * age * y;
            rest += x * x + y * y;
        }
        // the drifts do not meet each other: eliminate them
        const double pivot = a[0] - a[1] * a[1] / a[4] - a[2] * a[2] / a[8];
        if (!(pivot > 0)) return false;
        const double step = (g[0] - a[1] * g[1] / a[4] - a[2] * g[2] / a[8]) / pivot;
        rho = std::max(rho + step, 1e-5);
        drift = drift + Vec2{(g[1] - a[1] * step) / a[4], (g[2] - a[2] * step) / a[8]};
    }
    // what is left of the drifts' information when the depth is unknown too
    const double xx = a[4] - a[1] * a[1] / a[0], xy = -a[1] * a[2] / a[0], yy = a[8] - a[2] * a[2] / a[0];
    const double chi2 = xx * square(drift.x) + 2 * xy * drift.x * drift.y + yy * square(drift.y);
    const double shift_px = length(drift) * (now.frame - track.sights.front().frame);
    if (chi2 < LEAST_CHI2 || shift_px < std::max(LEAST_SHIFT_PX, SURE * middle_px)) return false;
    if (std::sqrt(rest / static_cast<double>(track.sights.size())) > STEADY * shift_px) return false;
    const Sight& first = track.sights.front();
    const double grown = first.size / now.size;
    const double reshaped =
        std::max(std::abs(first.width.x - grown * now.width.x), std::abs(first.width.y - grown * now.width.y));
    return reshaped < RESHAPED * shift_px;
}

}  // namespace depth
