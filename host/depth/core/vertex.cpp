#include "vertex.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include "polygon.hpp"
#include "relief.hpp"
#include "robust.hpp"

namespace depth {

namespace {

constexpr int PASSES = 8;               // of robust weighting at most
constexpr double SETTLED = 0.1;         // a step so many sigmas long ends them: the next is far shorter
constexpr double LARGEST_SCALE = 3.0;   // of residuals in their sigmas; beyond, frames contradict each other
constexpr double PRIOR_FREEDOM = 6.0;   // what the residuals say of their sigma counts against so many
constexpr double ACCEPTED = 0.25;       // weight of a frame that the fit explains
constexpr double HERE_SIGMAS = 4.0;     // by which the fit may miss the present position

constexpr double MIN_OWN_SHARE = 0.5;   // below, most corners are not the region's
constexpr double MIN_BEND_RAD = 0.75;   // a polygon on a round outline bends by less
constexpr double ARM_PX = 5.0;
constexpr int MIN_CORNERS = 3;          // a region's depth from fewer vertices is chance
constexpr double USUAL_SLANT = 0.5;     // of a region, tangent: beforehand
constexpr int PLANE_PASSES = 5;
constexpr double SLOPE_CHI2 = 20.0;      // a slope is believed when so far from zero in units of its variance
constexpr Relief SLANTED_FACE{0.0, 0.05};

constexpr double NONE = std::numeric_limits<double>::quiet_NaN();

// An earlier frame, seen from the present one.
struct View {
    std::size_t kept;       // row
    Move move;              // from the present camera to it
    double travel;          // relative variance of the length of the move
    double turn_px2;        // variance of the shift of the image that the error of the rotation makes
    double aside_px2;       // px^2 cm^2, over the square of the depth: likewise, of the direction of the move
};

// One vertex in one earlier frame.
struct Observation {
    const View* view;
    Vec2 ray;
    double information;   // 1/px^2
    double start = 0.0;   // inverse depth that it says by itself
    double gain = 0.0;    // px of image motion for one unit of inverse depth
    double share = 0.0;   // robust weight, 0..1
    // where the fit would have it
    double inverse = 0.0;         // 1/Z there
    double u = 0.0, v = 0.0;      // ray
    double ex = 0.0, ey = 0.0;    // px from there to where it was seen
};

struct Here {
    Vec2 ray;
    double sigma_px;
};

struct Fit {
    Vec2 ray;
    double rho = 0.0;
    double variance = std::numeric_limits<double>::infinity();  // of rho
    bool explained = false;  // whether one depth explains the present position and enough of the others
};

// Median of the starts, each counting by its gain in sigmas.
double median_start(const std::vector<Observation>& seen, std::vector<std::pair<double, double>>& sorted) {
    sorted.clear();
    double total = 0.0;
    for (const Observation& o : seen) {
        const double weight = o.gain * std::sqrt(o.information);
        sorted.emplace_back(o.start, weight);
        total += weight;
    }
    std::sort(sorted.begin(), sorted.end());
    double sum = 0.0;
    for (const auto& [start, weight] : sorted) {
        sum += weight;
        if (sum >= 0.5 * total) return start;
    }
    return 0.0;
}

// Symmetric 3 x 3 normal equations of (x, y, rho); x and y in px.
struct Normal {
    double xx, yy, rr = 0.0, xy = 0.0, xr = 0.0, yr = 0.0, gx, gy, gr = 0.0;

    // Step of (x, y, rho) and the variance of rho.
    bool solve(std::array<double, 3>& step, double& variance) const {
        const double cxx = yy * rr - yr * yr, cxy = yr * xr - xy * rr, cxr = xy * yr - yy * xr;
        const double determinant = xx * cxx + xy * cxy + xr * cxr;
        if (!(determinant > 0)) return false;
        const double cyy = xx * rr - xr * xr, cyr = xy * xr - xx * yr, crr = xx * yy - xy * xy;
        step = {(cxx * gx + cxy * gy + cxr * gr) / determinant, (cxy * gx + cyy * gy + cyr * gr) / determinant,
                (cxr * gx + cyr * gy + crr * gr) / determinant};
        variance = crr / determinant;
        return true;
    }
};

class Triangulation {
  public:
    Triangulation(const Camera& camera) : fx_(camera.fx), fy_(camera.fy) {}

