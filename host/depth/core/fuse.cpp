#include "fuse.hpp"

#include <cmath>

namespace depth {

namespace {
constexpr double METHOD_CORRELATION = 0.6;
constexpr double DISAGREEMENT_SIGMAS = 3.0;
// A region that can be measured no longer has changed: merged, hidden or cut. What was just found goes with it.
constexpr int CONFIRMED = 8;                   // measurements one after the other in agreement, from which on a depth is carried
constexpr double CARRIED_SHARE = 0.05;         // relative error of what is carried, because of that change,
constexpr double CARRIED_SHARE_PER_CM = 0.01;  // and because of the way since
constexpr int FORGET_FRAMES = 30;  // a region not seen for so long is new when it comes back

// Weights of least variance, inv(C) 1, of those that `take` part; what would get a negative one is left out:
// it knows nothing that surer ones with the same errors do not know better.
std::array<double, 3> best_weights(const std::array<const Answer*, 3>& answers, std::array<bool, 3> take) {
    for (;;) {
        std::array<double, 3> weight{};
        double sum = 0;
        double inverse = 0, count = 0;  // sums over those that take part
        for (std::size_t m = 0; m < 3; ++m)
            if (take[m]) inverse += 1 / answers[m]->sigma_cm, count += 1;
        std::size_t least = 3;
        for (std::size_t m = 0; m < 3; ++m) {
            if (!take[m]) continue;
            // all pairs share the correlation r: inv(C) 1 has the closed form (1/s - r sum(1/s) / (1 + (n-1) r)) / s
            const double own = 1 / answers[m]->sigma_cm;
            weight[m] = own * (own - METHOD_CORRELATION * inverse / (1 + (count - 1) * METHOD_CORRELATION));
            sum += weight[m];
            if (weight[m] <= 0 && (least == 3 || weight[m] < weight[least])) least = m;
        }
        if (least == 3) {
            for (double& w : weight) w /= sum;
            return weight;
        }
        take[least] = false;
    }
}

}  // namespace

std::optional<Fused> combine(const std::array<const Answer*, 3>& answers) {
    // growth alone is too easily fooled, by whatever takes away from a region or adds to it
    const Answer* best = answers[static_cast<std::size_t>(Method::outline)];
    if (!best->known()) best = answers[static_cast<std::size_t>(Method::vertex)];
    if (!best->known()) return std::nullopt;
    Fused out;
    std::array<bool, 3> agrees{};
    for (std::size_t m = 0; m < 3; ++m) {
        const Answer& a = *answers[m];
        if (!a.known()) continue;
        agrees[m] = std::abs(a.depth_cm - best->depth_cm) <= DISAGREEMENT_SIGMAS * std::hypot(a.sigma_cm, best->sigma_cm);
        if (!agrees[m]) out.note += (out.note.empty() ? "contradicted by " : ", ") + std::string(METHOD_NAMES[m]);
    }
    const std::array<double, 3> weight = best_weights(answers, agrees);
    double variance = 0, most = 0;
    for (std::size_t m = 0; m < 3; ++m) {
        if (!(weight[m] > 0)) continue;
        if (weight[m] > most) most = weight[m], out.method = static_cast<Method>(m);
        out.depth_cm += weight[m] * answers[m]->depth_cm;
        for (std::size_t q = 0; q < 3; ++q)
            if (weight[q] > 0)
                variance += weight[m] * weight[q] * answers[m]->sigma_cm * answers[q]->sigma_cm *
                            (m == q ? 1.0 : METHOD_CORRELATION);
    }
    out.sigma_cm = std::sqrt(variance);
    return out;
}

void Memory::forget_unseen(int present) {
    std::erase_if(last_, [&](const auto& entry) { return present - entry.second.frame > FORGET_FRAMES; });
}

std::set<int> Memory::frames() const {
    std::set<int> out;
    for (const auto& [id, r] : last_) out.insert(r.frame);
    return out;
}

std::optional<Fused> Memory::predict(std::int64_t id, const Path& path, int present) const {
    const auto it = last_.find(id);
    if (it == last_.end()) return std::nullopt;
    const Remembered& last = it->second;
    const Move move = path.move(last.frame, present);
    Fused out = last.fused;
    out.depth_cm = (move.turn * (last.fused.depth_cm * last.ray) + move.shift_cm).z;
    if (!(out.depth_cm > 0)) return std::nullopt;
    const double moved = length(move.shift_cm);
    const double drift = config_.memory_share_per_cm * moved * out.depth_cm;
    const double odometry = moved > 0 ? move.travel_sigma_cm : 0.0;
    out.sigma_cm = std::sqrt(last.fused.sigma_cm * last.fused.sigma_cm + drift * drift + odometry * odometry);
    out.note.clear();
    return out;
}

std::optional<Fused> Memory::update(std::int64_t id, const std::optional<Fused>& measured, Vec3 ray,
                                    const Path& path, int present) {
    const std::optional<Fused> before = predict(id, path, present);
    if (!measured) {
        if (!before) return std::nullopt;
        if (before->sigma_cm > config_.max_relative_sigma * before->depth_cm) {
            forget(id);
            return std::nullopt;
        }
        if (last_.at(id).measured < CONFIRMED) return std::nullopt;
        // the ray and the sigma stay those of the last measurement, so that carrying adds nothing twice
        Fused out = *before;
        out.note = "carried on from an earlier frame";
        const double moved = path.distance_cm(last_.at(id).frame, present);
        out.sigma_cm = std::hypot(out.sigma_cm, (CARRIED_SHARE + CARRIED_SHARE_PER_CM * moved) * out.depth_cm);
        if (out.sigma_cm > config_.max_relative_sigma * out.depth_cm) return std::nullopt;
        return out;
    }
    Fused now = *measured;
    int times = 1;
    if (before) {
        if (path.distance_cm(last_.at(id).frame, present) < config_.min_step_cm) {
            Fused out = *before;  // at rest nothing new is learnt
            out.note = measured->note;
            return out;
        }
        const double gate = DISAGREEMENT_SIGMAS * std::hypot(before->sigma_cm, now.sigma_cm);
        if (std::abs(before->depth_cm - now.depth_cm) > gate) {
            now.note = "differs from its last depth; begun anew";
        } else {
            const double a = 1 / (now.sigma_cm * now.sigma_cm), b = 1 / (before->sigma_cm * before->sigma_cm);
            const double w = a / (a + b);
            now.depth_cm = w * now.depth_cm + (1 - w) * before->depth_cm;
            now.sigma_cm = w * now.sigma_cm + (1 - w) * before->sigma_cm;
            times = last_.at(id).measured + 1;
        }
    }
    last_[id] = {now, ray, present, times};
    return now;
}

}  // namespace depth
