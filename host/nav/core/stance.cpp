#include "stance.hpp"

#include <algorithm>
#include <cmath>

namespace nav {

namespace {

constexpr double WALL_CM = 70.0;    // what is wider has a front as its feet have it, what is narrower a flat one
constexpr double STRAIGHT = 0.006;  // rms of a straight wall's feet about their line: 2 px at 280 px focal length
constexpr double TOUCHING = 1.05;   // columns whose foot is nearer than this times the nearest foot touch the floor
constexpr double HANGING = 0.65;    // whose outer feet are flatter than this part of its nearest one hangs over there
constexpr double OUTER = 0.1;       // of its columns, on either side
constexpr std::size_t OVER_COLUMNS = 5;  // feet are evened out,
constexpr std::size_t EVENED_FROM = 15;  // of so many columns and more
constexpr std::size_t LEAST_RUN = 3;     // columns
constexpr double NEAR_PART = 0.9;        // of the feet lie behind the nearest

double width_cm(const Across& across, std::span<const std::int64_t> columns, double depth_cm) {
    const auto ray = [&](std::int64_t column) { return across.rays[static_cast<std::size_t>(column)]; };
    return (ray(columns.back()) - ray(columns.front())) * depth_cm;
}

// Whether most of it is a wall, and something before it has its colour, so that the net made them one.
//
// What hangs over at the sides, as a ball does, has no straight foot there.
bool has_wall_behind(const Shape& shape, const std::vector<double>& slopes, const Across& across, double nearest) {
    std::vector<std::int64_t> columns;  // of one run of far feet without a gap
    std::vector<double> run;
    const auto is_wall = [&] {
        return run.size() >= LEAST_RUN && width_cm(across, columns, across.height_cm / mean(run)) > WALL_CM &&
               straight(columns, run, STRAIGHT);
    };
    for (std::size_t k = 0; k < slopes.size(); ++k) {
        if (!(slopes[k] < HANGING * nearest)) continue;
        if (!columns.empty() && shape.feet[k] - columns.back() > 1) {
            if (is_wall()) return true;
            columns.clear(), run.clear();
        }
        columns.push_back(shape.feet[k]), run.push_back(slopes[k]);
    }
    return is_wall();
}

}  // namespace

double quantile(std::vector<double>& values, double part) {
    std::sort(values.begin(), values.end());
    const double place = part * static_cast<double>(values.size() - 1);
    const auto k = static_cast<std::size_t>(place);
    const double low = values[k], high = values[std::min(k + 1, values.size() - 1)];
    return low + (place - static_cast<double>(k)) * (high - low);
}

double nearest_slope(std::vector<double> slopes) {
    if (slopes.size() >= EVENED_FROM) {
        for (std::size_t k = 0; k + OVER_COLUMNS <= slopes.size(); ++k)
            slopes[k] = mean(std::span(slopes).subspan(k, OVER_COLUMNS));
        slopes.resize(slopes.size() - OVER_COLUMNS + 1);
    }
    return quantile(slopes, NEAR_PART);
}

bool hangs_over(const Shape& shape, double nearest) {
    const std::vector<double> slopes = own_slopes(shape);
    const auto outer = static_cast<std::size_t>(std::nearbyint(OUTER * static_cast<double>(slopes.size())));
    const std::span<const double> all(slopes);
    const std::size_t count = std::max<std::size_t>(1, outer);
    double flat = 0.0;  // the less flat end that is in the picture
    if (shape.covered.front() > 0) flat = mean(all.first(count));
    if (shape.covered.back() + 1 < static_cast<std::int64_t>(shape.slopes.size()))
        flat = std::max(flat, mean(all.last(count)));
    return flat > 0.0 && flat < HANGING * nearest;
}

bool is_straight_wall(const Shape& shape, const Across& across) {
    std::vector<double> slopes = own_slopes(shape);
    if (!straight(shape.feet, slopes, STRAIGHT)) return false;
    return width_cm(across, shape.covered, across.height_cm / quantile(slopes, NEAR_PART)) > WALL_CM;
}

Stance stance_of(const Shape& shape, const Across& across, double rms) {
    const std::vector<double> slopes = own_slopes(shape);
    Stance out;
    out.nearest = nearest_slope(slopes);
    out.mean = mean(slopes);
    out.is_wall = width_cm(across, shape.covered, across.height_cm / out.nearest) > WALL_CM ||
                  has_wall_behind(shape, slopes, across, out.nearest);
    if (out.is_wall) {
        out.line = straight(shape.feet, slopes, STRAIGHT);
        return out;
    }
    out.edges = along_edges(shape, rms);
    if (out.edges) {
        double sum = 0;
        for (const double slope : *out.edges) sum += 1 / slope;
        out.mean = static_cast<double>(out.edges->size()) / sum;
        return out;
    }
    out.hangs = hangs_over(shape, out.nearest) || tapers(shape);
    const auto touch = std::count_if(slopes.begin(), slopes.end(),
                                     [&](double slope) { return slope > out.nearest / TOUCHING; });
    out.touching = static_cast<double>(touch) / static_cast<double>(shape.covered.size());
    return out;
}

}  // namespace nav
