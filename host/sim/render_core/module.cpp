// Python's door to the renderer; host/sim/render.py is its documented face.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <array>
#include <tuple>

#include "render.hpp"

namespace nb = nanobind;

namespace {

using Triple = std::tuple<double, double, double>;
using Matrix = nb::ndarray<const double, nb::shape<3, 3>, nb::c_contig, nb::device::cpu>;
using Vector = nb::ndarray<const double, nb::shape<3>, nb::c_contig, nb::device::cpu>;
using Matrices = nb::ndarray<const double, nb::shape<-1, 3, 3>, nb::c_contig, nb::device::cpu>;
using Vectors = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

Vec3 vec(const Triple &t) { return {std::get<0>(t), std::get<1>(t), std::get<2>(t)}; }

// A lens, and where its pixels lie.
struct Camera {
    View view;
    Places places;

    explicit Camera(const View &lens) : view(lens), places(lens, render_pad) {}

    View at(const double *rotation, const double *position) const // camera to world
    {
        View there = view;
        const double *r = rotation, *p = position;
        there.eye = {p[0], p[1], p[2]};
        there.right = {r[0], r[3], r[6]}, there.down = {r[1], r[4], r[7]}, there.forward = {r[2], r[5], r[8]};
        return there;
    }
};

void add(Scene &scene, Surface surface, int object, int part, const Material &material)
{
    surface.object = object, surface.part = part, surface.material = material;
    scene.surfaces.push_back(surface);
}

template <class T> nb::object to_numpy(const std::vector<T> &data, std::initializer_list<std::size_t> shape)
{
    T *copy = new T[data.size()];
    std::copy(data.begin(), data.end(), copy);
    nb::capsule owner(copy, [](void *p) noexcept { delete[] static_cast<T *>(p); });
    return nb::ndarray<nb::numpy, T>(copy, shape.size(), shape.begin(), owner).cast();
}

} // namespace

