// The Python face of the net: arrays in, arrays out.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <numeric>

#include "loops.hpp"
#include "refine.hpp"
#include "steps.hpp"
#include "tracker.hpp"
#include "turn.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using ByteImage = nb::ndarray<const std::uint8_t, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;
using IdArray = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using PointArray = nb::ndarray<const double, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;
using NodeArray = nb::ndarray<const float, nb::shape<-1, -1, 2>, nb::c_contig, nb::device::cpu>;
using IntArray = nb::ndarray<const std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

template <class T>
nb::object to_array(const std::vector<T>& values, std::initializer_list<std::size_t> shape) {
    T* data = new T[values.size() + 1];
    std::copy(values.begin(), values.end(), data);
    nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<T*>(p); });
    return nb::cast(nb::ndarray<nb::numpy, T>(data, shape, owner));
}

template <class T>
nb::object to_array(const std::vector<T>& values) {
    return to_array(values, {values.size()});
}

double now_ms() {
    const auto t = std::chrono::steady_clock::now().time_since_epoch();
    return std::chrono::duration<double, std::milli>(t).count();
}

class NetCore {
public:
    explicit NetCore(const rbdn::Config& config) : tracker_(config) {}

    void track(const ByteImage& bgr, const IntArray& source) {
        const auto height = static_cast<int>(bgr.shape(0)), width = static_cast<int>(bgr.shape(1));
        nb::gil_scoped_release release;
        tracker_.track(bgr.data(), width, height, {source.data(), source.shape(0)});
    }

    void displace(const IdArray& regions, const PointArray& by_px) {
        std::vector<rbdn::Displacement> displacements;
        for (std::size_t k = 0; k < regions.shape(0); ++k)
            displacements.push_back({regions(k), {by_px(k, 0), by_px(k, 1)}});
        tracker_.displace(displacements);
    }

    nb::dict refine(const ByteImage& bgr) {
        const double begin = now_ms();
        const rbdn::RegionSet& regions = tracker_.regions();
        const rbdn::Refinement fine = refiner_.refine(tracker_.mesh(), bgr.data(), tracker_.labels(), regions.of_face,
                                                      static_cast<int>(regions.id.size()));
        const rbdn::Mesh& mesh = fine.mesh;
        const double end = now_ms();

        nb::dict out;
        put_regions(out, mesh, regions, fine.region_bgr);
        put_loops(out, fine, regions);
        put_vertices(out, mesh, fine);
        put_outline(out, fine, regions);
        out["area_px"] = to_array(fine.area);
        out["sigma_area_px"] = to_array(fine.area_sigma);
        out["refine_ms"] = end - begin;
        return out;
    }

    nb::dict faces() const {
        const rbdn::Mesh& mesh = tracker_.mesh();
        std::vector<double> xy;
        for (const rbdn::Vertex& v : mesh.vertices) xy.insert(xy.end(), {v.p.x - 0.5, v.p.y - 0.5});
        std::vector<std::int32_t> edges;
        for (const rbdn::Edge& e : mesh.edges) edges.insert(edges.end(), {e.a, e.b, e.left, e.right});
        std::vector<std::int32_t> labels(tracker_.labels().begin(), tracker_.labels().end());
        std::vector<float> means;
        for (const rbdn::Face& f : mesh.faces)
            for (int k = 0; k < 3; ++k)
                means.push_back((f.mean[k] - rbdn::Image::kBlack[k]) / rbdn::Image::kUnitsPerLab);
        std::vector<int> itself(mesh.faces.size());
        std::iota(itself.begin(), itself.end(), 0);
        std::vector<double> areas(mesh.faces.size(), 0.0);
        for (const rbdn::Loop& loop : rbdn::trace_loops(mesh, itself)) areas[loop.face] += loop.area;
        std::vector<std::int64_t> vertex_ids, region_ids;
        for (const rbdn::Vertex& v : mesh.vertices) vertex_ids.push_back(v.id);
        const rbdn::RegionSet& regions = tracker_.regions();
        for (std::size_t f = 0; f < mesh.faces.size(); ++f)
            region_ids.push_back(f < regions.of_face.size() ? regions.id[regions.of_face[f]] : rbdn::kNoRegion);
        nb::dict out;
        out["vertex_ids"] = to_array(vertex_ids);
        out["region_ids"] = to_array(region_ids);
        out["areas_px"] = to_array(areas);
        out["vertices_px"] = to_array(xy, {mesh.vertices.size(), 2});
        out["edges"] = to_array(edges, {mesh.edges.size(), 4});
        out["means"] = to_array(means, {mesh.faces.size(), 3});
        out["labels"] = to_array(labels, {static_cast<std::size_t>(mesh.height), static_cast<std::size_t>(mesh.width)});
        return out;
    }

