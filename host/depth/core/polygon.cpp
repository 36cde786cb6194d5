#include "polygon.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace depth {

namespace {

// Calls visit(from, to) for every edge of a loop.
template <class Visit>
void for_edges(const Loop& loop, Visit visit) {
    if (loop.empty()) return;
    Vec2 from = loop.back();
    for (const Vec2 to : loop) {
        visit(from, to);
        from = to;
    }
}

// Calls visit(loop, sign) with the sign that makes the outer loop's area count and the holes' be taken off.
template <class Visit>
void for_loops(const Loops& loops, Visit visit) {
    for (std::size_t k = 0; k < loops.size(); ++k) {
        const double turns = signed_area(loops[k]) >= 0 ? 1.0 : -1.0;
        visit(loops[k], k == 0 ? turns : -turns);
    }
}

// Mean of ln(1 + e) over the interval from e0 to e1, both over -1; exact to rounding for short ones too.
double mean_log(double e0, double e1) {
    const double middle = 0.5 * (e0 + e1);
    const double t = 0.5 * (e1 - e0) / (1 + middle);  // relative half length
    const double tt = t * t;
    // mean over s in [-1, 1] of ln(1 + t s); the closed form cancels where t is small
    const double spread =
        tt < 0.01 ? -tt * (1.0 / 6 + tt * (1.0 / 20 + tt * (1.0 / 42 + tt * (1.0 / 72 + tt * (1.0 / 110 + tt / 156)))))
                  : 0.5 * ((1 + t) * std::log1p(t) - (1 - t) * std::log1p(-t)) / t - 1;
    return std::log1p(middle) + spread;
}

// Square of the distance of a point from the stretch between two others.
double square_to_chord(Vec2 p, Vec2 a, Vec2 b) {
    const Vec2 chord = b - a;
    const double square = dot(chord, chord);
    const double along = square > 0 ? std::clamp(dot(p - a, chord) / square, 0.0, 1.0) : 0.0;
    const Vec2 off = p - a - along * chord;
    return dot(off, off);
}

std::size_t farthest_from(const Loop& loop, Vec2 p) {
    std::size_t best = 0;
    double most = -1.0;
    for (std::size_t k = 0; k < loop.size(); ++k) {
        const double d = dot(loop[k] - p, loop[k] - p);
        if (d > most) most = d, best = k;
    }
    return best;
}

}  // namespace

double signed_area(const Loop& loop) {
    double twice = 0.0;
    for_edges(loop, [&](Vec2 a, Vec2 b) { twice += cross(a, b); });
    return 0.5 * twice;
}

double polygon_area(const Loops& loops) {
    double area = 0.0;
    for_loops(loops, [&](const Loop& loop, double sign) { area += sign * signed_area(loop); });
    return area;
}

double loop_length(const Loop& loop) {
    double sum = 0.0;
    for_edges(loop, [&](Vec2 a, Vec2 b) { sum += length(b - a); });
    return sum;
}

double outline_length(const Loops& loops) {
    double sum = 0.0;
    for (const Loop& loop : loops) sum += loop_length(loop);
    return sum;
}

Moments polygon_moments(const Loops& loops) {
    if (loops.empty() || loops.front().empty()) return {};
    // about a point of the outline, so that little cancels
    const Vec2 origin = loops.front().front();
    double area = 0.0, x = 0.0, y = 0.0, xx = 0.0, yy = 0.0, xy = 0.0;
    for_loops(loops, [&](const Loop& loop, double sign) {
        for_edges(loop, [&](Vec2 from, Vec2 to) {
            const Vec2 a = from - origin, b = to - origin;
            const double c = sign * cross(a, b);
            area += c / 2;
            x += c * (a.x + b.x) / 6;
            y += c * (a.y + b.y) / 6;
            xx += c * (a.x * a.x + a.x * b.x + b.x * b.x) / 12;
            yy += c * (a.y * a.y + a.y * b.y + b.y * b.y) / 12;
            xy += c * (a.x * b.y + 2 * a.x * a.y + 2 * b.x * b.y + b.x * a.y) / 24;
        });
    });
    if (!(area > 0)) return {};
    const Vec2 centre = (1 / area) * Vec2{x, y};
    return {area, origin + centre, xx / area - centre.x * centre.x, yy / area - centre.y * centre.y,
            xy / area - centre.x * centre.y};
}

Loop convex_hull(const std::vector<Vec2>& points) {
    Loop sorted = points;
    std::sort(sorted.begin(), sorted.end(), [](Vec2 a, Vec2 b) { return a.x != b.x ? a.x < b.x : a.y < b.y; });
    Loop hull;
    // once along the one side, once back along the other
    const auto add = [&hull](Vec2 p, std::size_t keep) {
        while (hull.size() > keep && cross(hull.back() - hull[hull.size() - 2], p - hull.back()) <= 0) hull.pop_back();
        hull.push_back(p);
    };
    for (auto it = sorted.begin(); it != sorted.end(); ++it) add(*it, 1);
    const std::size_t half = hull.size();
    for (auto it = sorted.rbegin(); it != sorted.rend(); ++it)
        if (it != sorted.rbegin()) add(*it, half);
    if (hull.size() > 1) hull.pop_back();  // the first point again
    return hull;
}

