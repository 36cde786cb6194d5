// Trial depths of a region: where to start, and how clear the answer is.
#pragma once

#include <vector>

#include "comparison.hpp"
#include "samples.hpp"

namespace depth {

struct Start {
    double rho = 0.0;       // 1/cm
    double cost = 1.0;      // mean truncated cost there, 0..1
    double contrast = 0.0;  // cost of a wrong depth above that of the best, 0..1
    double rival = 0.0;     // cost of the next best that is apart from it, above the best; 1 without one
};

// Tries depths between `nearest_cm` and `farthest_cm`, evenly in their logarithm, on a few samples of the
// regions that are `wanted`, against a few of the earlier frames.
std::vector<Start> best_trials(const Comparison& comparison, const Samples& samples, std::size_t regions,
                               const std::vector<char>& wanted, double nearest_cm, double farthest_cm);

// Mean cost of the best depths of all regions that were looked for, 0..1.
double mean_cost(const std::vector<Start>& starts, const Samples& samples);

}  // namespace depth
