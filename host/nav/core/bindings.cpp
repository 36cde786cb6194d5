// The Python face of what the map and the planner do cell by cell.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "ahead.hpp"
#include "columns.hpp"
#include "edges.hpp"
#include "fill.hpp"
#include "grid.hpp"
#include "search.hpp"
#include "seam.hpp"
#include "stance.hpp"
#include "tiles.hpp"
#include "track.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

template <class T>
using Image = nb::ndarray<const T, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
template <class T>
using Layer = nb::ndarray<T, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
template <class T>
using Row = nb::ndarray<const T, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Colours = nb::ndarray<const std::uint8_t, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;

template <class T, class From>
nb::object to_array(const std::vector<From>& values, std::initializer_list<std::size_t> shape) {
    T* data = new T[values.size() + 1];
    std::copy(values.begin(), values.end(), data);
    nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<T*>(p); });
    return nb::cast(nb::ndarray<nb::numpy, T>(data, shape, owner));
}

void require(bool holds, const char* what) {
    if (!holds) throw nb::value_error(what);
}

nb::tuple columns(const Image<std::uint16_t>& image, std::size_t kinds) {
    const nav::Columns c = nav::columns_of(image.data(), image.shape(0), image.shape(1), kinds);
    const std::size_t stretches = c.starts.size();
    return nb::make_tuple(to_array<std::uint16_t>(c.labels, {c.cols, c.rows}),
                          to_array<std::int64_t>(c.starts, {stretches}), to_array<std::int64_t>(c.ends, {stretches}),
                          to_array<std::int64_t>(c.owner, {stretches}),
                          to_array<std::int64_t>(c.lowest, {kinds, c.cols}), to_array<std::int64_t>(c.pixels, {kinds}),
                          to_array<std::int64_t>(c.at_border, {kinds}));
}

nb::object fill(const Image<double>& points, const Row<std::int64_t>& lengths, const Row<std::int64_t>& kinds,
                std::size_t rows, std::size_t cols, double step, std::uint16_t none) {
    require(points.shape(1) == 2, "x and y of every point");
    require(lengths.shape(0) == kinds.shape(0), "a kind for every outline");
    std::vector<nav::Outline> outlines;
    std::size_t begin = 0;
    for (std::size_t k = 0; k < lengths.shape(0); ++k) {
        const auto count = static_cast<std::size_t>(lengths.data()[k]);
        require(count <= points.shape(0) - begin, "as many points as the outlines have");
        outlines.push_back({points.data() + 2 * begin, count, static_cast<std::uint16_t>(kinds.data()[k])});
        begin += count;
    }
    return to_array<std::uint16_t>(nav::fill(outlines, rows, cols, step, none), {rows, cols});
}

nb::tuple feet(const Image<std::uint16_t>& labels, const Image<double>& slopes, const Row<std::int64_t>& ids,
               std::int64_t nothing, const Row<std::uint8_t>& ground, const Row<std::int64_t>& foot, double height_cm,
               double farthest_cm, double sigma_slope) {
    const std::size_t cols = labels.shape(0), rows = labels.shape(1);
    require(rows > 0 && foot.shape(0) == cols, "one foot for every column");
    require(slopes.shape(0) == cols && slopes.shape(1) == rows, "one ray for every pixel");
    require(ground.shape(0) == ids.shape(0), "of every kind its id and whether it is floor");
    require(*std::max_element(labels.data(), labels.data() + cols * rows) < ids.shape(0), "an id of every kind");
    const nav::FirstOther first = nav::first_other(labels.data(), cols, rows, ground.data(), foot.data());
    const nav::Feet f = nav::feet_of(first, labels.data(), slopes.data(), rows, ids.data(), nothing,
                                     {height_cm, farthest_cm, sigma_slope});
    return nb::make_tuple(to_array<std::int64_t>(f.kind, {cols}), to_array<bool>(f.cut, {cols}),
                          to_array<double>(f.slope, {cols}), to_array<double>(f.depth_cm, {cols}),
                          to_array<bool>(f.sure, {cols}), to_array<double>(f.floor_cm, {cols}),
                          to_array<double>(f.free_cm, {cols}));
}

