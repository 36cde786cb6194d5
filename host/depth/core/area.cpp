#include "area.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "relief.hpp"
#include "robust.hpp"

namespace depth {

namespace {

constexpr double MIN_FACING = 0.5;     // cosine of the angle from the way beyond which a sight is not turned
constexpr double MIN_AHEAD = 0.7;       // cosine between optical axis and travel beyond which areas do not face it
constexpr double BREAK_SIGMAS = 6.0;   // a sight so far from the line of the others contradicts it
constexpr int BREAK_FRAMES = 2;        // so many of them in a row begin a new history
constexpr int FORGET_AREA_FRAMES = 30;      // a region not seen for so long has no history
constexpr double LEAST_WEIGHT = 1e-3;  // of a sight, so that the line can come back to it
constexpr int ROBUST_PASSES = 4;
constexpr int LEADING_PASSES = 2;      // of them
constexpr double PRIOR_SIGHTS = 4.0;   // what the sights say of their own sigma counts as so many of them
constexpr double SMALLEST_SIGMA = 1e-4;   // relative, of a size
constexpr double HIDDEN_SHARE = 0.5;   // of a size, for the share of its outline that is another's
constexpr double STRAIN_ERROR = 0.65;  // relative error of the depth for the strain over the growth, rms
constexpr double USUAL_STRAIN = 0.07;  // rms over boxes, boards and round things
constexpr double FLAT_SHARE = 0.003;   // model error even on a flat frontal thing

const char* const TOO_LITTLE = "too little motion towards it";
const char* const AFTER_CHANGE = "split or merged; a new baseline begins";
const char* const AFTER_JUMP = "its area jumped; a new baseline begins";

using Values = std::vector<double>;

std::string with_percent(const char* format, double share) {
    char text[96];
    std::snprintf(text, sizeof text, format, 100 * std::min(share, 9.99));
    return text;
}

// y = mean_y + slope (x - mean_x), and how the points lie to it.
struct Line {
    double slope = 0.0, mean_x = 0.0, mean_y = 0.0;
    double weight = 0.0;  // sum of the weights
    double sxx = 0.0;     // weighted square deviations of x
    double scale = 1.0;   // of the residuals, in their sigmas

    double at(double x) const { return mean_y + slope * (x - mean_x); }
    double variance_at(double x) const {
        return sxx > 0 ? square(scale) * (1 / weight + square(x - mean_x) / sxx) : INFINITY;
    }
};

// Weighted least squares.
Line line_through(const Values& x, const Values& y, const Values& weights) {
    Line line;
    double wx = 0.0, wy = 0.0;
    for (std::size_t k = 0; k < x.size(); ++k) {
        line.weight += weights[k];
        wx += weights[k] * x[k];
        wy += weights[k] * y[k];
    }
    line.mean_x = wx / line.weight;
    line.mean_y = wy / line.weight;
    double sxy = 0.0;
    for (std::size_t k = 0; k < x.size(); ++k) {
        const double along = x[k] - line.mean_x;
        line.sxx += weights[k] * along * along;
        sxy += weights[k] * along * (y[k] - line.mean_y);
    }
    line.slope = line.sxx > 0 ? sxy / line.sxx : 0.0;
    return line;
}

// Robust line; leaves the weights it ends with in `weights`.
//
// suspects: so many of the last points do not count for the first guess
Line robust_line(const Values& x, const Values& y, const Values& sigma, std::size_t suspects, Values& weights) {
    const std::size_t n = x.size();
    weights.resize(n);
    Values per_sigma(n);
    for (std::size_t k = 0; k < n; ++k) {
        per_sigma[k] = 1 / sigma[k];
        weights[k] = (k + suspects < n ? 1.0 : LEAST_WEIGHT) * square(per_sigma[k]);
    }
    Line line = line_through(x, y, weights);
    if (n < 4) return line;
    Values off(n), sorted(n);
    for (int pass = 0; pass < ROBUST_PASSES; ++pass) {
        for (std::size_t k = 0; k < n; ++k) off[k] = std::abs(y[k] - line.at(x[k])) * per_sigma[k];
        sorted = off;
        const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(n / 2);
        std::nth_element(sorted.begin(), middle, sorted.end());
        const double per_usual = 1 / std::max(1e-3, 1.4826 * *middle);
        // least absolute values lead the line away from a bad sight at its end, where least squares follow it
        const bool leading = pass < LEADING_PASSES;
        for (std::size_t k = 0; k < n; ++k) {
            const double u = off[k] * per_usual;
            const double share = leading ? (u > 1 ? 1 / u : 1.0) : square(std::max(0.0, 1 - square(u / TUKEY)));
            weights[k] = std::max(share, LEAST_WEIGHT) * square(per_sigma[k]);
        }
        line = line_through(x, y, weights);
    }
    double spread = 0.0, count = 0.0;
    for (std::size_t k = 0; k < n; ++k) {
        spread += weights[k] * square(y[k] - line.at(x[k]));
        count += weights[k] * square(sigma[k]);
    }
    line.scale = std::sqrt((PRIOR_SIGHTS + spread) / (PRIOR_SIGHTS + std::max(0.0, count - 2)));
    return line;
}

// Strain of the shape over growth of the size: how far a region is from a frontal plane.
struct Strain {
    double measured = 0.0;
    double sigma = 0.0;

