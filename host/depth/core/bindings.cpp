// The Python face of depth: arrays in, arrays out.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "estimator.hpp"
#include "lens.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Ids = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Numbers = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Flags = nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Points = nb::ndarray<const double, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;
using Triples = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

template <class T>
nb::object to_array(const std::vector<T>& values, std::initializer_list<std::size_t> shape) {
    T* data = new T[values.size() + 1];
    std::copy(values.begin(), values.end(), data);
    nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<T*>(p); });
    return nb::cast(nb::ndarray<nb::numpy, T>(data, shape, owner));
}

// The setting of this name, as the Python configuration has it.
struct Settings {
    nb::dict values;
    double operator[](const char* name) const { return nb::cast<double>(values[name]); }
    int whole(const char* name) const { return nb::cast<int>(values[name]); }
};

depth::Config config_from(const nb::dict& values) {
    const Settings s{values};
    depth::Config c;
    c.odometry = {s["travel_sigma_cm"], s["rotation_sigma_rad"], s["rotation_sigma_share"], s["timing_sigma_s"],
                  s["tracked_sigma_cm"]};
    const double step = s["min_step_cm"], worst = s["max_relative_sigma"];
    c.area.history = s.whole("area_history");
    c.area.shape_change = s["area_shape_change"], c.area.outline_px = s["area_outline_px"];
    c.area.drift_px = s["area_drift_px"];
    c.area.own_share = s["area_own_share"];
    c.area.min_change = s["min_change"], c.area.min_step_cm = step, c.area.max_relative_sigma = worst;
    c.vertex.history = s.whole("vertex_history");
    c.vertex.noise_px = s["vertex_noise_px"], c.vertex.default_sigma_px = s["vertex_default_sigma_px"];
    c.vertex.model_share = s["vertex_model_share"];
    c.vertex.min_step_cm = step, c.vertex.max_relative_sigma = worst;
    c.outline.keyframes = static_cast<std::size_t>(s.whole("keyframes"));
    c.outline.spacing_px = s["outline_spacing_px"], c.outline.border_px = s["outline_border_px"];
    c.outline.noise_px = s["outline_noise_px"], c.outline.correlation_px = s["outline_correlation_px"];
    c.outline.model_share = s["outline_model_share"];
    c.outline.nearest_cm = s["nearest_cm"], c.outline.farthest_cm = s["farthest_cm"];
    c.outline.min_step_cm = step, c.outline.max_relative_sigma = worst;
    c.fuse.memory_share_per_cm = s["memory_share_per_cm"];
    c.fuse.min_step_cm = step, c.fuse.max_relative_sigma = worst;
    return c;
}

std::vector<depth::Vec2> points_from(const Points& p, const depth::Lens& lens) {
    std::vector<depth::Vec2> out(p.shape(0));
    for (std::size_t i = 0; i < out.size(); ++i) out[i] = lens.ideal({p(i, 0), p(i, 1)});
    return out;
}

std::vector<double> numbers_from(const Numbers& v) { return {v.data(), v.data() + v.shape(0)}; }
std::vector<std::int64_t> ids_from(const Ids& v) { return {v.data(), v.data() + v.shape(0)}; }

// The regions of a frame. Loops come one after the other: their points, their sizes, the rows of their
// regions; corners run along with the points.
std::vector<depth::RegionView> regions_from(const Ids& ids, const Numbers& area_px, const Numbers& sigma_area_px,
                                            const Flags& touches_border, const Triples& rgb, const Points& raw,
                                            const depth::Lens& lens, const Ids& corners, const Ids& loop_size,
                                            const Ids& loop_region) {
    std::vector<depth::RegionView> out(ids.shape(0));
    for (std::size_t r = 0; r < out.size(); ++r) {
        out[r].id = ids(r);
        out[r].area_px = area_px(r), out[r].sigma_area_px = sigma_area_px(r);
        out[r].touches_border = touches_border(r);
        out[r].rgb = {rgb(r, 0), rgb(r, 1), rgb(r, 2)};
    }
    std::vector<depth::Loops> drawn(out.size());
    std::size_t at = 0;
    for (std::size_t k = 0; k < loop_size.shape(0); ++k) {
        const auto r = static_cast<std::size_t>(loop_region(k));
        const auto size = static_cast<std::size_t>(loop_size(k));
        const bool outer = out[r].loops.empty();
        depth::Loop &loop = out[r].loops.emplace_back(), &image = drawn[r].emplace_back();
        for (std::size_t i = at; i < at + size; ++i) {
            image.push_back({raw(i, 0), raw(i, 1)});
            loop.push_back(lens.ideal(image.back()));
            if (outer) out[r].corners.push_back(corners(i));
        }
        at += size;
    }
    for (std::size_t r = 0; r < out.size(); ++r)
        out[r].polygon_px = drawn[r].empty() ? 0.0 : depth::polygon_area(drawn[r]);
    return out;
}