nav::Shape shape(const Image<std::uint16_t>& labels, std::uint16_t kind, const Row<double>& slopes,
                 const Row<bool>& cut, const Row<std::int64_t>& feet, const Row<std::int64_t>& covered) {
    const std::size_t cols = labels.shape(0);
    require(slopes.shape(0) == cols && cut.shape(0) == cols, "a foot of every column");
    for (const auto& columns : {feet, covered})
        for (std::size_t k = 0; k < columns.shape(0); ++k)
            require(columns(k) >= 0 && static_cast<std::size_t>(columns(k)) < cols, "columns of the picture");
    return {labels.data(), labels.shape(1), kind, {slopes.data(), cols},
            {feet.data(), feet.shape(0)}, {covered.data(), covered.shape(0)}, cut.data()};
}

nav::Across across_of(const nav::Shape& shape, const Row<double>& across, double height_cm) {
    require(across.shape(0) == shape.slopes.size(), "a ray of every column");
    require(shape.feet.size() >= 3 && !shape.covered.empty(), "three feet at least");
    return {{across.data(), across.shape(0)}, height_cm};
}

nb::tuple stance(const Image<std::uint16_t>& labels, std::uint16_t kind, const Row<double>& slopes,
                 const Row<bool>& cut, const Row<std::int64_t>& feet, const Row<std::int64_t>& covered,
                 const Row<double>& across, double height_cm, double rms) {
    const nav::Shape of = shape(labels, kind, slopes, cut, feet, covered);
    const nav::Stance s = nav::stance_of(of, across_of(of, across, height_cm), rms);
    return nb::make_tuple(s.nearest, s.mean, s.is_wall,
                          s.line ? nb::object(nb::make_tuple(s.line->offset, s.line->rise)) : nb::none(),
                          s.edges ? to_array<double>(*s.edges, {s.edges->size()}) : nb::none(), s.hangs,
                          s.touching);
}

bool is_straight_wall(const Image<std::uint16_t>& labels, std::uint16_t kind, const Row<double>& slopes,
                      const Row<bool>& cut, const Row<std::int64_t>& feet, const Row<std::int64_t>& covered,
                      const Row<double>& across, double height_cm) {
    const nav::Shape of = shape(labels, kind, slopes, cut, feet, covered);
    return nav::is_straight_wall(of, across_of(of, across, height_cm));
}

bool tapers(const Image<std::uint16_t>& labels, std::uint16_t kind, const Row<double>& slopes, const Row<bool>& cut,
            const Row<std::int64_t>& feet, const Row<std::int64_t>& covered) {
    return nav::tapers(shape(labels, kind, slopes, cut, feet, covered));
}

// Sums over stretches of what `running` is a running sum of, for each kind.
nb::object totals(const Row<double>& running, const Row<std::int64_t>& starts, const Row<std::int64_t>& ends,
                  const Row<std::int64_t>& owner, std::size_t kinds) {
    require(starts.shape(0) == owner.shape(0) && ends.shape(0) == owner.shape(0), "start, end and owner of every stretch");
    std::vector<double> sums(kinds, 0.0);
    for (std::size_t k = 0; k < owner.shape(0); ++k) {
        const auto start = static_cast<std::size_t>(starts(k)), end = static_cast<std::size_t>(ends(k)),
                   kind = static_cast<std::size_t>(owner(k));
        require(start < running.shape(0) && end < running.shape(0) && kind < kinds, "stretches within the picture");
        sums[kind] += running(end) - running(start);
    }
    return to_array<double>(sums, {kinds});
}

nav::Front front(std::int32_t region, const Row<std::int64_t>& columns_seen, const Row<double>& depth_cm,
                 double sigma_cm, double from_cm, double to_cm, double sure_cm, float at_least, float change, float most,
                 bool brief) {
    const std::size_t n = columns_seen.shape(0);
    require(depth_cm.shape(0) == n, "one depth for every column");
    return {region, {columns_seen.data(), columns_seen.data() + n}, {depth_cm.data(), depth_cm.data() + n},
            sigma_cm, from_cm, to_cm, sure_cm, at_least, change, most, brief};
}

nav::View view(double x_cm, double z_cm, double sine, double cosine, double left, double right, double range_cm,
               double fx, double cx, const Row<double>& rays, const Row<double>& pixels, double step_px) {
    require(rays.shape(0) == pixels.shape(0), "one pixel for every ray");
    return {x_cm, z_cm, sine, cosine, left, right, range_cm, 0, 0, 0, 0, fx, cx,
            {rays.data(), rays.data() + rays.shape(0)}, {pixels.data(), pixels.data() + pixels.shape(0)}, step_px};
}