    // For tests: one operation, and what the forces are made of.
    void step(rbdn::Step step, std::uint32_t seed, const ByteImage& bgr) {
        rbdn::Steps(tracker_).apply(step, seed, bgr.data(), static_cast<int>(bgr.shape(1)),
                                    static_cast<int>(bgr.shape(0)));
    }
    nb::object disparity(const ByteImage& bgr, int reach_px) {
        const auto& disparity = rbdn::Steps(tracker_).measure(bgr.data(), static_cast<int>(bgr.shape(1)),
                                                              static_cast<int>(bgr.shape(0)), reach_px);
        std::vector<float> counts;
        for (const rbdn::Disparity& d : disparity)
            counts.insert(counts.end(),
                          {d.left_claimed[0], d.left_claimed[1], d.right_claimed[0], d.right_claimed[1]});
        return to_array(counts, {disparity.size(), 2, 2});
    }

    int cycles() const { return tracker_.cycles(); }
    bool polygons_limited() const { return tracker_.polygons_limited(); }
    bool time_limited() const { return tracker_.time_limited(); }
    std::vector<int> faults() const { return tracker_.faults(); }

private:
    void put_regions(nb::dict& out, const rbdn::Mesh& mesh, const rbdn::RegionSet& regions,
                     const std::vector<rbdn::Bgr>& means) const {
        std::vector<char> at_border(means.size(), 0);
        for (const rbdn::Edge& e : mesh.edges) {
            if (!e.on_border()) continue;
            const int face = e.left >= 0 ? e.left : e.right;
            if (face >= 0) at_border[regions.of_face[face]] = 1;
        }
        std::vector<double> rgb;
        for (const rbdn::Bgr& bgr : means) rgb.insert(rgb.end(), {bgr[2], bgr[1], bgr[0]});
        out["region_ids"] = to_array(regions.id);
        out["region_parents"] = to_array(regions.parent);
        out["region_is_news"] = to_array(regions.is_news);
        out["region_is_back"] = to_array(regions.is_back);
        std::vector<std::int64_t> gone, became;
        for (const rbdn::GoneRegion& region : regions.gone) {
            gone.push_back(region.id);
            became.push_back(region.became);
        }
        out["gone_ids"] = to_array(gone);
        out["gone_became"] = to_array(became);
        out["touches_border"] = to_array(std::vector<std::uint8_t>(at_border.begin(), at_border.end()));
        out["mean_rgb"] = to_array(rgb, {means.size(), 3});
    }

    // Loops one after another, region by region and the largest outer loop first, so that Python need only cut them
    // into pieces: loop k of them all ends at loop_ends[k], and region r has loop_counts[r] of them.
    void put_loops(nb::dict& out, const rbdn::Refinement& fine, const rbdn::RegionSet& regions) const {
        const rbdn::Mesh& mesh = fine.mesh;
        std::vector<rbdn::Loop> loops = rbdn::trace_loops(mesh, regions.of_face);
        std::stable_sort(loops.begin(), loops.end(), [](const rbdn::Loop& a, const rbdn::Loop& b) {
            return a.face != b.face ? a.face < b.face : a.area > b.area;
        });
        std::vector<std::int32_t> counts(regions.id.size(), 0), ends;
        std::vector<std::int64_t> vertices, neighbours;
        std::vector<double> xy;
        for (const rbdn::Loop& loop : loops) {
            for (std::size_t k = 0; k < loop.vertices.size(); ++k) {
                const int v = loop.vertices[k];
                const int beyond = mesh.edges[loop.edges[k]].right_from(v);
                vertices.push_back(mesh.vertices[v].id);
                xy.insert(xy.end(), {fine.vertices[v].x - 0.5, fine.vertices[v].y - 0.5});
                neighbours.push_back(beyond < 0 ? rbdn::kOutside : regions.id[regions.of_face[beyond]]);
            }
            ends.push_back(static_cast<std::int32_t>(vertices.size()));
            ++counts[loop.face];
        }
        out["loop_counts"] = to_array(counts);
        out["loop_ends"] = to_array(ends);
        out["loop_px"] = to_array(xy, {vertices.size(), 2});
        out["loop_vertices"] = to_array(vertices);
        out["loop_neighbours"] = to_array(neighbours);
    }

