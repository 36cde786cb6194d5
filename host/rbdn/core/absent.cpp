// Regions that are gone, kept in mind for a while: what hid them may let them go again.
#include "absent.hpp"

#include <algorithm>
#include <cmath>

namespace rbdn {

namespace {

constexpr int kFrames = 90;          // for which a region is kept in mind
constexpr double kSpeed = 5.0;       // px a frame that it may move unseen
constexpr double kLeastReach = 24.0;  // px; at its first reappearance only a part of it is seen
constexpr double kMostReach = 120.0;

}  // namespace

void Sight::add(const Colour& colour, int x, int y) {
    ++sum.count;
    for (int k = 0; k < 3; ++k) sum.sum[k] += std::lround(colour[k]);
    x_sum += x;
    y_sum += y;
}

Vec2 Sight::middle() const {
    const double count = std::max<double>(1.0, static_cast<double>(sum.count));
    return {x_sum / count, y_sum / count};
}

void AbsentRegions::remember(std::int64_t id, const Sight& last, int frame) {
    absent_.push_back({id, last.sum.mean(), last.middle(), frame});
}

std::int64_t AbsentRegions::recognise(const Sight& seen, double same_colour, int frame) {
    auto found = absent_.end();
    double least = 2.0;
    for (auto one = absent_.begin(); one != absent_.end(); ++one) {
        const double reach = std::min(kMostReach, kLeastReach + kSpeed * (frame - one->frame));
        const double colours = std::sqrt(distance2(seen.sum.mean(), one->mean)) / same_colour;
        const double places = length(seen.middle() - one->middle) / reach;
        if (colours > 1.0 || places > 1.0 || colours + places >= least) continue;
        least = colours + places;
        found = one;
    }
    if (found == absent_.end()) return -1;
    const std::int64_t id = found->id;
    absent_.erase(found);
    return id;
}

void AbsentRegions::forget_old(int frame) {
    std::erase_if(absent_, [&](const Absent& one) { return frame - one.frame > kFrames; });
}

}  // namespace rbdn
