// Faces as closed walks along their edges, and faces that fell apart made into separate ones.
#include "loops.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace rbdn {

namespace {

// A half-edge is 2 * edge + direction; direction 0 walks from a to b.
int origin_of(const Mesh& mesh, int half) {
    const Edge& e = mesh.edges[half / 2];
    return half % 2 == 0 ? e.a : e.b;
}

double signed_area(const Mesh& mesh, const std::vector<int>& vertices) {
    double twice = 0;
    for (std::size_t k = 0; k < vertices.size(); ++k)
        twice += cross(mesh.vertices[vertices[k]].p, mesh.vertices[vertices[(k + 1) % vertices.size()]].p);
    // With y downwards, a face kept on the left is walked anticlockwise on the screen: the sum is negative.
    return -0.5 * twice;
}

bool contains(const Mesh& mesh, const Loop& loop, Vec2 p) {
    bool inside = false;
    const std::size_t n = loop.vertices.size();
    for (std::size_t k = 0; k < n; ++k) {
        const Vec2 a = mesh.vertices[loop.vertices[k]].p;
        const Vec2 b = mesh.vertices[loop.vertices[(k + 1) % n]].p;
        if ((a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x)) inside = !inside;
    }
    return inside;
}

bool shares_vertex(const Loop& a, const Loop& b) {
    return std::find_first_of(a.vertices.begin(), a.vertices.end(), b.vertices.begin(), b.vertices.end()) !=
           a.vertices.end();
}

// By Euler's formula: with more pieces than faces, one fell apart.
bool all_in_one_piece(const Mesh& mesh) {
    std::vector<int> root(mesh.vertices.size());
    std::iota(root.begin(), root.end(), 0);
    const auto find = [&](int v) {
        while (root[v] != v) v = root[v] = root[root[v]];
        return v;
    };
    std::vector<char> has_edges(mesh.faces.size(), 0);
    int edges = 0, joins = 0;
    for (const Edge& e : mesh.edges) {
        if (e.dead) continue;
        ++edges;
        if (e.left >= 0) has_edges[e.left] = 1;
        if (e.right >= 0) has_edges[e.right] = 1;
        const int a = find(e.a), b = find(e.b);
        joins += a != b;
        root[a] = b;
    }
    // V - E + F = 1 + C, where C = V - joins, and F counts the outside too.
    const auto faces = std::count(has_edges.begin(), has_edges.end(), 1) + 1;
    return faces == 1 + edges - joins;
}

}  // namespace

std::vector<Loop> trace_loops(const Mesh& mesh, const std::vector<int>& group_of) {
    const auto group = [&](int face) { return face < 0 ? kOutside : group_of[face]; };
    const int halves = 2 * static_cast<int>(mesh.edges.size());
    const auto left_group = [&](int half) {
        const Edge& e = mesh.edges[half / 2];
        return group(half % 2 == 0 ? e.left : e.right);
    };

    std::vector<int> next(halves, -1);
    for (int v = 0; v < static_cast<int>(mesh.vertices.size()); ++v) {
        const Fan fan = fan_at(mesh, v);
        // Only edges between different groups; the walk turns into the next one clockwise on the screen.
        Fan outline;
        for (int k = 0; k < fan.count; ++k) {
            const Edge& e = mesh.edges[fan.edge[k]];
            if (group(e.left) != group(e.right)) outline.edge[outline.count++] = fan.edge[k];
        }
        for (int k = 0; k < outline.count; ++k) {
            const int arriving = outline.edge[k];
            const int leaving = outline.edge[(k + 1) % outline.count];
            const int half_in = 2 * arriving + (mesh.edges[arriving].b == v ? 0 : 1);
            next[half_in] = 2 * leaving + (mesh.edges[leaving].a == v ? 0 : 1);
        }
    }

    std::vector<Loop> loops;
    std::vector<char> walked(halves, 0);
    for (int start = 0; start < halves; ++start) {
        if (walked[start] || next[start] < 0 || left_group(start) < 0) continue;
        Loop loop;
        loop.face = left_group(start);
        for (int half = start; half >= 0 && !walked[half]; half = next[half]) {
            walked[half] = 1;
            loop.vertices.push_back(origin_of(mesh, half));
            loop.edges.push_back(half / 2);
        }
        loop.area = signed_area(mesh, loop.vertices);
        loops.push_back(std::move(loop));
    }
    return loops;
}

std::vector<int> owners_of_loops(const Mesh& mesh, const std::vector<Loop>& loops) {
    std::vector<int> owner(loops.size());
    for (std::size_t k = 0; k < loops.size(); ++k) {
        owner[k] = static_cast<int>(k);
        if (loops[k].area > 0) continue;
        // The smallest outer loop of the same face round it; a hole may touch that loop at a vertex.
        int best = -1;
        for (std::size_t o = 0; o < loops.size(); ++o) {
            if (loops[o].face != loops[k].face || loops[o].area <= 0 || loops[o].area < -loops[k].area) continue;
            const bool round = contains(mesh, loops[o], mesh.vertices[loops[k].vertices[0]].p) ||
                               shares_vertex(loops[o], loops[k]);
            if (round && (best < 0 || loops[o].area < loops[best].area)) best = static_cast<int>(o);
        }
        if (best >= 0) owner[k] = best;
    }
    return owner;
}

int split_faces(Mesh& mesh) {
    if (all_in_one_piece(mesh)) return 0;
    std::vector<int> itself(mesh.faces.size());
    for (std::size_t k = 0; k < itself.size(); ++k) itself[k] = static_cast<int>(k);
    const std::vector<Loop> loops = trace_loops(mesh, itself);

    std::vector<int> outer_loops(mesh.faces.size(), 0);
    std::vector<int> largest(mesh.faces.size(), -1);
    bool fell_apart = false;
    for (std::size_t k = 0; k < loops.size(); ++k) {
        if (loops[k].area <= 0) continue;
        const int face = loops[k].face;
        if (++outer_loops[face] > 1) fell_apart = true;
        if (largest[face] < 0 || loops[k].area > loops[largest[face]].area) largest[face] = static_cast<int>(k);
    }
    if (!fell_apart) return 0;

    const std::vector<int> owner = owners_of_loops(mesh, loops);
    std::vector<int> new_face(loops.size(), -1);
    int made = 0;
    for (std::size_t k = 0; k < loops.size(); ++k) {
        const int face = loops[k].face;
        if (outer_loops[face] < 2 || owner[k] != static_cast<int>(k) || largest[face] == static_cast<int>(k)) continue;
        if (loops[k].area <= 0) continue;  // a hole that no loop claims stays with the face
        new_face[k] = mesh.add_face();
        Face& piece = mesh.faces[new_face[k]];
        const Face& whole = mesh.faces[face];
        piece.mean = whole.mean;
        piece.region = -1;
        piece.parent = whole.region >= 0 ? whole.region : whole.parent;
        ++made;
    }
    for (std::size_t k = 0; k < loops.size(); ++k) {
        const int target = new_face[owner[k]];
        if (target < 0) continue;
        for (std::size_t n = 0; n < loops[k].edges.size(); ++n) {
            Edge& e = mesh.edges[loops[k].edges[n]];
            (e.a == loops[k].vertices[n] ? e.left : e.right) = target;
        }
    }
    return made;
}

}  // namespace rbdn
