#include "edges.hpp"

#include <algorithm>
#include <cmath>

namespace nav {

namespace {

constexpr std::size_t EVENED = 5;      // columns: feet are told in steps of rows, which are evened out
constexpr std::size_t LEAST_FEET = 5;  // that make an edge
constexpr double LEVEL = 0.06;         // an edge whose feet differ by a smaller part is as good as level
constexpr double JUMP = 0.03;          // of the slope beside a sliver of the outline that is another thing's
constexpr double JOINED = 0.8;         // share of the feet that must be one piece between such jumps
constexpr double UPRIGHT = 0.75;       // of its middle's height that an upright thing has at its ends; a ball has half
constexpr double POINT = 0.2;          // and a ball at least so much
constexpr std::size_t LEAST_ROUND = 8; // columns that tell a ball
constexpr double SEEN_WHOLE = 0.8;     // share of its columns in which its own foot is seen
constexpr double RISES = 0.9;          // a ball's feet at its ends, as part of those in its middle half
constexpr double HALF_UPRIGHT = 0.55;  // a ball with one end in sight has less of its height there,
constexpr double SLENDER = 3.0;        // and it is no more than so many times as tall as what is seen of it is wide
constexpr double BEFORE = 1.02;        // what stands beside it and is nearer by so much hides its other end

}  // namespace

double mean(std::span<const double> values) {
    double sum = 0;
    for (const double v : values) sum += v;
    return sum / static_cast<double>(values.size());
}

std::optional<Line> straight(std::span<const std::int64_t> columns, std::span<const double> slopes, double rms) {
    const auto n = static_cast<double>(columns.size());
    double middle = 0;
    for (const std::int64_t c : columns) middle += static_cast<double>(c);
    middle /= n;
    const double level = mean(slopes);
    double spread = 0, along = 0, about = 0;
    for (std::size_t k = 0; k < columns.size(); ++k) {
        const double away = static_cast<double>(columns[k]) - middle, off = slopes[k] - level;
        spread += away * away, along += away * off, about += off * off;
    }
    const double rise = along / spread;
    if (!(std::sqrt(std::max(0.0, about - rise * along) / n) < rms)) return std::nullopt;
    return Line{level - rise * middle, rise};
}

std::vector<double> own_slopes(const Shape& shape) {
    std::vector<double> out;
    for (const std::int64_t c : shape.feet) out.push_back(shape.slopes[static_cast<std::size_t>(c)]);
    return out;
}

namespace {

std::vector<double> evened(std::span<const double> slopes) {
    if (slopes.size() < 2 * EVENED) return {slopes.begin(), slopes.end()};
    std::vector<double> out(slopes.size() - EVENED + 1);
    for (std::size_t k = 0; k < out.size(); ++k) out[k] = mean(slopes.subspan(k, EVENED));
    return out;
}

double height(const Shape& shape, std::int64_t column) {
    const std::uint16_t* pixel = shape.labels + static_cast<std::size_t>(column) * shape.rows;
    return static_cast<double>(std::count(pixel, pixel + shape.rows, shape.kind));
}

bool is_upright(const Shape& shape, std::span<const std::int64_t> feet) {
    const std::size_t end = feet.size() < 2 * EVENED ? 0 : 1;  // of many the last one may be half of one
    const double least = std::min(height(shape, feet[end]), height(shape, feet[feet.size() - 1 - end]));
    const double most = std::max(height(shape, feet[feet.size() / 2]),
                                 height(shape, shape.covered[shape.covered.size() / 2]));
    return least >= UPRIGHT * most;
}

// A ball of which one end alone is in sight, for something before it or the border hides the other: its foot is in
// its own shade and rises to the end in sight, as the far end of a slanted front's does, but no front is so low there.
bool is_half_a_ball(const Shape& shape, const std::vector<double>& slopes) {
    const std::span<const std::int64_t> covered = shape.covered;
    if (slopes.size() < LEAST_FEET || covered.size() < LEAST_ROUND) return false;
    const auto in_sight = [&](std::int64_t beside, double foot) {
        return beside >= 0 && beside < static_cast<std::int64_t>(shape.slopes.size()) &&
               !(shape.slopes[static_cast<std::size_t>(beside)] > BEFORE * foot);
    };
    const bool left = in_sight(covered.front() - 1, slopes.front());
    const bool right = in_sight(covered.back() + 1, slopes.back());
    if (left == right) return false;

    double tallest = 0;
    for (const std::int64_t c : covered) {
        if (shape.labels[(static_cast<std::size_t>(c) + 1) * shape.rows - 1] == shape.kind) return false;
        tallest = std::max(tallest, height(shape, c));
    }
    const double end = height(shape, left ? covered[1] : covered[covered.size() - 2]);
    if (!(end > POINT * tallest && end < HALF_UPRIGHT * tallest)) return false;
    if (tallest > SLENDER * static_cast<double>(covered.size())) return false;

    const std::span<const double> all(slopes);
    std::vector<double> ordered(slopes);
    std::sort(ordered.begin(), ordered.end());
    const double nearest = mean(std::span(ordered).last(std::max<std::size_t>(1, ordered.size() / 4)));
    return mean(left ? all.first(2) : all.last(2)) < RISES * nearest;
}

}  // namespace

std::optional<std::vector<double>> along_edges(const Shape& shape, double rms) {
    const std::vector<double> all = own_slopes(shape);
    if (is_half_a_ball(shape, all)) return std::nullopt;
    std::size_t begin = 0, count = 0;  // the longest piece without a jump
    for (std::size_t first = 0, k = 1; k <= all.size(); ++k) {
        if (k < all.size() && std::abs(all[k] - all[k - 1]) <= JUMP) continue;
        if (k - first > count) begin = first, count = k - first;
        first = k;
    }
    if (count < LEAST_FEET || static_cast<double>(count) < JOINED * static_cast<double>(all.size())) return std::nullopt;
    const std::span<const std::int64_t> feet = shape.feet.subspan(begin, count);
    const std::span<const double> slopes = std::span(all).subspan(begin, count);
    const std::vector<double> even = evened(slopes);
    const auto [low, high] = std::minmax_element(even.begin(), even.end());
    const double flattest = *low, steepest = *high;
    if (flattest > (1 - LEVEL) * steepest || shape.covered.empty() || !is_upright(shape, feet)) return std::nullopt;

    std::optional<Line> left = straight(feet, slopes, rms), right = left;
    bool towards = true;  // the corner, if there is one
    if (!left) {
        if (count <= 2 * EVENED) return std::nullopt;
        std::size_t farthest = 0;  // from the straight line between the ends
        double most = 0;
        for (std::size_t k = 0; k < even.size(); ++k) {
            const double part = static_cast<double>(k) / static_cast<double>(even.size() - 1);
            const double off = even[k] - (even.front() + part * (even.back() - even.front()));
            if (std::abs(off) > std::abs(most)) farthest = k, most = off;
        }
        const std::size_t corner = farthest + EVENED / 2;
        if (corner < EVENED || corner >= count - EVENED) return std::nullopt;
        towards = most > 0;
        left = straight(feet.first(corner + 1), slopes.first(corner + 1), rms);
        right = straight(feet.subspan(corner), slopes.subspan(corner), rms);
        if (!left || !right) return std::nullopt;
    }
    std::vector<double> out;
    for (const std::int64_t c : shape.covered) {
        const double a = left->at(static_cast<double>(c)), b = right->at(static_cast<double>(c));
        const double slope = std::max(towards ? std::min(a, b) : std::max(a, b), flattest);
        out.push_back(shape.cut[c] ? slope : std::min(slope, steepest));
    }
    if (count < all.size())  // a sliver that is nearer stays where it is
        for (std::size_t k = 0; k < all.size(); ++k) {
            const auto at = std::lower_bound(shape.covered.begin(), shape.covered.end(), shape.feet[k]);
            if (at == shape.covered.end() || *at != shape.feet[k]) continue;
            double& slope = out[static_cast<std::size_t>(at - shape.covered.begin())];
            slope = std::max(slope, all[k]);
        }
    return out;
}

bool tapers(const Shape& shape) {
    const std::size_t n = shape.feet.size();
    const std::vector<double> slopes = own_slopes(shape);
    if (is_half_a_ball(shape, slopes)) return true;
    if (n < LEAST_ROUND || shape.covered.size() < n || static_cast<double>(n) < SEEN_WHOLE * static_cast<double>(shape.covered.size())) return false;
    if (shape.covered.front() == 0 || shape.covered.back() + 1 == static_cast<std::int64_t>(shape.slopes.size())) return false;
    const std::span<const double> all(slopes);
    if (std::max(mean(all.first(2)), mean(all.last(2))) > RISES * mean(all.subspan(n / 4, n - 2 * (n / 4)))) return false;
    const std::span<const std::int64_t> covered = shape.covered;
    const double left = height(shape, covered[1]), right = height(shape, covered[covered.size() - 2]);
    const double middle = height(shape, covered[covered.size() / 2]);
    return std::min(left, right) > POINT * middle && std::max(left, right) < UPRIGHT * middle;
}

}  // namespace nav
