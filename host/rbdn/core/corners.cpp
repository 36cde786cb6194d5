// Corners that the net cuts off with a short edge, made whole for output.
#include "corners.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace rbdn {

namespace {

constexpr double kLongestCut = 7.0;
constexpr double kShortestArm = 9.0;
constexpr double kLeastSine = 0.35;      // flatter corners may be arcs
constexpr double kFarthestPoint = 7.0;   // of the whole corner from the cut

// The edge that continues a chain beyond `edge` at `vertex`.
int next_edge(const Mesh& mesh, int vertex, int edge) {
    const Spokes& spokes = mesh.spokes[vertex];
    return spokes.edge[0] == edge ? spokes.edge[1] : spokes.edge[0];
}

// Where the two edges beside a short edge would meet.
std::optional<Vec2> whole_corner(const Mesh& mesh, int cut) {
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
    return corner;
}

}  // namespace

Mesh with_whole_corners(const Mesh& mesh) {
    Mesh out = mesh;
    for (int e = 0; e < static_cast<int>(out.edges.size()); ++e) {
        const std::optional<Vec2> corner = whole_corner(out, e);
        if (!corner) continue;
        const int kept = out.edges[e].a, gone = out.edges[e].b;
        out.merge_vertices(gone, kept);
        out.vertices[kept].p = *corner;
    }
    out.compact();
    return out;
}

}  // namespace rbdn