nav::Floor floor_seen(const Row<double>& free_cm, const Row<double>& floor_cm, const Row<bool>& cut,
                      double nearest_cm) {
    const std::size_t n = free_cm.shape(0);
    require(floor_cm.shape(0) == n && cut.shape(0) == n, "of every column how far it is seen and whether it is cut");
    return {std::vector<double>(free_cm.data(), free_cm.data() + n),
            std::vector<double>(floor_cm.data(), floor_cm.data() + n), std::vector<bool>(cut.data(), cut.data() + n),
            nearest_cm};
}

void paint(const Layer<float>& evidence, const Layer<std::int32_t>& region, const Layer<bool>& brief,
           const Row<double>& centres_cm, const nav::View& seen, const std::array<std::size_t, 4>& window,
           const nav::Floor& floor, const std::vector<nav::Front>& fronts, const nav::Rules& rules) {
    const std::size_t side = centres_cm.shape(0);
    for (std::size_t k = 0; k < 2; ++k)
        require(evidence.shape(k) == side && region.shape(k) == side && brief.shape(k) == side,
                "layers of one size");
    require(window[1] < side && window[3] < side, "a window within the map");
    for (const nav::Front& f : fronts)
        for (const std::int64_t c : f.columns)
            require(c >= 0 && static_cast<std::size_t>(c) < floor.free_cm.size(), "columns of the picture");
    nav::View within = seen;
    within.row0 = window[0], within.row1 = window[1], within.col0 = window[2], within.col1 = window[3];
    nav::paint({evidence.data(), region.data(), brief.data(), centres_cm.data(), side}, within, floor, fronts, rules);
}

nb::object colour_steps(const nb::ndarray<const float, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>& colours,
                        std::size_t window, double light) {
    const std::size_t strips = colours.shape(0), rows = colours.shape(1);
    require(window > 0 && rows + 1 > 2 * window, "strips longer than two windows");
    return to_array<float>(nav::colour_steps(colours.data(), strips, rows, window, light),
                           {strips, rows + 1 - 2 * window});
}

nb::object agreed(const Row<std::int64_t>& foot, const Row<bool>& found, std::size_t search, double agree_px) {
    const std::size_t n = foot.shape(0);
    require(found.shape(0) == n, "of every foot whether it was found");
    const std::vector<std::int64_t> feet(foot.data(), foot.data() + n);
    const std::vector<std::uint8_t> known(found.data(), found.data() + n);
    return to_array<bool>(nav::agreed(feet, known, search, agree_px), {n});
}

nb::object search(const Image<bool>& shut, const Image<float>& cost, const Image<float>& ahead,
                  const Image<bool>& there, std::size_t row, std::size_t col) {
    const std::size_t rows = shut.shape(0), cols = shut.shape(1);
    require(row < rows && col < cols, "a start within the field");
    require(cost.shape(0) == rows && cost.shape(1) == cols && ahead.shape(0) == rows && ahead.shape(1) == cols &&
                there.shape(0) == rows && there.shape(1) == cols,
            "fields of one size");
    const std::vector<std::size_t> way =
        nav::search({rows, cols, shut.data(), cost.data(), ahead.data(), there.data()}, row * cols + col);
    return to_array<std::int64_t>(way, {way.size()});
}

nb::tuple meet(const Image<float>& evidence, const Row<double>& centres_cm, const std::array<std::size_t, 4>& window,
               double x_cm, double z_cm, double heading, double radius_cm, double wide_cm,
               const std::array<float, 3>& kinds, double half_cell_cm, double reach_cm) {
    const std::size_t side = centres_cm.shape(0);
    require(evidence.shape(0) == side && evidence.shape(1) == side, "a centre for every row and column");
    require(window[1] < side && window[3] < side, "a window within the map");
    const nav::Meeting met =
        nav::meet({evidence.data(), centres_cm.data(), side, window[0], window[1], window[2], window[3]},
                  {x_cm, z_cm, std::sin(heading), std::cos(heading), radius_cm, wide_cm},
                  {kinds[0], kinds[1], kinds[2]}, half_cell_cm, reach_cm);
    return nb::make_tuple(met.room_cm, met.unseen_cm, met.blind_cm, met.row, met.col);
}