Rectangle smallest_rectangle(const Loop& hull) {
    const std::size_t n = hull.size();
    if (n < 3) return {n == 2 ? length(hull[1] - hull[0]) : 0.0, 0.0};
    Rectangle best;
    double least = std::numeric_limits<double>::infinity();
    // one side of the rectangle lies on an edge of the hull; the points that touch the others go round with it
    std::size_t ahead = 1, across = 1, behind = 0;
    const auto after = [n](std::size_t at) { return at + 1 < n ? at + 1 : 0; };
    for (std::size_t k = 0; k < n; ++k) {
        const Vec2 edge = hull[after(k)] - hull[k];
        const double size = length(edge);
        if (!(size > 0)) continue;
        const Vec2 u = (1 / size) * edge, v{-u.y, u.x};
        const auto climb = [&](std::size_t at, Vec2 way) {
            for (std::size_t step = 0; step < n && dot(hull[after(at)] - hull[at], way) > 0; ++step) at = after(at);
            return at;
        };
        if (k == 0) behind = climb(climb(climb(1, u), v), {-u.x, -u.y});
        ahead = climb(ahead, u);
        across = climb(across, v);
        behind = climb(behind, {-u.x, -u.y});
        const Rectangle r{dot(hull[ahead] - hull[behind], u), dot(hull[across] - hull[k], v)};
        if (r.width * r.height < least) least = r.width * r.height, best = r;
    }
    return best;
}

Loop simplified(const Loop& loop, double tolerance) {
    if (loop.size() < 4) return loop;
    // two points far apart are surely kept: they part the loop in two
    const std::size_t a = farthest_from(loop, loop.front()), b = farthest_from(loop, loop[a]);
    if (a == b) return {loop.front()};
    std::vector<char> keep(loop.size(), 0);
    keep[a] = keep[b] = 1;
    std::vector<std::pair<std::size_t, std::size_t>> open{{a, b}, {b, a}};
    while (!open.empty()) {
        const auto [from, to] = open.back();
        open.pop_back();
        double most = tolerance * tolerance;
        std::size_t farthest = from;
        const auto after = [&loop](std::size_t at) { return at + 1 < loop.size() ? at + 1 : 0; };
        for (std::size_t k = after(from); k != to; k = after(k)) {
            const double d2 = square_to_chord(loop[k], loop[from], loop[to]);
            if (d2 > most) most = d2, farthest = k;
        }
        if (farthest == from) continue;
        keep[farthest] = 1;
        open.emplace_back(from, farthest);
        open.emplace_back(farthest, to);
    }
    Loop out;
    for (std::size_t k = 0; k < loop.size(); ++k)
        if (keep[k]) out.push_back(loop[k]);
    return out;
}

bool is_convex(const Loop& loop) {
    const std::size_t n = loop.size();
    if (n < 3) return false;
    double turned = 0.0, sense = 0.0;
    for (std::size_t k = 0; k < n; ++k) {
        const Vec2 in = loop[(k + 1) % n] - loop[k], out = loop[(k + 2) % n] - loop[(k + 1) % n];
        const double bend = std::atan2(cross(in, out), dot(in, out));
        if (bend * sense < 0) return false;
        if (bend != 0) sense = bend;
        turned += bend;
    }
    return std::abs(std::abs(turned) - 2 * std::numbers::pi) < 0.1;
}

double mean_of_inverse(const Loops& loops, double a, double b, double c) {
    constexpr double NO_MEAN = std::numeric_limits<double>::quiet_NaN();
    const Moments m = polygon_moments(loops);
    const double middle = a + b * m.centre.x + c * m.centre.y;
    if (!(m.area > 0) || !(middle > 0)) return NO_MEAN;
    const Vec2 slope = (1 / middle) * Vec2{b, c};  // of L over its value at the centroid
    const auto excess = [&](Vec2 p) { return dot(slope, p - m.centre); };
    double reach = 0.0;
    for (const Vec2 p : loops.front()) {
        if (!(excess(p) > -1)) return NO_MEAN;
        reach = std::max(reach, std::abs(excess(p)));
    }
    if (reach < 1e-8) return 1 / middle;  // the mean differs by reach^2
    const double steepness = length(slope);
    double integral = 0.0;
    for_loops(loops, [&](const Loop& loop, double sign) {
        for_edges(loop, [&](Vec2 from, Vec2 to) {
            const Vec2 outward{to.y - from.y, from.x - to.x};
            integral += sign * mean_log(excess(from), excess(to)) * dot(outward, slope);
        });
    });
    return integral / (steepness * steepness * m.area * middle);
}

}  // namespace depth