    // Inverse depth that one observation says by itself, the present ray taken as exact.
    void start(Observation& o, Vec2 here) const {
        const Move& m = o.view->move;
        const Vec3 p = m.turn * Vec3{here.x, here.y, 1.0};
        const double cx = fx_ * (p.x - o.ray.x * p.z), cy = fy_ * (p.y - o.ray.y * p.z);
        const double sx = fx_ * (o.ray.x * m.shift_cm.z - m.shift_cm.x);
        const double sy = fy_ * (o.ray.y * m.shift_cm.z - m.shift_cm.y);
        const double square_of_gain = sx * sx + sy * sy;
        o.gain = std::sqrt(square_of_gain) / std::abs(p.z);
        o.start = square_of_gain > 0 ? (cx * sx + cy * sy) / square_of_gain : 0.0;
    }

    // Square of the distance in px between an observation and where a point would be.
    double miss2(Observation& o, Vec2 ray, double rho) const {
        const Move& m = o.view->move;
        const Vec3 a = m.turn * Vec3{ray.x, ray.y, 1.0} + rho * m.shift_cm;
        if (!(a.z > 1e-6)) return std::numeric_limits<double>::infinity();
        o.inverse = 1 / a.z;
        o.u = a.x * o.inverse;
        o.v = a.y * o.inverse;
        o.ex = fx_ * (o.ray.x - o.u);
        o.ey = fy_ * (o.ray.y - o.v);
        return o.ex * o.ex + o.ey * o.ey;
    }

    // Robust fit from a first guess. Sets the observations' shares.
    Fit fit(std::vector<Observation>& seen, const Here& here, double rho) const {
        Fit out{here.ray, rho};
        const double here_information = 1 / square(here.sigma_px), x_per_y = fx_ / fy_, y_per_x = fy_ / fx_;
        for (int pass = 0; pass < PASSES; ++pass) {
            weigh(seen, out);
            const Vec2 off{fx_ * (here.ray.x - out.ray.x), fy_ * (here.ray.y - out.ray.y)};
            Normal n{.xx = here_information, .yy = here_information, .gx = off.x * here_information,
                     .gy = off.y * here_information};
            double chi2 = here_information * dot(off, off), freedom = 2.0 - 3.0, travel = 0.0, turn = 0.0;
            for (const Observation& o : seen) {
                const double w = o.share * o.information;
                if (w == 0) continue;
                freedom += 2 * o.share;
                const Move& m = o.view->move;
                const double u = o.u, v = o.v, ex = o.ex, ey = o.ey, ix = fx_ * o.inverse, iy = fy_ * o.inverse;
                // by the present position in px, and by the inverse depth
                const double xx = (m.turn(0, 0) - u * m.turn(2, 0)) * o.inverse;
                const double xy = (m.turn(0, 1) - u * m.turn(2, 1)) * o.inverse * x_per_y;
                const double yx = (m.turn(1, 0) - v * m.turn(2, 0)) * o.inverse * y_per_x;
                const double yy = (m.turn(1, 1) - v * m.turn(2, 1)) * o.inverse;
                const double xr = (m.shift_cm.x - u * m.shift_cm.z) * ix;
                const double yr = (m.shift_cm.y - v * m.shift_cm.z) * iy;
                n.xx += w * (xx * xx + yx * yx);
                n.xy += w * (xx * xy + yx * yy);
                n.yy += w * (xy * xy + yy * yy);
                n.xr += w * (xx * xr + yx * yr);
                n.yr += w * (xy * xr + yy * yr);
                const double gain = w * (xr * xr + yr * yr);
                n.rr += gain;
                n.gx += w * (xx * ex + yx * ey);
                n.gy += w * (xy * ex + yy * ey);
                n.gr += w * (xr * ex + yr * ey);
                chi2 += w * (ex * ex + ey * ey);
                travel += gain * o.view->travel;
                turn += w * (o.view->turn_px2 + square(out.rho) * o.view->aside_px2);
            }
            std::array<double, 3> step;
            double variance = 0.0;
            if (!(n.rr > 0) || !n.solve(step, variance)) return out;
            out.ray = out.ray + Vec2{step[0] / fx_, step[1] / fy_};
            out.rho += step[2];
            const double scale2 = (PRIOR_FREEDOM + chi2) / (PRIOR_FREEDOM + std::max(0.0, freedom));
            // errors of the motion are common to all vertices and do not average out over the frames
            out.variance = variance * scale2 + (square(out.rho) * travel + turn) / n.rr;
            if (step[2] * step[2] < square(SETTLED) * variance) break;
        }
        out.explained = explains(seen, here, out);
        return out;
    }