void require(bool holds, const char* what) {
    if (!holds) throw nb::value_error(what);
}

// Samples between two different regions of the frame.
void put_outline(depth::FrameView& frame, const depth::Lens& lens, const Points& px, const Points& normal,
                 const Ids& left, const Ids& right, const Numbers& length_px) {
    std::unordered_map<std::int64_t, int> row;
    for (std::size_t r = 0; r < frame.regions.size(); ++r) row[frame.regions[r].id] = static_cast<int>(r);
    const std::size_t count = px.shape(0);
    std::vector<depth::Vec2> seen(count), ideal(count);
    for (std::size_t i = 0; i < count; ++i) seen[i] = {px(i, 0), px(i, 1)};
    lens.ideal(seen.data(), count, ideal.data());
    frame.outline_px.reserve(count), frame.outline_normal.reserve(count), frame.outline_left.reserve(count);
    frame.outline_right.reserve(count), frame.outline_length_px.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
        const auto a = row.find(left(i)), b = row.find(right(i));
        if (a == row.end() || b == row.end() || a->second == b->second) continue;
        const depth::Vec2 at = ideal[i];
        frame.outline_px.push_back(at);
        frame.outline_normal.push_back(lens.ideal_normal(at, {normal(i, 0), normal(i, 1)}));
        frame.outline_left.push_back(a->second), frame.outline_right.push_back(b->second);
        frame.outline_length_px.push_back(length_px(i));
    }
}

class EstimatorCore {
  public:
    EstimatorCore(int width, int height, double fx, double fy, double cx, double cy,
                  const std::array<double, 5>& distortion, const nb::dict& config)
        : lens_(fx, fy, cx, cy, distortion), estimator_({width, height, fx, fy, cx, cy}, config_from(config)) {}