NB_MODULE(_render, module)
{
    nb::enum_<Pattern>(module, "Pattern")
        .value("plain", Pattern::plain)
        .value("wood", Pattern::wood)
        .value("tiles", Pattern::tiles);

    nb::class_<Material>(module, "Material")
        .def(
            "__init__",
            [](Material *m, Pattern pattern, Triple bgr, double contrast, double scale_cm, uint32_t seed,
               double gloss) { new (m) Material{pattern, vec(bgr), contrast, scale_cm, seed, gloss}; },
            nb::arg("pattern"), nb::arg("bgr"), nb::arg("contrast"), nb::arg("scale_cm"), nb::arg("seed"),
            nb::arg("gloss"));

    nb::class_<Camera>(module, "Camera")
        .def(
            "__init__",
            [](Camera *camera, double fx, double fy, double cx, double cy, int width, int height,
               const std::array<double, 5> &distortion) {
                new (camera) Camera(View{{}, {}, {}, {}, fx, fy, cx, cy, width, height, distortion});
            },
            nb::arg("fx"), nb::arg("fy"), nb::arg("cx"), nb::arg("cy"), nb::arg("width"), nb::arg("height"),
            nb::arg("distortion") = std::array<double, 5>{});

    nb::class_<Scene>(module, "Scene")
        .def(
            "__init__", [](Scene *scene, double floor_y) { new (scene) Scene{{}, {}, {}, floor_y}; },
            nb::arg("floor_y"))
        .def(
            "light",
            [](Scene &scene, Triple lamp, double ambient, double sky, double direct, double reference_cm) {
                scene.light = {vec(lamp), ambient, sky, direct, reference_cm};
            },
            nb::arg("lamp"), nb::arg("ambient"), nb::arg("sky"), nb::arg("direct"), nb::arg("reference_cm"))
        .def(
            "quad",
            [](Scene &scene, Triple corner, Triple u, Triple v, Triple normal, int object, int part,
               const Material &material, bool shadowed) {
                Surface s;
                s.shape = Shape::quad;
                s.origin = vec(corner), s.u = vec(u), s.v = vec(v), s.normal = unit(vec(normal));
                s.shadowed = shadowed;
                add(scene, s, object, part, material);
            },
            nb::arg("corner"), nb::arg("u"), nb::arg("v"), nb::arg("normal"), nb::arg("object"), nb::arg("part"),
            nb::arg("material"), nb::arg("shadowed"))
        .def(
            "disc",
            [](Scene &scene, Triple centre, double radius, int object, int part, const Material &material,
               bool faces_down) {
                Surface s;
                s.shape = Shape::disc;
                s.origin = vec(centre), s.u = {radius, 0, 0}, s.v = {0, 0, radius};
                s.normal = {0.0, faces_down ? 1.0 : -1.0, 0.0};
                add(scene, s, object, part, material);
            },
            nb::arg("centre"), nb::arg("radius"), nb::arg("object"), nb::arg("part"), nb::arg("material"),
            nb::arg("faces_down") = false)
        .def(
            "ellipsoid",
            [](Scene &scene, Triple centre, Triple u, Triple v, Triple w, int object, int part,
               const Material &material) {
                Surface s;
                s.shape = Shape::ellipsoid;
                s.origin = vec(centre), s.u = vec(u), s.v = vec(v), s.w = vec(w);
                s.radius = (std::sqrt(dot(s.u, s.u)) + std::sqrt(dot(s.v, s.v)) + std::sqrt(dot(s.w, s.w))) / 3.0;
                add(scene, s, object, part, material);
            },
            nb::arg("centre"), nb::arg("u"), nb::arg("v"), nb::arg("w"), nb::arg("object"), nb::arg("part"),
            nb::arg("material"))
        .def(
            "cone",
            [](Scene &scene, Triple base, double radius, double top_radius, double height, int object, int part,
               const Material &material) {
                Surface s;
                s.shape = Shape::cone;
                s.origin = vec(base), s.radius = radius, s.top = top_radius, s.height = height;
                add(scene, s, object, part, material);
            },
            nb::arg("base"), nb::arg("radius"), nb::arg("top_radius"), nb::arg("height"), nb::arg("object"),
            nb::arg("part"), nb::arg("material"))
        .def(
            "round_occluder",
            [](Scene &scene, double x, double z, double radius, double height, double base) {
                scene.occluders.push_back({x, z, 0, 0, 1, 0, radius, height, base});
            },
            nb::arg("x"), nb::arg("z"), nb::arg("radius"), nb::arg("height"), nb::arg("base"))
        .def(
            "box_occluder",
            [](Scene &scene, double x, double z, double half_u, double half_v, double yaw, double height,
               double base) {
                scene.occluders.push_back({x, z, half_u, half_v, std::cos(yaw), std::sin(yaw), 0, height, base});
            },
            nb::arg("x"), nb::arg("z"), nb::arg("half_u"), nb::arg("half_v"), nb::arg("yaw"), nb::arg("height"),
            nb::arg("base"))
        .def(
            "render",
            [](const Scene &scene, const Camera &camera, const Matrices &rotations, const Vectors &positions,
               double psf_px) {
                const std::size_t count = rotations.shape(0);
                if (count == 0 || positions.shape(0) != count)
                    throw nb::value_error("as many rotations as positions, at least one");
                std::vector<View> views;
                for (std::size_t n = 0; n < count; n++)
                    views.push_back(camera.at(rotations.data() + 9 * n, positions.data() + 3 * n));
                const auto bgr = render(scene, views, camera.places, psf_px);
                return to_numpy(bgr, {static_cast<std::size_t>(camera.places.height),
                                      static_cast<std::size_t>(camera.places.width), 3});
            },
            nb::arg("camera"), nb::arg("rotations"), nb::arg("positions"), nb::arg("psf_px"))
        .def(
            "truth",
            [](const Scene &scene, const Camera &camera, const Matrix &rotation, const Vector &position, bool areas) {
                const Truth t = truth(scene, camera.at(rotation.data(), position.data()), camera.places, areas);
                const auto h = static_cast<std::size_t>(camera.places.height);
                const auto w = static_cast<std::size_t>(camera.places.width);
                return nb::make_tuple(to_numpy(t.depth, {h, w}), to_numpy(t.part, {h, w}), to_numpy(t.object, {h, w}),
                                      to_numpy(t.area, {t.area.size()}), to_numpy(t.mean_z, {t.mean_z.size()}));
            },
            nb::arg("camera"), nb::arg("rotation"), nb::arg("position"), nb::arg("areas") = true);
}
