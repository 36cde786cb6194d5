#include "ahead.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace nav {

Meeting meet(const Window& window, const Disc& disc, const Kinds& kinds, double half_cell_cm, double reach_cm) {
    constexpr double none = std::numeric_limits<double>::infinity();
    const double square = disc.radius_cm * disc.radius_cm;
    Meeting out{none, none, none, -1, -1};
    for (std::size_t row = window.row0; row <= window.row1; ++row)
        for (std::size_t col = window.col0; col <= window.col1; ++col) {
            const float evidence = window.evidence[row * window.side + col];
            if (!(evidence >= kinds.free)) continue;
            const double x = window.centres_cm[col] - disc.x_cm, z = window.centres_cm[row] - disc.z_cm;
            const double along = x * disc.sine + z * disc.cosine;
            if (!(along > 0)) continue;
            const double aside = std::abs(x * disc.cosine - z * disc.sine);
            if (!(evidence > kinds.filled)) {
                if (!(aside < disc.radius_cm)) continue;
                out.unseen_cm = std::min(out.unseen_cm, along - half_cell_cm - disc.radius_cm);
                if (evidence >= kinds.looked)
                    out.blind_cm = std::min(out.blind_cm, along - half_cell_cm - std::sqrt(square - aside * aside));
            } else if (aside < disc.wide_cm) {
                const double lateral = std::min(std::max(aside - half_cell_cm, 0.0), disc.radius_cm);
                const double gap = along - half_cell_cm - std::sqrt(square - lateral * lateral);
                if (gap < out.room_cm)
                    out.room_cm = gap, out.row = static_cast<std::int64_t>(row), out.col = static_cast<std::int64_t>(col);
            }
        }
    if (out.row < 0) out.room_cm = reach_cm;
    out.unseen_cm = std::min(out.unseen_cm, reach_cm);
    out.blind_cm = std::min(out.blind_cm, reach_cm);
    return out;
}

float least_along(const Distances& distances, double x0, double z0, double x1, double z1, double from_cm) {
    const double length = std::hypot(x1 - x0, z1 - z0), most = std::max(length, 1e-9);
    const double begin = std::min(from_cm, length);
    const double step = begin + distances.cell_cm / 2 - begin;
    const auto count = static_cast<std::size_t>(std::ceil((length + 1e-9 - begin) / (distances.cell_cm / 2)));
    const double last = static_cast<double>(distances.side) - 1;
    float least = std::numeric_limits<float>::infinity();
    for (std::size_t k = 0; k < count; ++k) {
        const double part = (begin + static_cast<double>(k) * step) / most;
        const auto cell = [&](double from, double to) {
            const double at = std::floor((from + part * (to - from) + distances.half_cm) / distances.cell_cm);
            return static_cast<std::size_t>(std::min(std::max(at, 0.0), last));
        };
        least = std::min(least, distances.cm[cell(z0, z1) * distances.side + cell(x0, x1)]);
    }
    return least;
}

}  // namespace nav
