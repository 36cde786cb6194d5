// Corners that the net cuts off with a short edge, made whole for output.
#include "corners.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace rbdn {

namespace {

constexpr double kLongestCut = 12.0;
constexpr double kSmallCut = 5.0;        // hides too few pixels to see their colour past the blur
constexpr float kFilled = 0.4F;          // of the way to the colour within
constexpr double kShortestArm = 9.0;
constexpr double kLeastSine = 0.35;      // flatter corners may be arcs
constexpr double kFarthestPoint = 12.0;   // of the whole corner from the cut

// The edge that continues a chain beyond `edge` at `vertex`.
int next_edge(const Mesh& mesh, int vertex, int edge) {
    const Spokes& spokes = mesh.spokes[vertex];
    return spokes.edge[0] == edge ? spokes.edge[1] : spokes.edge[0];
}

// Whether what the cut leaves outside has the colour of the face within the corner.
bool is_filled(const View& view, const Edge& cut, Vec2 a, Vec2 corner, Vec2 b) {
    const bool left_is_within = dot(corner - a, left_normal(b - a)) < 0;
    const int within = view.region(left_is_within ? cut.left : cut.right);
    const int beyond = view.region(left_is_within ? cut.right : cut.left);
    if (within == beyond) return false;
    const Bgr base = view.region_bgr[beyond], d = view.region_bgr[within] - base;
    float level = 0;
    int count = 0;
    for (int y = floor_px(std::min({a.y, b.y, corner.y})); y < std::max({a.y, b.y, corner.y}); ++y)
        for (int x = floor_px(std::min({a.x, b.x, corner.x})); x < std::max({a.x, b.x, corner.x}); ++x) {
            if (!inside_triangle({x + 0.5, y + 0.5}, a, corner, b)) continue;
            const std::uint8_t* pixel = view.pixel(x, y);
            level += dot(Bgr{float(pixel[0]), float(pixel[1]), float(pixel[2])} - base, d);
            ++count;
        }
    return level >= kFilled * dot(d, d) * static_cast<float>(count);
}

// Where the two edges beside a short edge would meet.
std::optional<Vec2> whole_corner(const View& view, const Mesh& mesh, int cut) {
    const Edge& e = mesh.edges[cut];
    if (e.dead || e.on_border() || mesh.edge_length(e) > kLongestCut) return std::nullopt;
    if (mesh.degree(e.a) != 2 || mesh.degree(e.b) != 2) return std::nullopt;
    if (mesh.vertices[e.a].sides || mesh.vertices[e.b].sides) return std::nullopt;
    const int before = next_edge(mesh, e.a, cut), after = next_edge(mesh, e.b, cut);
    const int from = mesh.edges[before].other_end(e.a), to = mesh.edges[after].other_end(e.b);
    if (from == to) return std::nullopt;
    const Vec2 a = mesh.vertices[e.a].p, b = mesh.vertices[e.b].p;
    const Vec2 in = a - mesh.vertices[from].p, out = mesh.vertices[to].p - b;
    const double in_size = length(in), out_size = length(out);
    if (in_size < kShortestArm || out_size < kShortestArm) return std::nullopt;
    const double sine = cross(in, out) / (in_size * out_size);
    if (std::abs(sine) < kLeastSine) return std::nullopt;
    // a + s in = b - t out, with both arms prolonged towards the corner
    const double s = cross(b - a, out) / cross(in, out);
    const double t = cross(b - a, in) / cross(in, out);
    if (s < 0 || t > 0) return std::nullopt;
    const Vec2 corner = a + s * in;
    if (std::max(length(corner - a), length(corner - b)) > kFarthestPoint) return std::nullopt;
    if (corner.x < 0.5 || corner.y < 0.5 || corner.x > mesh.width - 0.5 || corner.y > mesh.height - 0.5)
        return std::nullopt;
    for (int k = 0; k < static_cast<int>(mesh.vertices.size()); ++k)
        if (k != e.a && k != e.b && !mesh.vertices[k].dead && inside_triangle(mesh.vertices[k].p, a, corner, b))
            return std::nullopt;
    if (length(b - a) > kSmallCut && !is_filled(view, e, a, corner, b)) return std::nullopt;
    return corner;
}

}  // namespace

Mesh with_whole_corners(const View& view) {
    Mesh out = view.mesh;
    for (int e = 0; e < static_cast<int>(out.edges.size()); ++e) {
        const std::optional<Vec2> corner = whole_corner(view, out, e);
        if (!corner) continue;
        const int kept = out.edges[e].a, gone = out.edges[e].b;
        out.merge_vertices(gone, kept);
        out.vertices[kept].p = *corner;
    }
    out.compact();
    return out;
}

}  // namespace rbdn