    void put_vertices(nb::dict& out, const rbdn::Mesh& mesh, const rbdn::Refinement& fine) const {
        std::vector<std::int64_t> ids;
        std::vector<double> xy;
        for (std::size_t k = 0; k < mesh.vertices.size(); ++k) {
            ids.push_back(mesh.vertices[k].id);
            xy.insert(xy.end(), {fine.vertices[k].x - 0.5, fine.vertices[k].y - 0.5});
        }
        out["vertex_ids"] = to_array(ids);
        out["vertices_px"] = to_array(xy, {ids.size(), 2});
        out["vertex_sigma_px"] = to_array(fine.vertex_sigma);
    }

    void put_outline(nb::dict& out, const rbdn::Refinement& fine, const rbdn::RegionSet& regions) const {
        const std::size_t count = fine.outline.size();
        std::vector<double> xy(2 * count), normal(2 * count), size(count), sigma(count);
        std::vector<std::int64_t> left(count), right(count);
        for (std::size_t k = 0; k < count; ++k) {
            const rbdn::OutlinePoint& p = fine.outline[k];
            xy[2 * k] = p.p.x - 0.5;
            xy[2 * k + 1] = p.p.y - 0.5;
            normal[2 * k] = p.normal.x;
            normal[2 * k + 1] = p.normal.y;
            size[k] = p.length_px;
            sigma[k] = p.sigma_px;
            left[k] = regions.id[p.left];
            right[k] = regions.id[p.right];
        }
        out["outline_px"] = to_array(xy, {count, 2});
        out["outline_normal"] = to_array(normal, {count, 2});
        out["outline_length_px"] = to_array(size);
        out["outline_sigma_px"] = to_array(sigma);
        out["outline_left"] = to_array(left);
        out["outline_right"] = to_array(right);
    }

    rbdn::Tracker tracker_;
    rbdn::Refiner refiner_;
};

nb::object turned_pixels(const NodeArray& nodes, int step_px, int width, int height) {
    if (step_px < 1 || width < 1 || height < 1 || nodes.shape(0) < static_cast<std::size_t>((height - 1) / step_px + 2) ||
        nodes.shape(1) < static_cast<std::size_t>((width - 1) / step_px + 2))
        throw nb::value_error("too few nodes for the image");
    const std::size_t size = static_cast<std::size_t>(width) * height;
    int* source = new int[size];
    nb::capsule owner(source, [](void* p) noexcept { delete[] static_cast<int*>(p); });
    rbdn::turned_pixels(nodes.data(), static_cast<int>(nodes.shape(1)), step_px, width, height, source);
    return nb::cast(nb::ndarray<nb::numpy, int>(source, {size}, owner));
}

nb::object working_colours(const rbdn::Config& config, const ByteImage& bgr) {
    const rbdn::ColourTables tables(config);
    std::vector<float> colours;
    for (std::size_t k = 0; k < bgr.shape(0) * bgr.shape(1); ++k) {
        const rbdn::ShortColour colour = tables(bgr.data() + 3 * k);
        for (int c = 0; c < 3; ++c)
            colours.push_back((colour[c] - rbdn::Image::kBlack[c]) / rbdn::Image::kUnitsPerLab);
    }
    return to_array(colours, {bgr.shape(0), bgr.shape(1), 3});
}

}  // namespace

