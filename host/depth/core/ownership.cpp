#include "ownership.hpp"

#include <algorithm>
#include <cmath>

namespace depth {

namespace {
constexpr double CLEARLY_BETTER = 0.12;  // difference of mean cost (0..1) that decides who explains something
constexpr double SAME_DEPTH = 0.03;      // relative; nearer than this two regions tie
constexpr double SURROUND_RATIO = 3.5;   // of whose outline the edge is so much more, that one is surrounded
constexpr double MIN_REST_PX = 15.0;     // of outline elsewhere, to judge a region by it
}  // namespace

std::vector<std::array<bool, 2>> edge_owners(const std::vector<Boundary>& boundaries,
                                             const std::vector<std::array<double, 2>>& cost,
                                             const std::vector<std::array<double, 2>>& rho,
                                             const std::vector<Extent>& extents) {
    const std::size_t n = extents.size();
    std::vector<double> sunk(n, 0.0), length(n, 0.0);
    for (std::size_t b = 0; b < boundaries.size(); ++b)
        for (std::size_t side = 0; side < 2; ++side) {
            const auto r = static_cast<std::size_t>(side == 0 ? boundaries[b].left : boundaries[b].right);
            sunk[r] += boundaries[b].length_px * cost[b][side], length[r] += boundaries[b].length_px;
        }
    std::vector<std::array<bool, 2>> mine(boundaries.size(), {true, true});
    for (std::size_t b = 0; b < boundaries.size(); ++b) {
        const std::array<std::size_t, 2> region{static_cast<std::size_t>(boundaries[b].left),
                                                static_cast<std::size_t>(boundaries[b].right)};
        std::array<double, 2> rest, rest_px, share;
        for (std::size_t side = 0; side < 2; ++side) {
            const std::size_t r = region[side];
            rest_px[side] = length[r] - boundaries[b].length_px;
            rest[side] = (sunk[r] - boundaries[b].length_px * cost[b][side]) / std::max(rest_px[side], 1e-9);
            share[side] = boundaries[b].length_px / std::max(extents[r].outline_px, 1.0);
        }
        const bool judged = rest_px[0] > MIN_REST_PX && rest_px[1] > MIN_REST_PX;
        for (std::size_t side = 0; side < 2; ++side) {
            const std::size_t other = 1 - side;
            if (!(rho[b][other] > 0)) continue;
            const double worse = cost[b][side] - cost[b][other];
            const double misfit = judged ? rest[side] - rest[other] : 0.0;
            const double relative = rho[b][side] / std::max(rho[b][other], 1e-12);
            const bool farther = relative < 1 - SAME_DEPTH, tie = std::abs(relative - 1) <= SAME_DEPTH;
            const bool around = share[other] > SURROUND_RATIO * share[side];
            const bool inside = share[side] > SURROUND_RATIO * share[other];
            const bool behind =
                around || (extents[region[side]].touches_border && !extents[region[other]].touches_border);
            const bool by_place = (farther && !inside) || around || (tie && behind);
            const bool undecided = std::abs(worse) <= CLEARLY_BETTER;
            if (worse > CLEARLY_BETTER ||
                (undecided && (misfit > CLEARLY_BETTER || (by_place && misfit >= -CLEARLY_BETTER))))
                mine[b][side] = false;
        }
    }
    return mine;
}

std::vector<double> own_rows(const Samples& samples, const std::vector<double>& row_cost,
                             const std::vector<RegionState>& state, const std::vector<Extent>& extents) {
    const std::size_t count = samples.boundaries.size();
    std::vector<std::array<double, 2>> cost(count, {0, 0}), rho(count, {0, 0}), rows(count, {0, 0});
    for (std::size_t n = 0; n < samples.rows.size(); ++n) {
        const Sample& s = samples.rows[n];
        const auto b = static_cast<std::size_t>(s.pair), side = static_cast<std::size_t>(s.side);
        cost[b][side] += row_cost[n], rows[b][side] += 1;
        rho[b][side] += state[static_cast<std::size_t>(s.region)].at(s.offset);
    }
    for (std::size_t b = 0; b < count; ++b)
        for (std::size_t side = 0; side < 2; ++side) {
            const double some = std::max(rows[b][side], 1.0);
            cost[b][side] /= some, rho[b][side] /= some;
        }
    const std::vector<std::array<bool, 2>> mine = edge_owners(samples.boundaries, cost, rho, extents);
    std::vector<double> out;
    out.reserve(samples.rows.size());
    for (const Sample& s : samples.rows)
        out.push_back(mine[static_cast<std::size_t>(s.pair)][static_cast<std::size_t>(s.side)] ? 1.0 : 0.0);
    return out;
}

}  // namespace depth