    // The fit from that observation's own start which explains the most, the present ray taken as exact.
    Fit best_fit(std::vector<Observation>& seen, const Here& here) const {
        double least = std::numeric_limits<double>::infinity(), best = 0.0;
        for (const Observation& by : seen) {
            double cost = 0.0;
            for (Observation& o : seen) {
                // what the present position errs by shows as well
                const double variance = 1 / o.information + square(here.sigma_px);
                cost += std::min(miss2(o, here.ray, by.start) / variance, square(TUKEY));
            }
            if (cost < least) least = cost, best = by.start;
        }
        return fit(seen, here, best);
    }

  private:
    void weigh(std::vector<Observation>& seen, const Fit& fit) const {
        constexpr std::size_t MOST = 64;
        std::array<double, MOST> sorted{};
        const std::size_t n = std::min(seen.size(), MOST);
        for (Observation& o : seen) o.share = miss2(o, fit.ray, fit.rho) * o.information;
        for (std::size_t k = 0; k < n; ++k) sorted[k] = seen[k].share;
        const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(n / 2);
        std::nth_element(sorted.begin(), middle, sorted.begin() + static_cast<std::ptrdiff_t>(n));
        const double scale2 = std::clamp(*middle / 1.386, 1.0, square(LARGEST_SCALE));  // median of two squares
        for (Observation& o : seen)
            o.share = square(std::max(0.0, 1 - o.share / (square(TUKEY) * scale2)));
    }

    bool explains(const std::vector<Observation>& seen, const Here& here, const Fit& fit) const {
        const Vec2 off{fx_ * (here.ray.x - fit.ray.x), fy_ * (here.ray.y - fit.ray.y)};
        if (length(off) > HERE_SIGMAS * here.sigma_px) return false;
        const auto accepted = std::count_if(seen.begin(), seen.end(), [](const auto& o) { return o.share > ACCEPTED; });
        // one frame among several agrees by chance
        return accepted >= std::min<std::ptrdiff_t>(2, std::ssize(seen)) && 2 * accepted >= std::ssize(seen);
    }

    double fx_, fy_;
};

// (N,) where an outline has a corner rather than a place on a line or an arc.
std::vector<char> bends(const std::vector<Vec2>& loop) {
    const std::size_t n = loop.size();
    std::vector<char> out(n, 0);
    const double spacing = loop_length(loop) / static_cast<double>(n);
    // points closer than an arm tell the direction of the outline only together
    const std::size_t arm = std::clamp<std::size_t>(static_cast<std::size_t>(ARM_PX / std::max(spacing, 1e-9) + 0.5), 1, n);
    for (std::size_t k = 0; k < n; ++k) {
        const Vec2 before = loop[k] - loop[(k + n - arm) % n], after = loop[(k + arm) % n] - loop[k];
        out[k] = std::abs(std::atan2(cross(before, after), dot(before, after))) > MIN_BEND_RAD;
    }
    return out;
}

struct PlaneCorner {
    Vec2 at;            // from the middle of the region, over the focal length
    double rho, sigma;  // inverse depth
};

// Inverse depth a + b u + c v over a region.
struct Plane {
    double a = 0.0, b = 0.0, c = 0.0;
    double variance = 0.0;    // of a
    double slant_chi2 = 0.0;  // square of the slope in its sigmas

