#include "track.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "stance.hpp"

namespace nav {

namespace {

constexpr double OVER_S = 0.7;   // a velocity across the view is that over so long
constexpr double ALONG_S = 1.5;  // and one along it, where feet are known less well
constexpr double LEAST_S = 0.3;
constexpr std::size_t LEAST_SIGHTINGS = 5;
constexpr double MOST = 0.8;           // of the sights must show an edge that tells something
constexpr double FASTEST_CM_S = 40.0;  // what is faster are regions that merge or split
constexpr double ASIDE_CM_S = 6.0;     // across the view what stands still never wanders as fast
constexpr double ASIDE_SHARE = 0.06;   // nor by more than this part of its distance in a second
constexpr double ALONG_CM_S = 8.0;
constexpr double ALONG_SIGMAS = 2.5;  // along it, it must have gone farther than a foot may be off
constexpr double SURE_SIGMAS = 4.0;
constexpr double STRAY_CM = 1.5;      // rms of the places about an even motion across the view
constexpr double STRAY_SHARE = 0.06;  // and along it, of the distance
constexpr double UNLIKE = 0.35;       // both edges go as fast, but for this part
constexpr double ONE_EDGE_CM = 7.0;   // of something of which one edge alone is seen, that must go as far
constexpr double ONE_EDGE_SHARE = 0.08;  // and this part of its distance
constexpr double FARTHEST_FOOT_CM = 220.0;
constexpr double WIDEST_CM = 60.0;  // what is wider is furniture
constexpr double HIDES = 0.96;      // what is nearer than this part of its distance hides a part of a thing
constexpr std::size_t LEAST_FEET_SEEN = 3;
constexpr double NEAR_FEET = 0.9;  // lie behind its nearest one
constexpr double STILL_CM = 2.5;   // who goes no farther across the view in ALONG_S stands
constexpr double STILL_SHARE = 0.9;  // of that time at least it was seen

struct Sight {
    double t_s;
    FloorPoint at;
};
using Way = std::vector<Sight>;
using End = std::optional<FloorPoint> FootSight::*;

double along(const FloorPoint& p, const FloorPoint& ray) { return p.x_cm * ray.x_cm + p.z_cm * ray.z_cm; }
// To the right of it.
double aside(const FloorPoint& p, const FloorPoint& ray) { return p.x_cm * ray.z_cm - p.z_cm * ray.x_cm; }

// Where one end of the foot was seen of late; none where it mostly was not.
Way way_of(const std::deque<FootSight>& seen, End end, double over_s) {
    Way way;
    std::size_t count = 0;
    for (const FootSight& one : seen) {
        if (!(seen.back().t_s - one.t_s <= over_s)) continue;
        ++count;
        if (one.*end) way.push_back({one.t_s, *(one.*end)});
    }
    if (!(static_cast<double>(way.size()) > MOST * static_cast<double>(count))) way.clear();
    return way;
}

// Whether one edge alone has gone farther across the view than edges of walls seen in part wander.
bool goes_far(const Way& way, const FootSight& last) {
    const FloorPoint gone{way.back().at.x_cm - way.front().at.x_cm, way.back().at.z_cm - way.front().at.z_cm};
    return std::abs(aside(gone, last.ray)) > std::max(ONE_EDGE_CM, ONE_EDGE_SHARE * last.depth_cm);
}

// Velocity of places that go evenly across the view, or else along it, by least squares; none where it is not even,
// or too slow to be no error.
std::optional<FloorPoint> even_motion(const Way& way, const FootSight& last, bool across) {
    const double lasts_s = way.back().t_s - way.front().t_s;
    if (lasts_s < (across ? LEAST_S : ALONG_S / 2)) return std::nullopt;
    const auto count = static_cast<double>(way.size());
    Sight middle{0, {0, 0}};
    for (const Sight& p : way) middle.t_s += p.t_s, middle.at.x_cm += p.at.x_cm, middle.at.z_cm += p.at.z_cm;
    middle = {middle.t_s / count, {middle.at.x_cm / count, middle.at.z_cm / count}};
    const auto off = [&](const Sight& p) { return FloorPoint{p.at.x_cm - middle.at.x_cm, p.at.z_cm - middle.at.z_cm}; };

    double lever2 = 0, along_cm_s = 0, aside_cm_s = 0, stray_along = 0, stray_aside = 0;
    for (const Sight& p : way) {
        const double t = p.t_s - middle.t_s;
        lever2 += t * t, along_cm_s += t * along(off(p), last.ray), aside_cm_s += t * aside(off(p), last.ray);
    }
    along_cm_s /= lever2, aside_cm_s /= lever2;
    for (const Sight& p : way) {
        const double t = p.t_s - middle.t_s;
        const double a = along(off(p), last.ray) - t * along_cm_s, b = aside(off(p), last.ray) - t * aside_cm_s;
        stray_along += a * a, stray_aside += b * b;
    }
    stray_along = std::sqrt(stray_along / count), stray_aside = std::sqrt(stray_aside / count);

    if (stray_aside > STRAY_CM || stray_along > STRAY_SHARE * last.depth_cm) return std::nullopt;
    const double sure = SURE_SIGMAS / std::sqrt(lever2);
    const double least = across ? std::max(ASIDE_CM_S, ASIDE_SHARE * last.depth_cm)
                                : std::max(ALONG_CM_S, ALONG_SIGMAS * last.sigma_cm / lasts_s);
    if (!(std::abs(across ? aside_cm_s : along_cm_s) > std::max(least, sure * (across ? stray_aside : stray_along))))
        return std::nullopt;
    const FloorPoint& ray = last.ray;
    return FloorPoint{along_cm_s * ray.x_cm + aside_cm_s * ray.z_cm, along_cm_s * ray.z_cm - aside_cm_s * ray.x_cm};
}

// Across the view or along it, by both ends of the foot.
std::optional<FloorPoint> velocity_of(const std::deque<FootSight>& seen, bool known, bool across) {
    const FootSight& last = seen.back();
    std::vector<Way> ways;
    for (const End end : {&FootSight::left, &FootSight::right}) {
        Way way = way_of(seen, end, across ? OVER_S : ALONG_S);
        if (way.size() >= LEAST_SIGHTINGS) ways.push_back(std::move(way));
    }
    if (ways.empty() || (ways.size() == 1 && !known && !(across && goes_far(ways.front(), last)))) return std::nullopt;
    FloorPoint mean{0, 0}, first{0, 0}, unlike{0, 0};
    const auto count = static_cast<double>(ways.size());
    for (std::size_t k = 0; k < ways.size(); ++k) {
        const std::optional<FloorPoint> one = even_motion(ways[k], last, across);
        if (!one) return std::nullopt;
        mean.x_cm += one->x_cm, mean.z_cm += one->z_cm;
        if (k == 0) first = *one;
        unlike = {one->x_cm - first.x_cm, one->z_cm - first.z_cm};
    }
    mean = {mean.x_cm / count, mean.z_cm / count};
    const double speed = std::hypot(mean.x_cm, mean.z_cm);
    if (speed > FASTEST_CM_S || std::hypot(unlike.x_cm, unlike.z_cm) > UNLIKE * speed) return std::nullopt;
    return mean;
}

double spread(const Way& way, const FloorPoint& ray, double (*of)(const FloorPoint&, const FloorPoint&)) {
    double low = INFINITY, high = -INFINITY;
    for (const Sight& p : way) low = std::min(low, of(p.at, ray)), high = std::max(high, of(p.at, ray));
    return high - low;
}

}  // namespace

std::optional<FootSight> sight_of(const SeenFeet& feet, std::int64_t region, double cut_part, double sigma_ray,
                                  double t_s) {
    const auto columns = static_cast<std::ptrdiff_t>(feet.owners.size());
    std::vector<double> slopes;
    std::ptrdiff_t left = 0, right = 0;
    std::size_t all = 0;
    for (std::ptrdiff_t c = 0; c < columns; ++c) {
        if (feet.owners[static_cast<std::size_t>(c)] != region) continue;
        ++all;
        if (feet.cut[c]) continue;
        if (slopes.empty()) left = c;
        right = c;
        slopes.push_back(feet.slopes[c]);
    }
    const auto seen = static_cast<double>(slopes.size());
    if (slopes.size() < LEAST_FEET_SEEN || seen < (1 - cut_part) * static_cast<double>(all)) return std::nullopt;
    const double depth = feet.height_cm / quantile(slopes, NEAR_FEET);
    const double width = (feet.across[right] - feet.across[left]) * depth;
    if (depth > FARTHEST_FOOT_CM || width > WIDEST_CM) return std::nullopt;

    const auto point = [&](std::ptrdiff_t column, double far_cm) {
        const double side = feet.across[column] * far_cm;
        return FloorPoint{feet.eye.x_cm + far_cm * feet.ahead.x_cm + side * feet.ahead.z_cm,
                     feet.eye.z_cm + far_cm * feet.ahead.z_cm - side * feet.ahead.x_cm};
    };
    const FloorPoint front = point((left + right) / 2, depth);
    const FloorPoint to{front.x_cm - feet.eye.x_cm, front.z_cm - feet.eye.z_cm};
    const double away = std::hypot(to.x_cm, to.z_cm);
    const FloorPoint ray{to.x_cm / away, to.z_cm / away};
    const double far = depth * (1 + width / depth / 2), half = width / 2;  // the edges of something round are far
    const auto end = [&](std::ptrdiff_t edge, std::ptrdiff_t beyond) -> std::optional<FloorPoint> {
        if (edge == 0 || edge == columns - 1 || beyond < 0 || beyond >= columns) return std::nullopt;
        if (feet.cut[beyond]) return std::nullopt;
        if (feet.depth_cm[beyond] < HIDES * depth && feet.owners[static_cast<std::size_t>(beyond)] != region)
            return std::nullopt;
        const FloorPoint at = point(edge, far);
        return FloorPoint{at.x_cm - half * ray.x_cm, at.z_cm - half * ray.z_cm};
    };
    const double sigma = sigma_ray * depth * depth / feet.height_cm;
    const FootSight out{t_s, end(left, left - 2), end(right, right + 2), depth, sigma, ray};
    if (!out.left && !out.right) return std::nullopt;
    return out;
}

void Track::see(const FootSight& now) {
    seen_.push_back(now);
    while (now.t_s - seen_.front().t_s > ALONG_S) seen_.pop_front();
}

std::optional<FloorPoint> Track::velocity(bool known) const {
    if (const auto found = velocity_of(seen_, known, true)) return found;
    return velocity_of(seen_, known, false);
}

bool Track::stands() const {
    const FootSight& last = seen_.back();
    if (last.t_s - seen_.front().t_s < STILL_SHARE * ALONG_S) return false;
    for (const End end : {&FootSight::left, &FootSight::right}) {
        const Way way = way_of(seen_, end, ALONG_S);
        if (!way.empty() && spread(way, last.ray, aside) < STILL_CM &&
            spread(way, last.ray, along) < ALONG_SIGMAS * last.sigma_cm)
            return true;
    }
    return false;
}

}  // namespace nav