    // What to expect of its square, knowing how large it usually is.
    double expected_square() const {
        const double prior = square(USUAL_STRAIN), trust = prior / (prior + square(sigma));
        return square(trust * measured) + trust * square(sigma);
    }
};

Strain strain_of(const Line& line, const Values& x, const std::array<Values, 3>& shape, const Values& weights) {
    Strain out;
    const double growth = line.slope / line.mean_y;  // of the size, per cm
    const double freedom = static_cast<double>(x.size()) - 2;
    // a strain changes a second moment twice over
    const double per_growth = 0.5 / (0.5 * (shape[0].back() + shape[1].back()) * growth);
    for (const Values& moment : shape) {
        const Line trend = line_through(x, moment, weights);
        const double strain = std::abs(trend.slope * per_growth);
        if (strain < out.measured) continue;
        double spread = 0.0;
        for (std::size_t k = 0; k < x.size(); ++k) spread += weights[k] * square(moment[k] - trend.at(x[k]));
        const double noise = freedom > 0 ? per_growth * std::sqrt(spread / freedom / trend.sxx) : 0.0;
        out.measured = strain;
        // outlines are no better known than areas
        out.sigma = std::max(noise, line.scale / std::sqrt(line.sxx) / line.slope);
    }
    return out;
}

// The smallest rotation that brings a unit direction to the z axis.
Mat3 turned_to_axis(Vec3 direction) {
    const Vec3 sine{direction.y, -direction.x, 0.0};
    const double s = length(sine);
    return s > 0 ? rotation_by((std::atan2(s, direction.z) / s) * sine) : Mat3{};
}

}  // namespace

AreaMethod::AreaMethod(const Camera& camera, const AreaConfig& config) : camera_(camera), config_(config) {}

void AreaMethod::forget(std::int64_t id) { histories_.erase(id); }

void AreaMethod::forget_unseen(int present) {
    std::erase_if(histories_, [present](const auto& h) { return present - h.second.last_frame > FORGET_AREA_FRAMES; });
}

std::set<int> AreaMethod::frames() const { return {kept_.begin(), kept_.end()}; }

// Once for each frame: whether it is to be kept, and the way to it from those that are.
void AreaMethod::open(const Path& path, int present) {
    if (present == present_) return;
    present_ = present;
    keep_present_ = kept_.empty() || path.distance_cm(kept_.back(), present) >= config_.min_step_cm;
    if (keep_present_ && static_cast<int>(kept_.size()) >= std::max(config_.history, 3)) {
        const auto gone = kept_.begin() + static_cast<std::ptrdiff_t>(most_redundant(path, kept_, present));
        for (auto& [id, history] : histories_)
            std::erase_if(history.sights, [gone](const Sight& s) { return s.frame == *gone; });
        kept_.erase(gone);
    }
    moves_.clear();
    Vec3 ahead{0.0, 0.0, 1.0};  // direction of travel in the present camera, from the farthest frame
    double most = 0.0;
    for (const int frame : kept_) {
        moves_.push_back(path.move(frame, present));
        const double way = length(moves_.back().shift_cm);
        if (way > most) most = way, ahead = (-1 / way) * moves_.back().shift_cm;
    }
    if (ahead.z < 0) ahead = -1.0 * ahead;
    axis_ = most >= config_.min_step_cm && ahead.z > MIN_AHEAD ? turned_to_axis(ahead) : Mat3{};
    for (Move& move : moves_) move.turn = axis_ * move.turn, move.shift_cm = axis_ * move.shift_cm;
    if (keep_present_) kept_.push_back(present), moves_.emplace_back();
}

AreaMethod::Sight AreaMethod::measure(const RegionView& region) const {
    Moments m = polygon_moments(region.loops);
    const double fx = camera_.fx, fy = camera_.fy;
    // the polygon only says how the lens scales the measured soft area
    m.area *= region.area_px / region.polygon_px / (fx * fy);
    m.centre = {(m.centre.x - camera_.cx) / fx, (m.centre.y - camera_.cy) / fy};
    m.xx /= fx * fx;
    m.yy /= fy * fy;
    m.xy /= fx * fy;
    return {present_, m, std::max(0.5 * region.sigma_area_px / region.area_px, SMALLEST_SIGMA)};
}

// Adds a sight as a camera that looks ahead would have taken it. False where that would not have shown the region.
bool AreaMethod::add_turned(const Sight& sight, const Move& move) {
    const Moments& m = sight.moments;
    const Mat3& r = move.turn;
    const Vec3 p = r * Vec3{m.centre.x, m.centre.y, 1.0};
    if (p.z < MIN_FACING * length(p)) return false;
    const double inverse = 1 / p.z, u = p.x * inverse, v = p.y * inverse;
    const double variance = r(2, 0) * r(2, 0) * m.xx + 2 * r(2, 0) * r(2, 1) * m.xy + r(2, 1) * r(2, 1) * m.yy;
    const double area = m.area * (1 + 6 * variance * inverse * inverse) * inverse * inverse * inverse;
    const double a = (r(0, 0) - u * r(2, 0)) * inverse, b = (r(0, 1) - u * r(2, 1)) * inverse;
    const double c = (r(1, 0) - v * r(2, 0)) * inverse, d = (r(1, 1) - v * r(2, 1)) * inverse;
    const double inverse_size = 1 / std::sqrt(area), per_area = inverse_size * inverse_size;
    sights_.behind_cm.push_back(-move.shift_cm.z);
    sights_.inverse_size.push_back(inverse_size);
    // an unknown turn by w scales an area seen towards u by 1 + 3 u w
    const double turn = 1.5 * move.turn_sigma_rad;
    sights_.sigma.push_back(inverse_size * std::sqrt(square(sight.relative_sigma) + (u * u + v * v) * turn * turn));
    sights_.shape[0].push_back((a * a * m.xx + 2 * a * b * m.xy + b * b * m.yy) * per_area);
    sights_.shape[1].push_back((c * c * m.xx + 2 * c * d * m.xy + d * d * m.yy) * per_area);
    sights_.shape[2].push_back((a * c * m.xx + (a * d + b * c) * m.xy + b * d * m.yy) * per_area);
    return true;
}

Answer AreaMethod::update(const RegionView& region, const FrameView& frame, const Path& path, int present,
                          double own_share) {
    open(path, present);
    if (std::find(frame.changed.begin(), frame.changed.end(), region.id) != frame.changed.end())
        histories_[region.id] = {{}, present, 0, AFTER_CHANGE};
    History& history = histories_.try_emplace(region.id, History{{}, present, 0, TOO_LITTLE}).first->second;
    history.last_frame = present;
    if (region.touches_border) return decline("cut by the image border");
    if (own_share < config_.own_share) return decline("partly hidden by a nearer region");
    Sight now = measure(region);
    if (!(region.area_px > 0) || !(region.polygon_px > 0) || !(now.moments.area > 0)) return decline("no area");
    const double hidden = HIDDEN_SHARE * (1 - std::min(own_share, 1.0));
    now.relative_sigma = std::sqrt(square(now.relative_sigma) + square(hidden));

    sights_.clear();
    farthest_ = {};
    std::size_t at = 0;
    for (const Sight& then : history.sights) {
        while (kept_[at] != then.frame) ++at;
        if (add_turned(then, moves_[at]) && std::abs(moves_[at].shift_cm.z) >= std::abs(farthest_.shift_cm.z))
            farthest_ = moves_[at];
    }
    if (!add_turned(now, Move{axis_, {}, 0.0, 0.0})) return decline("too far from the direction of travel");
    const std::size_t suspects = static_cast<std::size_t>(history.jumps) + 1;
    const bool enough = sights_.behind_cm.size() >= suspects + 3;
    const Line line =
        robust_line(sights_.behind_cm, sights_.inverse_size, sights_.sigma, enough ? suspects : 0, weights_);
    if (keep_present_) {
        history.sights.push_back(now);
        const double doubt = std::sqrt(square(sights_.sigma.back() * line.scale) + line.variance_at(0.0));
        const bool jumped = enough && std::abs(sights_.inverse_size.back() - line.at(0.0)) > BREAK_SIGMAS * doubt;
        history.jumps = jumped ? history.jumps + 1 : 0;
        if (history.jumps >= BREAK_FRAMES) {
            history.sights.erase(history.sights.begin(), history.sights.end() - history.jumps);
            history.jumps = 0;
            history.why_new = AFTER_JUMP;
            return decline(AFTER_JUMP);
        }
    }

    const auto [nearest, farthest] = std::minmax_element(sights_.behind_cm.begin(), sights_.behind_cm.end());
    const double way = *farthest - *nearest;
    if (way < config_.min_step_cm || std::abs(line.slope) * way < config_.min_change * sights_.inverse_size.back())
        return decline(history.why_new);
    if (line.slope < 0) return decline("its area does not grow with the motion");
    const double along_way = line.at(0.0) / line.slope;
    if (!(along_way > 0)) return decline("its area grows too fast for its motion");
    const Strain strain = strain_of(line, sights_.behind_cm, sights_.shape, weights_);
    if (strain.measured > config_.shape_change + 3 * strain.sigma)
        return decline(with_percent("its shape changed by %.0f %% of its growth", strain.measured));
    // the line is uncertain in its height and, about its middle, in its slope
    const double noise =
        square(line.scale / line.slope / along_way) * (1 / line.weight + square(along_way + line.mean_x) / line.sxx);
    const double travel = farthest_.travel_sigma_cm / std::max(std::abs(farthest_.shift_cm.z), 1e-9);
    // an outline that is d too far out makes a size too large by d times this, relative
    const double per_px = outline_length(region.loops) / (2 * region.area_px);
    const double growth = line.slope * way / line.mean_y;
    const double bias = per_px * std::sqrt(square(config_.outline_px) + square(config_.drift_px / growth));
    const Relief relief = relief_of(region.loops.front(), false);
    const double width2 = region.area_px / square(camera_.focal());
    const double surface = (square(relief.k) + square(relief.sigma_k)) * width2 + square(FLAT_SHARE);
    const double relative = std::sqrt(noise + square(travel) + square(bias) + surface +
                                      square(STRAIN_ERROR) * strain.expected_square());
    if (!(relative < config_.max_relative_sigma)) return decline(with_percent("too uncertain (%.0f %%)", relative));
    // from the direction of travel to the optical axis, at the middle of the region
    const Vec3 ray{now.moments.centre.x, now.moments.centre.y, 1.0};
    const double depth = along_way / (axis_ * ray).z;
    return {depth, relative * depth, 2 * region.area_px / depth, {}};
}

}  // namespace depth