NB_MODULE(_core, m) {
    m.doc() = "The Region-based Deformable Net's engine; use it through host.rbdn.Net.";

    nb::enum_<rbdn::Mode>(m, "Mode").value("ours", rbdn::Mode::kOurs).value("paper", rbdn::Mode::kPaper);

    nb::class_<rbdn::Config>(m, "Config")
        .def(nb::init<>())
        .def_rw("mode", &rbdn::Config::mode)
        .def_rw("square_px", &rbdn::Config::square_px)
        .def_rw("merge_distance", &rbdn::Config::merge_distance)
        .def_rw("rgb_distance", &rbdn::Config::rgb_distance)
        .def_rw("lightness_weight", &rbdn::Config::lightness_weight)
        .def_rw("min_area_px", &rbdn::Config::min_area_px)
        .def_rw("min_width_px", &rbdn::Config::min_width_px)
        .def_rw("start_reach_px", &rbdn::Config::start_reach_px)
        .def_rw("track_reach_px", &rbdn::Config::track_reach_px)
        .def_rw("start_cycles", &rbdn::Config::start_cycles)
        .def_rw("track_cycles", &rbdn::Config::track_cycles)
        .def_rw("group_step", &rbdn::Config::group_step)
        .def_rw("keep_step", &rbdn::Config::keep_step)
        .def_rw("refresh_frames", &rbdn::Config::refresh_frames)
        .def_rw("max_polygons", &rbdn::Config::max_polygons)
        .def_rw("max_ms", &rbdn::Config::max_ms);

    nb::enum_<rbdn::Step>(m, "Step")
        .value("move", rbdn::Step::kMove)
        .value("deform", rbdn::Step::kDeform)
        .value("insert", rbdn::Step::kInsert)
        .value("delete", rbdn::Step::kDelete)
        .value("zip", rbdn::Step::kZip)
        .value("snap", rbdn::Step::kSnap)
        .value("snap_to_border", rbdn::Step::kSnapToBorder)
        .value("merge", rbdn::Step::kMerge)
        .value("vectorise", rbdn::Step::kVectorise)
        .value("fragment", rbdn::Step::kFragment)
        .value("turn", rbdn::Step::kTurn)
        .value("displace", rbdn::Step::kDisplace)
        .value("track", rbdn::Step::kTrack);

    m.def("turned_pixels", &turned_pixels, "nodes"_a, "step_px"_a, "width"_a, "height"_a,
          "For every pixel the index of the one at the place interpolated between `nodes`, (rows, columns, 2) places "
          "(x, y) of every `step_px`-th pixel from the first to beyond the last; -1 for none.");
    m.def("working_colours", &working_colours, "config"_a, "bgr"_a,
          "For tests: (H, W, 3) colours as the net compares them, in CIELAB units or RGB levels.");

    nb::class_<NetCore>(m, "NetCore")
        .def(nb::init<const rbdn::Config&>(), "config"_a)
        .def("track", &NetCore::track, "bgr"_a, "source"_a,
             "Fit the net to an 8-bit BGR image; `source` as in Tracker::track, empty for none.")
        .def("displace", &NetCore::displace, "regions"_a, "by_px"_a,
             "Put regions, by id, where they are expected in the next image; before track.")
        .def("refine", &NetCore::refine, "bgr"_a, "Regions, loops, vertices and sub-pixel outline as arrays.")
        .def("faces", &NetCore::faces,
             "Vertices and their ids, edges (a, b, left, right), face means, areas and regions, and the label image.")
        .def("step", &NetCore::step, "step"_a, "seed"_a, "bgr"_a, "For tests: one operation, as Steps::apply.")
        .def("disparity", &NetCore::disparity, "bgr"_a, "reach_px"_a,
             "For tests: (E, 2, 2) pixels that are claimed across each edge, on its left and right, by halves.")
        .def_prop_ro("cycles", &NetCore::cycles)
        .def_prop_ro("polygons_limited", &NetCore::polygons_limited, "The polygon budget acted in the last frame.")
        .def_prop_ro("time_limited", &NetCore::time_limited, "The time budget acted in the last frame.")
        .def("faults", &NetCore::faults, "Edges at fault; empty for a consistent net.");
}
