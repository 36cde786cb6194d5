// Polygon, relief, area and vertex parts of the depth engine behind plain functions, for tests by ctypes.
#include <cstdint>
#include <cstring>
#include <memory>
#include <vector>

#include "area.hpp"
#include "lens.hpp"
#include "path.hpp"
#include "polygon.hpp"
#include "relief.hpp"
#include "vertex.hpp"

using namespace depth;

namespace {

// Loops one after the other, `sizes` points each.
Loops loops_from(const double* xy, const int* sizes, int count) {
    Loops loops(static_cast<std::size_t>(count));
    for (int k = 0; k < count; ++k)
        for (int i = 0; i < sizes[k]; ++i, xy += 2) loops[static_cast<std::size_t>(k)].push_back({xy[0], xy[1]});
    return loops;
}

int put(const Loop& loop, double* xy) {
    for (const Vec2 p : loop) *xy++ = p.x, *xy++ = p.y;
    return static_cast<int>(loop.size());
}

void put(const Answer& answer, double* three, char* why) {
    three[0] = answer.depth_cm, three[1] = answer.sigma_cm, three[2] = answer.sensitivity;
    std::strncpy(why, answer.declined.c_str(), 127);
    why[127] = 0;
}

struct Run {
    Path path;
    AreaMethod area;
    VertexMethod vertex;
    FrameView frame;
    VertexDepths found;
    int present = 0;
};

}  // namespace

extern "C" {

double probe_area(const double* xy, const int* sizes, int count) { return polygon_area(loops_from(xy, sizes, count)); }

double probe_length(const double* xy, const int* sizes, int count) {
    return outline_length(loops_from(xy, sizes, count));
}

void probe_moments(const double* xy, const int* sizes, int count, double* six) {
    const Moments m = polygon_moments(loops_from(xy, sizes, count));
    const double values[] = {m.area, m.centre.x, m.centre.y, m.xx, m.yy, m.xy};
    std::memcpy(six, values, sizeof values);
}

double probe_mean_of_inverse(const double* xy, const int* sizes, int count, double a, double b, double c) {
    return mean_of_inverse(loops_from(xy, sizes, count), a, b, c);
}

int probe_hull(const double* xy, int n, double* out) { return put(convex_hull(loops_from(xy, &n, 1)[0]), out); }

void probe_rectangle(const double* xy, int n, double* two) {
    const Rectangle r = smallest_rectangle(convex_hull(loops_from(xy, &n, 1)[0]));
    two[0] = r.width, two[1] = r.height;
}

int probe_simplified(const double* xy, int n, double tolerance, double* out) {
    return put(simplified(loops_from(xy, &n, 1)[0], tolerance), out);
}

int probe_is_convex(const double* xy, int n) { return is_convex(loops_from(xy, &n, 1)[0]); }

void probe_relief(const double* xy, int n, int cut, double* two) {
    const Relief r = relief_of(loops_from(xy, &n, 1)[0], cut != 0);
    two[0] = r.k, two[1] = r.sigma_k;
}

int probe_may_be_one_face(const double* xy, int n) { return may_be_one_face(loops_from(xy, &n, 1)[0]); }

// camera: width, height, fx, fy, cx, cy; noise: of travel, turn, share of a turn, timing
Run* run_new(const double* camera, const double* noise, int exact_outlines) {
    const Camera c{static_cast<int>(camera[0]), static_cast<int>(camera[1]), camera[2], camera[3], camera[4], camera[5]};
    AreaConfig area;
    if (exact_outlines) area.outline_px = area.drift_px = 0.0;
    return new Run{Path({noise[0], noise[1], noise[2], noise[3]}), AreaMethod(c, area), VertexMethod(c, {}), {}, {}, 0};
}

void run_delete(Run* run) { delete run; }

void run_pose(Run* run, int frame, const double* rotation, const double* position, const double* t_and_sigmas) {
    Mat3 r;
    std::memcpy(r.m.data(), rotation, sizeof(double) * 9);
    run->path.add(frame, r, {position[0], position[1], position[2]}, t_and_sigmas[0], t_and_sigmas[1], t_and_sigmas[2]);
    run->present = frame;
    run->frame = {};
    run->frame.seq = frame;
    run->area.forget_unseen(frame);
}

void run_add_region(Run* run, std::int64_t id, const double* area_sigma_polygon, int touches_border, const double* xy,
                    const int* sizes, int count, const std::int64_t* corners) {
    RegionView r;
    r.id = id;
    r.area_px = area_sigma_polygon[0], r.sigma_area_px = area_sigma_polygon[1], r.polygon_px = area_sigma_polygon[2];
    r.touches_border = touches_border != 0;
    r.loops = loops_from(xy, sizes, count);
    r.corners.assign(corners, corners + sizes[0]);
    run->frame.regions.push_back(r);
}

void run_add_changed(Run* run, std::int64_t id) { run->frame.changed.push_back(id); }

// Takes in the vertices and says where they are: x, y, z, sigma, sensitivity each.
void run_vertices(Run* run, int n, const std::int64_t* ids, const double* xy, const double* sigma_px, double* five) {
    for (int k = 0; k < n; ++k) {
        run->frame.vertex_ids.push_back(ids[k]);
        run->frame.vertex_px.push_back({xy[2 * k], xy[2 * k + 1]});
        run->frame.vertex_sigma_px.push_back(sigma_px[k]);
    }
    run->found = run->vertex.update(run->frame, run->path, run->present);
    for (std::size_t k = 0; k < run->found.xyz_cm.size(); ++k) {
        const Vec3 p = run->found.xyz_cm[k];
        const double row[] = {p.x, p.y, p.z, run->found.sigma_cm[k], run->found.sensitivity[k]};
        std::memcpy(five + 5 * k, row, sizeof row);
    }
}

void run_area(Run* run, int region, double own_share, double* three, char* why) {
    put(run->area.update(run->frame.regions[static_cast<std::size_t>(region)], run->frame, run->path, run->present,
                         own_share),
        three, why);
}

void run_region(Run* run, int region, double own_share, double* three, char* why) {
    put(run->vertex.region(run->frame.regions[static_cast<std::size_t>(region)], run->frame, run->found, own_share), three,
        why);
}

int run_frames(Run* run, int* out) {
    std::set<int> frames = run->area.frames();
    frames.merge(run->vertex.frames());
    for (const int f : frames) *out++ = f;
    run->path.keep(frames);
    return static_cast<int>(frames.size());
}

void probe_ideal(const double* terms, const double* xy, int count, double* out) {
    const Lens lens(280.0, 275.0, 158.0, 121.0, {terms[0], terms[1], terms[2], terms[3], terms[4]});
    std::vector<Vec2> px, ideal(static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i) px.push_back({xy[2 * i], xy[2 * i + 1]});
    lens.ideal(px.data(), px.size(), ideal.data());
    put(ideal, out);
}

}  // extern "C"