    nb::dict update(const Ids& ids, const Numbers& area_px, const Numbers& sigma_area_px, const Flags& touches_border,
                    const Triples& rgb, const Points& loops, const Ids& corners,
                    const Ids& loop_size, const Ids& loop_region, const Ids& vertex_ids, const Points& vertices,
                    const Numbers& vertex_sigma_px, const Points& outline, const Points& normals, const Ids& left,
                    const Ids& right, const Numbers& length_px, const Ids& changed, const Triples& rotation,
                    const Numbers& place) {
        const std::size_t n = ids.shape(0), drawn = loops.shape(0), seen = outline.shape(0);
        require(area_px.shape(0) == n && sigma_area_px.shape(0) == n && touches_border.shape(0) == n && rgb.shape(0) == n,
                "one area, sigma, flag and colour for each region");
        std::size_t points = 0;
        for (std::size_t k = 0; k < loop_size.shape(0); ++k) points += static_cast<std::size_t>(loop_size(k));
        require(corners.shape(0) == drawn && points == drawn &&
                    loop_region.shape(0) == loop_size.shape(0),
                "loops, their vertices and their sizes must belong together");
        require(vertices.shape(0) == vertex_ids.shape(0) && vertex_sigma_px.shape(0) == vertex_ids.shape(0),
                "one place and sigma for each vertex");
        require(normals.shape(0) == seen && left.shape(0) == seen && right.shape(0) == seen && length_px.shape(0) == seen,
                "one normal, length and pair of regions for each outline sample");
        require(rotation.shape(0) == 3 && place.shape(0) == 6, "a rotation of 3 x 3 and a place of 6 numbers");
        depth::FrameView frame;
        frame.regions = regions_from(ids, area_px, sigma_area_px, touches_border, rgb, loops, lens_, corners,
                                     loop_size, loop_region);
        for (const depth::RegionView& r : frame.regions) require(!r.loops.empty(), "a region without an outline");
        frame.vertex_ids = ids_from(vertex_ids), frame.vertex_px = points_from(vertices, lens_);
        frame.vertex_sigma_px = numbers_from(vertex_sigma_px);
        put_outline(frame, lens_, outline, normals, left, right, length_px);
        frame.changed = ids_from(changed);
        depth::Reading reading;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                reading.rotation(i, j) = rotation(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
        reading.position_cm = {place(0), place(1), place(2)};
        reading.t_s = place(3), reading.travel_sigma_cm = place(4), reading.turn_sigma_rad = place(5);
        return out(estimator_.update(frame, reading));
    }

  private:
    nb::dict out(const depth::Depths& found) const {
        const std::size_t n = found.regions.size();
        std::vector<double> estimates(9 * n), fused(2 * n), silhouette(n), slope(2 * n);
        nb::list declined, notes, methods, slanted, moving;
        for (std::size_t r = 0; r < n; ++r) {
            const depth::RegionDepth& d = found.regions[r];
            const depth::Answer* answers[] = {&d.area, &d.vertex, &d.outline.surface};
            nb::list why;
            for (std::size_t m = 0; m < 3; ++m) {
                const depth::Answer& a = *answers[m];
                double* to = &estimates[9 * r + 3 * m];
                to[0] = a.known() ? a.depth_cm : NAN, to[1] = a.sigma_cm, to[2] = a.sensitivity;
                why.append(a.declined);
            }
            declined.append(why);
            fused[2 * r] = d.fused ? d.fused->depth_cm : NAN, fused[2 * r + 1] = d.fused ? d.fused->sigma_cm : NAN;
            methods.append(d.fused ? static_cast<int>(d.fused->method) : -1);
            notes.append(d.fused ? d.fused->note : std::string());
            silhouette[r] = d.outline.surface.known() ? d.outline.silhouette_cm : NAN;
            slope[2 * r] = d.outline.slope.x, slope[2 * r + 1] = d.outline.slope.y;
            slanted.append(d.outline.slanted), moving.append(d.moving);
        }
        const std::size_t vertices = found.vertices.xyz_cm.size();
        std::vector<double> xyz;
        for (const depth::Vec3& p : found.vertices.xyz_cm) xyz.insert(xyz.end(), {p.x, p.y, p.z});
        const depth::Station& here = estimator_.path().at(estimator_.present());
        const depth::Mat3 turned = estimator_.path().rotation(estimator_.present());
        const depth::Vec3 at = estimator_.path().position_cm(estimator_.present());
        nb::dict result;
        result["estimates"] = to_array(estimates, {n, 3, 3});
        result["declined"] = declined;
        result["fused"] = to_array(fused, {n, 2});
        result["methods"] = methods, result["notes"] = notes;
        result["silhouette_cm"] = to_array(silhouette, {n});
        result["slope"] = to_array(slope, {n, 2});
        result["slanted"] = slanted, result["moving"] = moving;
        result["xyz_cm"] = to_array(xyz, {vertices, 3});
        result["vertex_sigma_cm"] = to_array(found.vertices.sigma_cm, {vertices});
        result["vertex_sensitivity"] = to_array(found.vertices.sensitivity, {vertices});
        result["motion"] = nb::make_tuple(here.pitch_rad, here.yaw_rad, here.travel_cm);
        std::vector<double> since;
        for (const depth::Correction& c : estimator_.corrections())
            since.insert(since.end(), {c.since_s, c.yaw_rad, c.yaw_sigma_rad, c.travel_cm,
                                       c.travel_sigma_cm});
        result["since"] = to_array(since, {since.size() / 5, 5});
        result["rotation"] = to_array(std::vector<double>(turned.m.begin(), turned.m.end()), {3, 3});
        result["position_cm"] = to_array(std::vector<double>{at.x, at.y, at.z}, {3});
        return result;
    }

    depth::Lens lens_;
    depth::Estimator estimator_;
};

}  // namespace

NB_MODULE(_depth, m) {
    nb::class_<EstimatorCore>(m, "Estimator")
        .def(nb::init<int, int, double, double, double, double, const std::array<double, 5>&, const nb::dict&>(),
             "width"_a, "height"_a, "fx"_a, "fy"_a, "cx"_a, "cy"_a, "distortion"_a, "config"_a)
        .def("update", &EstimatorCore::update, "ids"_a, "area_px"_a, "sigma_area_px"_a, "touches_border"_a, "rgb"_a,
             "loops"_a, "corners"_a, "loop_size"_a, "loop_region"_a, "vertex_ids"_a, "vertices"_a,
             "vertex_sigma_px"_a, "outline"_a, "normals"_a, "left"_a, "right"_a, "length_px"_a, "changed"_a,
             "rotation"_a, "place"_a);
}