float least_along(const Image<float>& distances, double half_cm, double cell_cm, const std::array<double, 2>& start,
                  const std::array<double, 2>& end, double from_cm) {
    require(distances.shape(0) == distances.shape(1) && distances.shape(0) > 0, "distances of a square map");
    return nav::least_along({distances.data(), distances.shape(0), half_cm, cell_cm}, start[0], start[1], end[0],
                            end[1], from_cm);
}

nav::Pixels pixels_of(const Colours& image) { return {image.data(), image.shape(0), image.shape(1)}; }

nb::object thinned(const Colours& image, std::size_t step) {
    require(step > 0, "a step");
    return to_array<std::uint8_t>(nav::thinned(pixels_of(image), step),
                                  {(image.shape(0) + step - 1) / step, (image.shape(1) + step - 1) / step, 3});
}

nb::object strips(const Colours& image, std::size_t high, std::size_t wide) {
    require(high > 0 && wide > 0, "blocks of a pixel at least");
    return to_array<float>(nav::strips(pixels_of(image), high, wide),
                           {image.shape(1) / wide, image.shape(0) / high, 3});
}

nb::object tile_means(const Colours& image, std::size_t every, std::size_t rows, std::size_t across,
                      std::size_t down) {
    require(every > 0 && rows > 0 && every * (rows - 1) < image.shape(0), "rows of the picture");
    require(across > 0 && down > 0 && across <= image.shape(1) && down <= rows, "tiles of a pixel at least");
    return to_array<float>(nav::tile_means(pixels_of(image), every, rows, {across, down}), {down, across});
}

nb::tuple sharp_tiles(const Colours& image, std::size_t every, std::size_t step_px, std::size_t wide_px,
                       std::uint8_t levels, std::size_t across, std::size_t down) {
    const std::size_t height = image.shape(0), width = image.shape(1);
    require(every > 0 && step_px > 0 && height > step_px + every * (down + 1), "a picture high enough");
    require(across > 0 && down > 0 && width >= 2 * wide_px + step_px + across, "a picture wide enough");
    const nav::Tiles tiles = nav::sharp_tiles(pixels_of(image), every, {step_px, wide_px, levels}, {across, down});
    return nb::make_tuple(to_array<float>(tiles.sharp, {down, across}), to_array<float>(tiles.brightness, {down, across}));
}

nb::tuple compare_rows(const Colours& image, const Colours& other) {
    require(image.shape(0) == other.shape(0) && image.shape(1) == other.shape(1), "pictures of one size");
    const nav::Rows rows = nav::compare_rows(pixels_of(image), pixels_of(other));
    return nb::make_tuple(to_array<std::uint8_t>(rows.spread, {image.shape(0)}),
                          to_array<bool>(rows.alike, {image.shape(0)}));
}

nb::object pair(const std::optional<nav::FloorPoint>& place) {
    return place ? nb::object(nb::make_tuple(place->x_cm, place->z_cm)) : nb::none();
}

nb::object sight_of(const Row<std::int64_t>& owners, const Row<double>& slopes, const Row<double>& depth_cm,
                    const Row<bool>& cut, const Row<double>& across, double height_cm,
                    const std::array<double, 2>& eye, const std::array<double, 2>& ahead, std::int64_t region,
                    double cut_part, double sigma_ray, double t_s) {
    const std::size_t cols = owners.shape(0);
    require(slopes.shape(0) == cols && depth_cm.shape(0) == cols && cut.shape(0) == cols && across.shape(0) == cols,
            "a foot and a ray of every column");
    const auto found = nav::sight_of({{owners.data(), cols}, slopes.data(), depth_cm.data(), cut.data(), across.data(),
                                      height_cm, {eye[0], eye[1]}, {ahead[0], ahead[1]}},
                                     region, cut_part, sigma_ray, t_s);
    return found ? nb::cast(*found) : nb::none();
}

}  // namespace

