#include "trials.hpp"

#include <algorithm>
#include <cmath>

namespace depth {

namespace {
constexpr std::size_t TRIALS = 40;
constexpr std::size_t POINTS = 12;     // samples of each region looked at
constexpr std::size_t FRAMES = 3;      // earlier frames looked at: those of the longest, a middle and a short way
constexpr double GATE_PX = 2.5;        // residuals beyond all cost the same
constexpr double RIVAL_RISE = 0.05;    // by which the cost must rise between two dips
constexpr double WRONG_QUANTILE = 0.9; // of the costs of all trials: that of a wrong depth
}  // namespace

std::vector<Start> best_trials(const Comparison& comparison, const Samples& samples, std::size_t regions,
                               const std::vector<char>& wanted, double nearest_cm, double farthest_cm) {
    std::vector<std::size_t> order(comparison.frames());
    for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return length(comparison.move(a).shift_cm) > length(comparison.move(b).shift_cm);
    });
    std::vector<std::size_t> chosen;
    const std::size_t use = std::min(FRAMES, order.size());
    for (std::size_t i = 0; i < use; ++i) chosen.push_back(order[i * order.size() / use]);
    std::vector<std::size_t> count(regions, 0);
    for (const Sample& s : samples.rows) ++count[static_cast<std::size_t>(s.region)];
    std::vector<std::vector<std::size_t>> looked(regions);
    std::vector<std::size_t> rank(regions, 0);
    for (std::size_t n = 0; n < samples.rows.size(); ++n) {
        const auto r = static_cast<std::size_t>(samples.rows[n].region);
        const std::size_t stride = std::max<std::size_t>(count[r] / POINTS, 1);
        if (wanted[r] && rank[r]++ % stride == 0) looked[r].push_back(n);
    }
    std::vector<double> rhos(TRIALS);
    const double ratio = std::log(farthest_cm / nearest_cm) / (TRIALS - 1);
    for (std::size_t t = 0; t < TRIALS; ++t) rhos[t] = std::exp(-ratio * static_cast<double>(t)) / nearest_cm;
    std::vector<Start> out(regions);
    std::vector<double> cost(TRIALS), sorted;
    for (std::size_t r = 0; r < regions; ++r) {
        if (looked[r].empty()) continue;
        const double each = 1 / static_cast<double>(looked[r].size() * chosen.size());
        for (std::size_t t = 0; t < TRIALS; ++t) {
            double sum = 0;
            for (const std::size_t n : looked[r])
                for (const std::size_t k : chosen) {
                    double px = 0;
                    sum += comparison.residual(n, k, rhos[t], px) ? std::min(px * px / (GATE_PX * GATE_PX), 1.0) : 1.0;
                }
            cost[t] = sum * each;
        }
        const std::size_t best = static_cast<std::size_t>(std::min_element(cost.begin(), cost.end()) - cost.begin());
        // a rival is a dip beyond a rise of the cost, seen from the best trial
        double rival = 1.0;
        for (const int way : {-1, 1}) {
            double rise = 0;
            for (auto t = static_cast<std::ptrdiff_t>(best); t >= 0 && t < static_cast<std::ptrdiff_t>(TRIALS); t += way) {
                const double c = cost[static_cast<std::size_t>(t)];
                rise = std::max(rise, c);
                if (rise - c > RIVAL_RISE) rival = std::min(rival, c - cost[best]);
            }
        }
        sorted = cost;
        const auto high = static_cast<std::size_t>(WRONG_QUANTILE * (TRIALS - 1));
        std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(high), sorted.end());
        out[r] = {rhos[best], cost[best], sorted[high] - cost[best], rival};
    }
    return out;
}

double mean_cost(const std::vector<Start>& starts, const Samples& samples) {
    double sum = 0;
    for (const Sample& s : samples.rows) sum += starts[static_cast<std::size_t>(s.region)].cost;
    return samples.rows.empty() ? 1.0 : sum / static_cast<double>(samples.rows.size());
}

}  // namespace depth