    double at(Vec2 p) const { return a + b * p.x + c * p.y; }
};

// Robust plane; slants beyond the usual are drawn back as far as the corners leave them open.
bool fit_plane(const std::vector<PlaneCorner>& corners, Plane& out) {
    std::vector<double> sorted(corners.size());
    const auto median_of = [&](auto value) {
        for (std::size_t k = 0; k < corners.size(); ++k) sorted[k] = value(corners[k]);
        const auto middle = sorted.begin() + std::ssize(sorted) / 2;
        std::nth_element(sorted.begin(), middle, sorted.end());
        return *middle;
    };
    out = {median_of([](const PlaneCorner& c) { return c.rho; }), 0.0, 0.0, 0.0};
    for (int pass = 0; pass < PLANE_PASSES; ++pass) {
        // first as if all were well; about the plane they then make, their scatter shows who is not
        const double scatter =
            pass == 0 ? 0.0 : 1.4826 * median_of([&](const PlaneCorner& c) { return std::abs(c.rho - out.at(c.at)); });
        const double slant = 1 / square(USUAL_SLANT * out.a);
        Normal n{.xx = slant, .yy = slant, .gx = -slant * out.b, .gy = -slant * out.c};
        double chi2 = 0.0, freedom = -3.0;
        for (const PlaneCorner& c : corners) {
            const double off = c.rho - out.at(c.at), variance = square(c.sigma) + square(scatter) / 4;
            const double miss2 = square(off / TUKEY) / (square(c.sigma) + square(scatter));
            const double share = pass == 0 ? 1.0 : square(std::max(0.0, 1 - miss2));
            const double w = share / variance;
            n.rr += w;
            n.xr += w * c.at.x;
            n.yr += w * c.at.y;
            n.xx += w * c.at.x * c.at.x;
            n.xy += w * c.at.x * c.at.y;
            n.yy += w * c.at.y * c.at.y;
            n.gr += w * off;
            n.gx += w * off * c.at.x;
            n.gy += w * off * c.at.y;
            chi2 += w * off * off;
            freedom += share;
        }
        std::array<double, 3> step;
        if (!n.solve(step, out.variance)) return false;
        out.b += step[0];
        out.c += step[1];
        out.a += step[2];
        const double scale2 = std::max(1.0, chi2 / std::max(1.0, freedom));
        out.variance *= scale2;
        // what the corners say of the slope, whatever the height
        const double xx = n.xx - slant - n.xr * n.xr / n.rr, yy = n.yy - slant - n.yr * n.yr / n.rr;
        const double xy = n.xy - n.xr * n.yr / n.rr;
        out.slant_chi2 = (xx * out.b * out.b + 2 * xy * out.b * out.c + yy * out.c * out.c) / scale2;
        if (!(out.a > 0)) return false;
    }
    return true;
}

}  // namespace

VertexMethod::VertexMethod(const Camera& camera, const VertexConfig& config) : camera_(camera), config_(config) {}

std::set<int> VertexMethod::frames() const {
    std::set<int> out;
    for (const Kept& kept : kept_) out.insert(kept.frame);
    return out;
}

VertexDepths VertexMethod::update(const FrameView& frame, const Path& path, int present) {
    const std::size_t n = frame.vertex_ids.size();
    row_of_id_.clear();
    for (std::size_t k = 0; k < n; ++k) row_of_id_.emplace_back(frame.vertex_ids[k], static_cast<int>(k));
    std::sort(row_of_id_.begin(), row_of_id_.end());
    Kept now{present, {}};
    now.sights.reserve(n);
    for (const auto& [id, row] : row_of_id_) {
        const Vec3 ray = camera_.ray(frame.vertex_px[static_cast<std::size_t>(row)]);
        const double sigma = frame.vertex_sigma_px[static_cast<std::size_t>(row)];
        now.sights.push_back({id, {ray.x, ray.y},
                              std::isfinite(sigma) ? std::max(sigma, config_.noise_px) : config_.default_sigma_px});
    }

    std::vector<View> views;
    Vec3 ahead{};  // direction of travel in the present camera, from the farthest frame
    double farthest = 0.0;
    for (std::size_t k = 0; k < kept_.size(); ++k) {
        const Move m = path.move(present, kept_[k].frame);
        const double way = length(m.shift_cm);
        if (way < config_.min_step_cm) continue;
        views.push_back({k, m, square(m.travel_sigma_cm / way), square(m.turn_sigma_rad * camera_.focal()),
                         square(m.heading_sigma_rad * way * camera_.focal())});
        if (way > farthest) farthest = way, ahead = (1 / way) * (transposed(m.turn) * m.shift_cm);
    }

    VertexDepths out;
    out.xyz_cm.assign(n, {NONE, NONE, NONE});
    out.sigma_cm.assign(n, NONE);
    out.sensitivity.assign(n, NONE);
    const Triangulation triangulation(camera_);
    std::vector<std::size_t> at(views.size(), 0);  // how far each frame's sights were gone through
    std::vector<Observation> seen;
    std::vector<std::pair<double, double>> sorted;
    for (std::size_t k = 0; k < n; ++k) {
        const Sight& sight = now.sights[k];
        seen.clear();
        for (std::size_t v = 0; v < views.size(); ++v) {
            const std::vector<Sight>& then = kept_[views[v].kept].sights;
            while (at[v] < then.size() && then[at[v]].id < sight.id) ++at[v];
            if (at[v] == then.size() || then[at[v]].id != sight.id) continue;
            const Sight& s = then[at[v]];
            seen.push_back({&views[v], s.ray, 1 / (square(s.sigma_px) + views[v].turn_px2)});
            triangulation.start(seen.back(), sight.ray);
        }
        if (seen.empty()) continue;
        const Here here{sight.ray, sight.sigma_px};
        Fit fit = triangulation.fit(seen, here, median_start(seen, sorted));
        if (!fit.explained) fit = triangulation.best_fit(seen, here);
        const double sigma = std::sqrt(fit.variance);
        if (!fit.explained || !(fit.rho > 0) || !(sigma < config_.max_relative_sigma * fit.rho)) continue;
        const std::size_t row = static_cast<std::size_t>(row_of_id_[k].second);
        const double z = 1 / fit.rho;
        out.xyz_cm[row] = {fit.ray.x * z, fit.ray.y * z, z};
        out.sigma_cm[row] = sigma * z * z;
        out.sensitivity[row] = std::hypot(camera_.fx * (sight.ray.x * ahead.z - ahead.x),
                                          camera_.fy * (sight.ray.y * ahead.z - ahead.y)) / z;
    }

    if (kept_.empty() || path.distance_cm(kept_.back().frame, present) >= config_.min_step_cm) {
        if (static_cast<int>(kept_.size()) >= std::max(config_.history, 3)) {
            std::vector<int> frames;
            for (const Kept& kept : kept_) frames.push_back(kept.frame);
            kept_.erase(kept_.begin() + static_cast<std::ptrdiff_t>(most_redundant(path, frames, present)));
        }
        kept_.push_back(std::move(now));
    }
    return out;
}

Answer VertexMethod::region(const RegionView& region, const FrameView& frame, const VertexDepths& found,
                            double own_share) const {
    if (own_share < MIN_OWN_SHARE) return decline("its corners belong to nearer regions");
    if (region.touches_border) return decline("cut by the image border");
    const Moments m = polygon_moments(region.loops);
    if (!(m.area > 0)) return decline("no area");
    const Loop& outer = region.loops.front();
    const std::vector<char> bend = bends(outer);
    std::vector<int> rows;
    for (std::size_t k = 0; k < std::min(region.corners.size(), bend.size()); ++k) {
        if (!bend[k]) continue;
        const auto at = std::lower_bound(row_of_id_.begin(), row_of_id_.end(), std::pair(region.corners[k], -1));
        if (at != row_of_id_.end() && at->first == region.corners[k]) rows.push_back(at->second);
    }
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    std::vector<PlaneCorner> corners;
    double sensitivity = 0.0;
    const double focal = camera_.focal();
    for (const int row : rows) {
        const auto r = static_cast<std::size_t>(row);
        const double z = found.xyz_cm[r].z;
        if (!std::isfinite(z) || !std::isfinite(frame.vertex_sigma_px[r])) continue;
        corners.push_back({(1 / focal) * (frame.vertex_px[r] - m.centre), 1 / z, found.sigma_cm[r] / (z * z)});
        sensitivity += found.sensitivity[r];
    }
    if (std::ssize(corners) < MIN_CORNERS) return decline("fewer than three corners with a depth");
    Plane plane;
    if (!fit_plane(corners, plane)) return decline("its corners disagree");
    const double b = plane.b / focal, c = plane.c / focal;
    const double mean = mean_of_inverse(region.loops, plane.a - b * m.centre.x - c * m.centre.y, b, c);
    const double silhouette = std::isfinite(mean) ? mean : 1 / plane.a;
    // what slants as a face does has no other relief
    const Relief relief = plane.slant_chi2 > SLOPE_CHI2 && may_be_one_face(outer) ? SLANTED_FACE : relief_of(outer, false);
    const double width = std::sqrt(m.area) / focal;
    const double relative = std::sqrt(plane.variance / square(plane.a) + square(relief.sigma_k * width) +
                                      square(config_.model_share));
    if (!(relative < config_.max_relative_sigma)) {
        char text[48];
        std::snprintf(text, sizeof text, "too uncertain (%.0f %%)", 100 * std::min(relative, 9.99));
        return decline(text);
    }
    const double depth = silhouette * (1 - relief.k * width);
    return {depth, relative * depth, sensitivity / static_cast<double>(corners.size()), {}};
}

}  // namespace depth