NB_MODULE(_nav, m) {
    nb::class_<nav::Front>(m, "Front")
        .def(nb::new_(&front), "region"_a, "columns"_a, "depth_cm"_a, "sigma_cm"_a, "from_cm"_a, "to_cm"_a,
             "sure_cm"_a, "at_least"_a, "change"_a, "most"_a, "brief"_a);
    nb::class_<nav::View>(m, "View")
        .def(nb::new_(&view), "x_cm"_a, "z_cm"_a, "sine"_a, "cosine"_a, "left"_a, "right"_a, "range_cm"_a, "fx"_a,
             "cx"_a, "rays"_a, "pixels"_a, "step_px"_a);
    nb::class_<nav::Floor>(m, "Floor").def(nb::new_(&floor_seen), "free_cm"_a, "floor_cm"_a, "cut"_a, "nearest_cm"_a);
    nb::class_<nav::Rules>(m, "Rules").def(nb::init<float, float, float, float, double>(), "seen_empty"_a, "looked_over"_a, "presumed"_a,
                                           "limit"_a, "cell_cm"_a);
    m.def("paint", &paint, "evidence"_a.noconvert(), "region"_a.noconvert(), "brief"_a.noconvert(), "centres_cm"_a,
          "view"_a, "window"_a, "floor"_a, "fronts"_a, "rules"_a);
    m.def("columns", &columns, "image"_a.noconvert(), "kinds"_a);
    m.def("fill", &fill, "points"_a, "lengths"_a, "kinds"_a, "rows"_a, "cols"_a, "step"_a,
          "none"_a);
    m.def("feet", &feet, "labels"_a, "slopes"_a, "ids"_a, "nothing"_a, "ground"_a, "foot"_a, "height_cm"_a,
          "farthest_cm"_a, "sigma_slope"_a);
    m.def("stance", &stance, "labels"_a, "kind"_a, "slopes"_a, "cut"_a, "feet"_a, "covered"_a, "across"_a,
          "height_cm"_a, "rms"_a);
    m.def("is_straight_wall", &is_straight_wall, "labels"_a, "kind"_a, "slopes"_a, "cut"_a, "feet"_a, "covered"_a,
          "across"_a, "height_cm"_a);
    m.def("tapers", &tapers, "labels"_a, "kind"_a, "slopes"_a, "cut"_a, "feet"_a, "covered"_a);
    m.def("totals", &totals, "running"_a.noconvert(), "starts"_a, "ends"_a, "owner"_a, "kinds"_a);
    m.def("colour_steps", &colour_steps, "colours"_a, "window"_a, "light"_a);
    m.def("agreed", &agreed, "foot"_a, "found"_a, "search"_a, "agree_px"_a);
    m.def("meet", &meet, "evidence"_a, "centres_cm"_a, "window"_a, "x_cm"_a, "z_cm"_a, "heading"_a, "radius_cm"_a,
          "wide_cm"_a, "kinds"_a, "half_cell_cm"_a, "reach_cm"_a);
    m.def("least_along", &least_along, "distances"_a, "half_cm"_a, "cell_cm"_a, "start"_a, "end"_a, "from_cm"_a);
    m.def("thinned", &thinned, "image"_a.noconvert(), "step"_a);
    m.def("strips", &strips, "image"_a.noconvert(), "high"_a, "wide"_a);
    m.def("tile_means", &tile_means, "image"_a.noconvert(), "every"_a, "rows"_a, "across"_a, "down"_a);
    m.def("sharp_tiles", &sharp_tiles, "image"_a.noconvert(), "every"_a, "step_px"_a, "wide_px"_a, "levels"_a,
          "across"_a, "down"_a);
    m.def("compare_rows", &compare_rows, "image"_a.noconvert(), "other"_a.noconvert());
    nb::class_<nav::FootSight>(m, "FootSight")
        .def_ro("t_s", &nav::FootSight::t_s)
        .def_ro("depth_cm", &nav::FootSight::depth_cm)
        .def_prop_ro("left", [](const nav::FootSight& s) { return pair(s.left); })
        .def_prop_ro("right", [](const nav::FootSight& s) { return pair(s.right); })
        .def_prop_ro("ray", [](const nav::FootSight& s) { return pair(s.ray); });
    m.def("sight_of", &sight_of, "owners"_a, "slopes"_a, "depth_cm"_a, "cut"_a, "across"_a, "height_cm"_a, "eye"_a,
          "ahead"_a, "region"_a, "cut_part"_a, "sigma_ray"_a, "t_s"_a);
    nb::class_<nav::Track>(m, "Track")
        .def("__init__",
             [](nav::Track* self, const nav::FootSight& first) { (new (self) nav::Track())->see(first); }, "first"_a)
        .def("see", &nav::Track::see, "now"_a)
        .def_prop_ro("newest_s", &nav::Track::newest_s)
        .def("velocity", [](const nav::Track& t, bool known) { return pair(t.velocity(known)); }, "known"_a)
        .def("stands", &nav::Track::stands);
    m.def("search", &search, "shut"_a, "cost"_a, "ahead"_a, "there"_a, "row"_a, "col"_a);
}
