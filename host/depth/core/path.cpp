#include "path.hpp"

#include <algorithm>
#include <cmath>

#include "robust.hpp"

namespace depth {

namespace {
constexpr double STANDS_CM = 0.05;  // a shorter step tells no direction

constexpr double ROLL_RAD = 0.01;       // between two frames, more than wheels on a floor roll a camera
constexpr double RISE_CM = 0.2;         // likewise, than they lift it
constexpr double STEEPEST_MOUNT = 0.7;  // roll over yaw, or rise over way, that a camera looking down sees on wheels

}  // namespace

void Path::add(int frame, const Mat3& rotation, Vec3 position_cm, double t_s, double travel_sigma_cm,
               double turn_sigma_rad) {
    Station now;
    now.rotation = rotation;
    now.read_cm = now.position_cm = position_cm;
    now.t_s = t_s;
    now.reading_variance_cm2 = square(std::max(noise_.travel_cm, travel_sigma_cm));
    now.travel_variance_cm2 = square(travel_sigma_cm);
    now.told_variance_rad2 = square(turn_sigma_rad);
    now.ahead = {rotation(0, 2), rotation(1, 2), rotation(2, 2)};
    if (!stations_.empty()) {
        const Station& last = stations_.rbegin()->second;
        const Vec3 read = position_cm - last.read_cm;
        const Mat3 off = last.rotation * rotation_by({0.0, last.heading_rad, 0.0}) * transposed(last.rotation);
        const Vec3 step = off * read;
        now.heading_rad = last.heading_rad, now.heading_variance_rad2 = last.heading_variance_rad2;
        now.position_cm = last.position_cm + step;
        const double step_cm = length(step);
        const double turn = angle_of(transposed(last.rotation) * rotation);
        const double dt_s = t_s - last.t_s;
        now.path_cm = last.path_cm + step_cm;
        now.travel_variance_cm2 = std::max(last.travel_variance_cm2, now.travel_variance_cm2);
        now.reading_variance_cm2 = last.reading_variance_cm2;
        now.turn_variance_rad2 =
            last.turn_variance_rad2 + square(std::max(noise_.turn_rad, turn_sigma_rad)) + square(noise_.turn_share * turn);
        now.timing_variance_rad2 = dt_s > 0 ? square(turn / dt_s * noise_.timing_s) : 0.0;
        now.ahead = step_cm > STANDS_CM ? (1 / step_cm) * step : last.ahead;
        tracked_ = tracked_ || !as_on_wheels(last, now);
    }
    stations_[frame] = now;
}

bool Path::as_on_wheels(const Station& last, const Station& now) const {
    const Mat3 turn = transposed(last.rotation) * now.rotation;
    const double yaw = 0.5 * (turn(0, 2) - turn(2, 0)), roll = 0.5 * (turn(1, 0) - turn(0, 1));
    if (std::abs(roll) > ROLL_RAD && std::abs(roll) > STEEPEST_MOUNT * std::abs(yaw)) return false;
    const Vec3 step = transposed(last.rotation) * (now.read_cm - last.read_cm);
    return std::abs(step.y) < RISE_CM || std::abs(step.y) < STEEPEST_MOUNT * std::hypot(step.x, step.z);
}

Vec3 Path::position_cm(int frame) const {
    const Station& s = at(frame);
    return s.position_cm + s.travel_cm * s.ahead;
}

Mat3 Path::rotation(int frame) const {
    const Station& s = at(frame);
    return s.rotation * rotation_by({s.pitch_rad, s.yaw_rad, 0.0});
}

Move Path::move(int here, int there) const {
    const Station &a = at(here), &b = at(there);
    const Mat3 back = transposed(rotation(there));
    Move out;
    out.turn = back * rotation(here);
    out.shift_cm = back * (position_cm(here) - position_cm(there));
    out.heading_sigma_rad = std::sqrt(heading_variance(here, there));
    if (a.solved_travel_sigma_cm >= 0 && b.solved_travel_sigma_cm >= 0) {
        out.travel_sigma_cm =
            std::hypot(std::max(a.solved_travel_sigma_cm, b.solved_travel_sigma_cm), std::sqrt(2) * place_sigma_cm(),
                       scale_sigma_ * length(out.shift_cm));
        out.turn_sigma_rad = std::max(a.solved_turn_sigma_rad, b.solved_turn_sigma_rad);
        return out;
    }
    out.travel_sigma_cm = std::sqrt(std::abs(a.travel_variance_cm2 - b.travel_variance_cm2) +
                                    a.reading_variance_cm2 + b.reading_variance_cm2 + 2 * square(place_sigma_cm()));
    out.turn_sigma_rad = std::sqrt(std::abs(a.turn_variance_rad2 - b.turn_variance_rad2) +
                                   a.timing_variance_rad2 + b.timing_variance_rad2);
    return out;
}

double Path::distance_cm(int a, int b) const { return length(position_cm(a) - position_cm(b)); }

void Path::keep(const std::set<int>& frames) {
    for (auto it = stations_.begin(); it != stations_.end();)
        it = frames.contains(it->first) || std::next(it) == stations_.end() ? std::next(it) : stations_.erase(it);
}

std::size_t most_redundant(const Path& path, const std::vector<int>& frames, int present) {
    std::size_t best = 1;
    double least = INFINITY;
    for (std::size_t k = 1; k + 1 < frames.size(); ++k) {
        const double gap = path.distance_cm(frames[k - 1], frames[k + 1]);
        const double measure = gap / (path.distance_cm(frames[k], present) + 1.0);
        if (measure < least) least = measure, best = k;
    }
    return best;
}

}  // namespace depth
