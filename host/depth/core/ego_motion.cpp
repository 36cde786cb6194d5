#include "ego_motion.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "dense.hpp"
#include "robust.hpp"

namespace depth {

namespace {

constexpr double BORDER_PX = 3.0;       // a vertex so near to the image border slides along it
constexpr std::size_t FEWEST_TRACKS = 6;
constexpr double GUESS_PX = 0.75;       // how far a guess from the vertices may be off
constexpr double MEMORY = 0.85;         // share of what was learnt of odometry that a frame leaves standing
constexpr double SHAKING_GAIN = 0.1;    // of what one frame says of how much the camera shakes
constexpr double SOLVED_CM = 0.02;      // how well the travel between frames is solved, for stepped odometry
constexpr std::size_t READINGS = 96;
constexpr double SAME_STEP = 0.02;      // relative; steps of odometry are multiples of each other within this
constexpr std::size_t FEWEST_STEPS = 4;
constexpr double WIDEST_SCALE = 0.25;   // by which stepped odometry may be wrong in all

double median(std::vector<double> v) {
    std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
    return v[v.size() / 2];
}

// The step odometry comes in, 0 where it is smooth: all differences are whole multiples of the smallest,
// and not all alike.
double quantum(const std::vector<double>& path_cm) {
    double least = INFINITY, most = 0;
    for (std::size_t i = 1; i < path_cm.size(); ++i) {
        const double d = path_cm[i] - path_cm[i - 1];
        if (d > 1e-6) least = std::min(least, d);
        most = std::max(most, d);
    }
    if (!std::isfinite(least)) return 0.0;
    bool alike = true;
    for (std::size_t i = 1; i < path_cm.size(); ++i) {
        const double steps = (path_cm[i] - path_cm[i - 1]) / least;
        if (std::abs(steps - std::round(steps)) > SAME_STEP) return 0.0;
        alike = alike && std::lround(steps) == 1;
    }
    return alike ? 0.0 : least;
}

}  // namespace

std::optional<EgoMotion::Jerk> EgoMotion::guess(const FrameView& frame, const VertexDepths& last_depths, Path& path,
                                                int present) const {
    if (last_ < 0) return std::nullopt;
    Station& here = path.at(present);
    here.pitch_rad = path.at(last_).pitch_rad, here.yaw_rad = path.at(last_).yaw_rad;
    here.travel_cm = path.at(last_).travel_cm;
    std::unordered_map<std::int64_t, std::size_t> row;
    for (std::size_t i = 0; i < last_ids_.size(); ++i) row[last_ids_[i]] = i;
    std::vector<double> rhos;
    for (const Vec3& p : last_depths.xyz_cm)
        if (p.z > 0) rhos.push_back(1 / p.z);
    const double usual = rhos.empty() ? 0.0 : median(rhos);
    const Move move = path.move(last_, present);
    const auto inside = [&](Vec2 p) {
        return p.x > BORDER_PX && p.y > BORDER_PX && p.x < camera_.width - 1 - BORDER_PX &&
               p.y < camera_.height - 1 - BORDER_PX;
    };
    struct Track {
        double x, y, off_x, off_y;
    };
    std::vector<Track> tracks;
    for (std::size_t i = 0; i < frame.vertex_ids.size(); ++i) {
        const auto it = row.find(frame.vertex_ids[i]);
        if (it == row.end() || !inside(frame.vertex_px[i]) || !inside(last_px_[it->second])) continue;
        const double z = it->second < last_depths.xyz_cm.size() ? last_depths.xyz_cm[it->second].z : NAN;
        const Vec3 a = move.turn * camera_.ray(last_px_[it->second]) + (z > 0 ? 1 / z : usual) * move.shift_cm;
        if (!(a.z > 0.05)) continue;
        const Vec2 off = frame.vertex_px[i] - camera_.pixel(a);
        tracks.push_back({a.x / a.z, a.y / a.z, off.x, off.y});
    }
    if (tracks.size() < FEWEST_TRACKS) return std::nullopt;
    std::vector<double> xs, ys;
    for (const Track& t : tracks) xs.push_back(t.off_x), ys.push_back(t.off_y);
    double yaw = -median(xs) / camera_.fx, pitch = median(ys) / camera_.fy, spread_px = 0;
    for (int pass = 0; pass < 3; ++pass) {
        // turning the camera by (pitch, yaw) shifts what it sees by fx (pitch x y - yaw (1 + x^2)) and
        // fy (pitch (1 + y^2) - yaw x y)
        std::vector<double> size;
        const auto rest = [&](const Track& t) {
            return Vec2{t.off_x - camera_.fx * (pitch * t.x * t.y - yaw * (1 + t.x * t.x)),
                        t.off_y - camera_.fy * (pitch * (1 + t.y * t.y) - yaw * t.x * t.y)};
        };
        for (const Track& t : tracks) size.push_back(length(rest(t)));
        spread_px = median(size);
        const double reach = TUKEY * std::max(spread_px, 0.05);
        double pp = 1e-12, py = 0, yy = 1e-12, gp = 0, gy = 0;
        for (const Track& t : tracks) {
            const Vec2 r = rest(t);
            const double u = 1 - square(length(r) / reach);
            if (!(u > 0)) continue;
            const Vec2 jp{camera_.fx * t.x * t.y, camera_.fy * (1 + t.y * t.y)};
            const Vec2 jy{-camera_.fx * (1 + t.x * t.x), -camera_.fy * t.x * t.y};
            pp += u * u * dot(jp, jp), py += u * u * dot(jp, jy), yy += u * u * dot(jy, jy);
            gp += u * u * dot(jp, r), gy += u * u * dot(jy, r);
        }
        const double det = pp * yy - py * py;
        pitch += (yy * gp - py * gy) / det, yaw += (pp * gy - py * gp) / det;
    }
    const double doubt_px = GUESS_PX + 3 * spread_px / std::sqrt(static_cast<double>(tracks.size()));
    const double seen = 0.5 * (square(pitch) + square(yaw)) - square(doubt_px / camera_.focal());
    if (!(seen > 0)) return std::nullopt;
    return Jerk{pitch, yaw};
}

void EgoMotion::believe(const Jerk& jerk, Path& path, int present) {
    Station& here = path.at(present);
    const Station& last = path.at(last_);
    here.pitch_rad += jerk.pitch_rad, here.yaw_rad += jerk.yaw_rad;
    const double each = 2 * path.least_turn_variance();
    const double thought = here.turn_variance_rad2 - last.turn_variance_rad2 + here.timing_variance_rad2 +
                           last.timing_variance_rad2 + each;
    const double seen = 0.5 * (square(jerk.pitch_rad) + square(jerk.yaw_rad));
    turn_excess_ = std::max(turn_excess_, seen / thought);
    const double nod = path.tracked() ? thought : each + here.told_variance_rad2 + last.told_variance_rad2;
    pitch_excess_ = std::max(pitch_excess_, seen / nod);
}

MotionPrior EgoMotion::prior(const Path& path, const std::vector<int>& frames) const {
    const std::size_t count = frames.size();
    MotionPrior out;
    for (std::vector<double>& p : out.turn_precision) p.assign(count * count, 0.0);
    out.travel_precision.assign(count * count, 0.0);
    out.travel_mean_cm.assign(count, 0.0);
    double first_turn = INFINITY, first_travel = INFINITY;
    for (const int f : frames) {
        // the floor holds a robot's pitch: it shakes, but nothing adds up
        const double pitch = path.tracked() ? path.at(f).pitch_rad : 0.0;
        if (path.at(f).turn_variance_rad2 < first_turn) out.turn_mean = {pitch, path.at(f).yaw_rad};
        first_turn = std::min(first_turn, path.at(f).turn_variance_rad2);
        first_travel = std::min(first_travel, path.at(f).travel_variance_cm2);
    }
    for (std::size_t a = 0; a < count; ++a)
        for (std::size_t b = 0; b < count; ++b) {
            const Station &p = path.at(frames[a]), &q = path.at(frames[b]);
            double turn = std::min(p.turn_variance_rad2, q.turn_variance_rad2) - first_turn;
            double travel = std::min(p.travel_variance_cm2, q.travel_variance_cm2) - first_travel;
            double pitch = path.tracked() ? turn : 0.0;
            if (a == b) {
                const double each = p.timing_variance_rad2 + path.least_turn_variance();
                turn += each, pitch += path.tracked() ? each : path.least_turn_variance() + p.told_variance_rad2;
                travel += p.reading_variance_cm2;
            }
            out.turn_precision[0][a * count + b] = pitch_excess_ * pitch;
            out.turn_precision[1][a * count + b] = turn_excess_ * turn;
            out.travel_precision[a * count + b] = travel_excess_ * travel;
        }
    if (quantum_cm_ > 0) {
        // every earlier reading has been made whole by those around it
        for (std::size_t a = 0; a < count; ++a) {
            out.travel_mean_cm[a] = a == 0 ? 0.0 : path.at(frames[a]).travel_cm;
            for (std::size_t b = 0; b < count; ++b)
                out.travel_precision[a * count + b] =
                    a != b ? 0.0 : a == 0 ? square(quantum_cm_) / 12 : square(SOLVED_CM);
        }
    }
    for (std::vector<double>& p : out.turn_precision) invert_spd(p, count);
    invert_spd(out.travel_precision, count);
    return out;
}

std::vector<Correction> EgoMotion::corrections(const Path& path, const std::vector<int>& frames,
                                               const std::vector<double>& covariance, double rho) const {
    const std::size_t m = 3 * frames.size();
    const Station& now = path.at(frames[0]);
    std::vector<Correction> out;
    for (std::size_t a = 1; a < frames.size(); ++a) {
        const Station& then = path.at(frames[a]);
        Correction c{then.t_s, now.yaw_rad - then.yaw_rad, 0.0, now.travel_cm - then.travel_cm, 0.0};
        const auto variance = [&](std::size_t i) {
            return covariance[i * m + i] + covariance[(3 * a + i) * m + 3 * a + i] - 2 * covariance[i * m + 3 * a + i];
        };
        if (covariance.empty()) {
            c.yaw_sigma_rad = std::sqrt(turn_excess_ * (now.turn_variance_rad2 - then.turn_variance_rad2 +
                                                        now.timing_variance_rad2 + then.timing_variance_rad2));
            c.travel_sigma_cm = std::sqrt(travel_excess_ * (now.travel_variance_cm2 - then.travel_variance_cm2 +
                                                            now.reading_variance_cm2 + then.reading_variance_cm2));
        } else {
            const double aside = rho * path.distance_cm(frames[0], frames[a]);
            const double heading = path.heading_variance(frames[0], frames[a]);
            c.yaw_sigma_rad = std::sqrt(std::max(0.0, variance(1)) + square(aside) * heading);
            c.travel_sigma_cm = std::sqrt(std::max(0.0, variance(2)));
        }
        out.push_back(c);
    }
    return out;
}

void EgoMotion::learn(Path& path, const std::vector<int>& frames,
                      const std::vector<std::array<double, 3>>& cameras, const std::vector<double>& covariance) {
    const std::size_t count = frames.size(), m = 3 * count;
    for (std::size_t a = 0; a < count; ++a) {
        Station& s = path.at(frames[a]);
        s.pitch_rad = cameras[a][0], s.yaw_rad = cameras[a][1], s.travel_cm = cameras[a][2];
    }
    if (covariance.empty()) return;
    const auto relative = [&](std::size_t a, std::size_t i) {  // variance against the present frame
        return covariance[i * m + i] + covariance[(3 * a + i) * m + 3 * a + i] - 2 * covariance[i * m + 3 * a + i];
    };
    for (std::size_t a = 0; a < count; ++a) {
        Station& s = path.at(frames[a]);
        s.solved_turn_sigma_rad = std::sqrt(std::max({0.0, relative(a, 0), relative(a, 1)}));
        s.solved_travel_sigma_cm = std::sqrt(std::max(0.0, relative(a, 2)));
    }
    // expected squares of the errors, in units of the prior
    const MotionPrior expected = prior(path, frames);
    for (std::size_t i = 0; i < 2; ++i) {
        double turn = 0;
        for (std::size_t a = 0; a < count; ++a)
            for (std::size_t b = 0; b < count; ++b)
                turn += expected.turn_precision[i][a * count + b] *
                        ((cameras[a][i] - expected.turn_mean[i]) * (cameras[b][i] - expected.turn_mean[i]) +
                         covariance[(3 * a + i) * m + 3 * b + i]);
        double& excess = i == 0 ? pitch_excess_ : turn_excess_;
        excess = std::max(1.0, excess * (MEMORY + (1 - MEMORY) * turn / static_cast<double>(count)));
    }
    learn_heading(path, frames[0], std::sqrt(std::max(0.0, relative(count - 1, 1))));
    if (quantum_cm_ == 0) learn_travel(path, frames, cameras, covariance);
    rescale(path, frames[0]);
    path.set_scale_sigma(scale_sigma_);
}

// The robot goes where it heads. What the camera turns beyond that is shaking, which shows in its pitch as
// much as in its yaw, and is no error of the heading.
void EgoMotion::learn_heading(Path& path, int present, double sigma_rad) {
    Station& here = path.at(present);
    if (learnt_ >= 0) {
        const double nod = here.pitch_rad - learnt_pitch_;
        shaking_ += SHAKING_GAIN * (square(nod) - shaking_);
        heading_variance_ += std::max(0.0, here.turn_variance_rad2 - learnt_variance_ - shaking_);
        const double noise = square(sigma_rad) + shaking_ + here.timing_variance_rad2;
        const double gain = heading_variance_ > 0 ? heading_variance_ / (heading_variance_ + noise) : 0.0;
        here.heading_rad += gain * (here.yaw_rad - here.heading_rad);
        heading_variance_ *= 1 - gain;
        here.heading_variance_rad2 = heading_variance_;
    }
    learnt_ = present, learnt_pitch_ = here.pitch_rad, learnt_variance_ = here.turn_variance_rad2;
}

// What travel differs from odometry by, beyond an offset and a scale of all of it: those show nowhere in the
// images, and learning from them would feed on itself.
void EgoMotion::learn_travel(const Path& path, const std::vector<int>& frames,
                             const std::vector<std::array<double, 3>>& cameras, const std::vector<double>& covariance) {
    const std::size_t count = frames.size(), m = 3 * count;
    if (count < 4) return;
    double mean = 0, spread = 0;
    for (const int f : frames) mean += path.at(f).path_cm / static_cast<double>(count);
    for (const int f : frames) spread += square(path.at(f).path_cm - mean);
    if (!(spread > 0)) return;
    std::vector<double> keep(count * count);  // takes offset and scale away
    for (std::size_t a = 0; a < count; ++a)
        for (std::size_t b = 0; b < count; ++b)
            keep[a * count + b] = (a == b) - 1 / static_cast<double>(count) -
                                  (path.at(frames[a]).path_cm - mean) * (path.at(frames[b]).path_cm - mean) / spread;
    double sum = 0;
    for (std::size_t a = 0; a < count; ++a) {
        double off = 0, variance = 0;
        for (std::size_t b = 0; b < count; ++b) {
            off += keep[a * count + b] * cameras[b][2];
            for (std::size_t c = 0; c < count; ++c)
                variance += keep[a * count + b] * covariance[(3 * b + 2) * m + 3 * c + 2] * keep[a * count + c];
        }
        sum += (square(off) + variance) / (travel_excess_ * path.at(frames[a]).reading_variance_cm2);
    }
    travel_excess_ =
        std::max(1.0, travel_excess_ * (MEMORY + (1 - MEMORY) * sum / static_cast<double>(count - 2)));
}

// Stepped odometry: readings lie within half a step of the truth, so that the scale and the offset which
// put every solved distance within half a step of its reading are known better with every frame. The mean
// over the scales, weighted by the width of the offsets each of them leaves.
void EgoMotion::rescale(Path& path, int present) {
    const Station& here = path.at(present);
    readings_.push_back({present, here.path_cm, here.path_cm + here.travel_cm});
    if (readings_.size() > READINGS) readings_.erase(readings_.begin());
    std::vector<double> read;
    for (const Reading& r : readings_) read.push_back(r.read_cm);
    const double before = quantum_cm_;
    quantum_cm_ = readings_.size() > FEWEST_STEPS ? quantum(read) : 0.0;
    scale_sigma_ = 0.0;
    if (quantum_cm_ == 0) {
        if (before > 0) readings_.clear();
        return;
    }
    double mean = 0;
    for (const Reading& r : readings_) mean += r.solved_cm / static_cast<double>(readings_.size());
    double half = quantum_cm_ / 2 + SOLVED_CM;
    constexpr int HALF_GRID = 200;
    for (int attempt = 0; attempt < 8; ++attempt, half *= 1.3) {
        double sum = 0, first = 0, second = 0, offset = 0;
        for (int i = -HALF_GRID; i <= HALF_GRID; ++i) {
            const double scale = 1 + WIDEST_SCALE * i / HALF_GRID;
            double low = -INFINITY, high = INFINITY;
            for (const Reading& r : readings_) {
                const double off = r.read_cm - scale * (r.solved_cm - mean);
                low = std::max(low, off - half), high = std::min(high, off + half);
            }
            const double width = high - low;
            if (!(width > 0)) continue;
            sum += width, first += width * scale, second += width * scale * scale;
            offset += width * 0.5 * (low + high);
        }
        if (!(sum > 0)) continue;
        const double scale = first / sum;
        scale_sigma_ = std::sqrt(std::max(0.0, second / sum - scale * scale));
        for (Reading& r : readings_) {
            r.solved_cm = offset / sum + scale * (r.solved_cm - mean);
            if (path.has(r.frame)) path.at(r.frame).travel_cm = r.solved_cm - r.read_cm;
        }
        return;
    }
}

void EgoMotion::remember(const FrameView& frame, int present) {
    last_ = present;
    last_ids_ = frame.vertex_ids, last_px_ = frame.vertex_px;
}

}  // namespace depth
