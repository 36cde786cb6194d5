#include "track.hpp"

#include <algorithm>
#include <cmath>

namespace nav {

namespace {

double square(double v) { return v * v; }

}  // namespace

EvenMotion even_motion(const std::vector<Sight>& places, const Ray& ray) {
    const auto count = static_cast<double>(places.size());
    Sight sum{0, 0, 0};
    for (const Sight& p : places) sum.t_s += p.t_s, sum.x_cm += p.x_cm, sum.z_cm += p.z_cm;
    const Sight middle{sum.t_s / count, sum.x_cm / count, sum.z_cm / count};
    const auto along = [&](const Sight& p) { return (p.x_cm - middle.x_cm) * ray.x + (p.z_cm - middle.z_cm) * ray.z; };
    const auto aside = [&](const Sight& p) { return (p.x_cm - middle.x_cm) * ray.z - (p.z_cm - middle.z_cm) * ray.x; };

    EvenMotion out{};
    for (const Sight& p : places) {
        const double t = p.t_s - middle.t_s;
        out.lever2_s2 += t * t;
        out.along_cm_s += t * along(p);
        out.aside_cm_s += t * aside(p);
    }
    out.along_cm_s /= out.lever2_s2;
    out.aside_cm_s /= out.lever2_s2;
    for (const Sight& p : places) {
        const double t = p.t_s - middle.t_s;
        out.stray_along_cm += square(along(p) - t * out.along_cm_s);
        out.stray_aside_cm += square(aside(p) - t * out.aside_cm_s);
    }
    out.stray_along_cm = std::sqrt(out.stray_along_cm / count);
    out.stray_aside_cm = std::sqrt(out.stray_aside_cm / count);
    return out;
}

Extent extent(const std::vector<Sight>& places, const Ray& ray) {
    const auto range = [&](auto way) {
        const auto [low, high] = std::minmax_element(places.begin(), places.end(),
                                                     [&](const Sight& a, const Sight& b) { return way(a) < way(b); });
        return way(*high) - way(*low);
    };
    return {range([&](const Sight& p) { return p.x_cm * ray.z - p.z_cm * ray.x; }),
            range([&](const Sight& p) { return p.x_cm * ray.x + p.z_cm * ray.z; })};
}

}  // namespace nav
