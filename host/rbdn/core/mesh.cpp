// The planar net as an edge soup: every edge names the face on its left and on its right.
#include "mesh.hpp"

#include <algorithm>
#include <stdexcept>
#include <unordered_map>

namespace rbdn {

void Spokes::add(int e) {
    if (count == kMaxDegree) throw std::length_error("more than 16 edges meet at a vertex of the net");
    edge[count++] = e;
}

void Spokes::remove(int e) {
    int* const last = edge.data() + count;
    int* const found = std::find(edge.data(), last, e);
    if (found == last) return;
    std::copy(found + 1, last, found);
    --count;
}

void Mesh::make_grid(int image_width, int image_height, int square_px) {
    width = image_width;
    height = image_height;
    vertices.clear();
    edges.clear();
    faces.clear();
    spokes.clear();
    const int columns = std::max(1, (width + square_px / 2) / square_px);
    const int rows = std::max(1, (height + square_px / 2) / square_px);

    for (int j = 0; j <= rows; ++j) {
        for (int i = 0; i <= columns; ++i) {
            std::uint8_t sides = 0;
            if (i == 0) sides |= kLeftSide;
            if (i == columns) sides |= kRightSide;
            if (j == 0) sides |= kTopSide;
            if (j == rows) sides |= kBottomSide;
            add_vertex({static_cast<double>(width) * i / columns, static_cast<double>(height) * j / rows}, sides);
        }
    }
    for (int k = 0; k < rows * columns; ++k) add_face();

    const auto vertex = [&](int i, int j) { return j * (columns + 1) + i; };
    const auto face = [&](int i, int j) {
        return i < 0 || j < 0 || i >= columns || j >= rows ? kOutside : j * columns + i;
    };
    for (int j = 0; j <= rows; ++j)
        for (int i = 0; i < columns; ++i) add_edge(vertex(i, j), vertex(i + 1, j), face(i, j - 1), face(i, j));
    for (int j = 0; j < rows; ++j)
        for (int i = 0; i <= columns; ++i) add_edge(vertex(i, j), vertex(i, j + 1), face(i, j), face(i - 1, j));
}

int Mesh::add_vertex(Vec2 p, std::uint8_t sides) {
    Vertex v;
    v.p = v.held = p;
    v.sides = sides;
    v.id = next_vertex_id++;
    vertices.push_back(v);
    spokes.emplace_back();
    return static_cast<int>(vertices.size()) - 1;
}

int Mesh::add_edge(int a, int b, int left, int right) {
    const int e = static_cast<int>(edges.size());
    Edge edge;
    edge.a = a;
    edge.b = b;
    edge.left = left;
    edge.right = right;
    edges.push_back(edge);
    spokes[a].add(e);
    spokes[b].add(e);
    return e;
}

int Mesh::add_face() {
    Face face;
    face.id = next_face_id++;
    faces.push_back(face);
    return static_cast<int>(faces.size()) - 1;
}

bool Mesh::is_corner(int vertex) const {
    const std::uint8_t s = vertices[vertex].sides;
    return (s & (kLeftSide | kRightSide)) && (s & (kTopSide | kBottomSide));
}

void Mesh::place(int vertex, Vec2 target) {
    if (is_corner(vertex)) return;
    constexpr double kInset = 0.02;  // other vertices stay off the border, and border vertices off the corners
    Vertex& v = vertices[vertex];
    if (!(v.sides & (kLeftSide | kRightSide))) v.p.x = std::clamp(target.x, kInset, width - kInset);
    if (!(v.sides & (kTopSide | kBottomSide))) v.p.y = std::clamp(target.y, kInset, height - kInset);
}

void Mesh::kill_edge(int e) {
    edges[e].dead = true;
    spokes[edges[e].a].remove(e);
    spokes[edges[e].b].remove(e);
}

void Mesh::move_end(int e, int from, int to) {
    (edges[e].a == from ? edges[e].a : edges[e].b) = to;
    spokes[from].remove(e);
    spokes[to].add(e);
}

void Mesh::split_edge(int e, int vertex) {
    const Edge old = edges[e];
    move_end(e, old.b, vertex);
    add_edge(vertex, old.b, old.left, old.right);
}

bool Mesh::merge_vertices(int gone, int kept) {
    if (degree(gone) + degree(kept) > kMaxDegree) return false;
    const Spokes old = spokes[gone];
    for (int e : old) {
        if (edges[e].other_end(gone) == kept)
            kill_edge(e);
        else
            move_end(e, gone, kept);
    }
    vertices[gone].dead = true;
    // The longer-lived number survives, so that correspondences do.
    vertices[kept].id = std::min(vertices[kept].id, vertices[gone].id);
    return true;
}

void Mesh::remove_doubled_edges() {
    std::unordered_map<std::uint64_t, int> seen;
    std::vector<int> edge_count(faces.size(), 0);
    for (const Edge& e : edges) {
        if (e.dead) continue;
        if (e.left >= 0) ++edge_count[e.left];
        if (e.right >= 0) ++edge_count[e.right];
    }
    for (int k = 0; k < static_cast<int>(edges.size()); ++k) {
        if (edges[k].dead) continue;
        const Edge& e = edges[k];
        const auto low = static_cast<std::uint64_t>(std::min(e.a, e.b));
        const auto high = static_cast<std::uint64_t>(std::max(e.a, e.b));
        const auto [place, is_new] = seen.try_emplace((low << 32) | high, k);
        if (is_new) continue;
        Edge& first = edges[place->second];
        const int left = e.left_from(first.a);
        const int right = e.right_from(first.a);
        // Walking from first.a, the two edges enclose the face that both name, on opposite sides.
        const bool second_is_left = first.left == right;
        const bool second_is_right = first.right == left;
        const bool enclosed_is_left =
            second_is_left &&
            (!second_is_right || first.left == kOutside ||
             (first.right != kOutside && edge_count[first.left] <= edge_count[first.right]));
        if (enclosed_is_left)
            first.left = left;
        else if (second_is_right)
            first.right = right;
        else
            continue;  // not a pair that touches; the consistency check will refuse it
        kill_edge(k);
    }
}

void Mesh::rebuild_spokes() {
    spokes.assign(vertices.size(), Spokes{});
    for (int k = 0; k < static_cast<int>(edges.size()); ++k) {
        spokes[edges[k].a].add(k);
        spokes[edges[k].b].add(k);
    }
}

void Mesh::compact() {
    std::erase_if(edges, [](const Edge& e) { return e.dead || e.left == e.right || e.a == e.b; });
    std::vector<int> uses(vertices.size(), 0);
    for (const Edge& e : edges) {
        ++uses[e.a];
        ++uses[e.b];
    }
    std::vector<int> place(vertices.size(), -1);
    int kept = 0;
    for (std::size_t k = 0; k < vertices.size(); ++k) {
        if (uses[k] == 0) continue;
        place[k] = kept;
        vertices[kept] = vertices[k];
        vertices[kept].dead = false;
        ++kept;
    }
    vertices.resize(kept);
    for (Edge& e : edges) {
        e.a = place[e.a];
        e.b = place[e.b];
    }
    rebuild_spokes();
}

bool Mesh::compact_faces() {
    std::vector<int> place(faces.size(), -1);
    for (const Edge& e : edges) {
        if (e.left >= 0) place[e.left] = 0;
        if (e.right >= 0) place[e.right] = 0;
    }
    int kept = 0;
    for (std::size_t k = 0; k < faces.size(); ++k) {
        if (place[k] < 0) continue;
        place[k] = kept;
        faces[kept] = faces[k];
        ++kept;
    }
    if (kept == static_cast<int>(faces.size())) return false;
    faces.resize(kept);
    for (Edge& e : edges) {
        if (e.left >= 0) e.left = place[e.left];
        if (e.right >= 0) e.right = place[e.right];
    }
    return true;
}

Fan fan_at(const Mesh& mesh, int vertex) {
    Fan fan;
    std::array<double, kMaxDegree> angle{};
    for (int e : mesh.spokes[vertex]) {
        const Vec2 d = mesh.vertices[mesh.edges[e].other_end(vertex)].p - mesh.vertices[vertex].p;
        const double turn = turn_of(d);
        int at = fan.count++;
        for (; at > 0 && angle[at - 1] > turn; --at) {
            angle[at] = angle[at - 1];
            fan.edge[at] = fan.edge[at - 1];
        }
        angle[at] = turn;
        fan.edge[at] = e;
    }
    return fan;
}

std::vector<int> Mesh::vertices_with_torn_wedges() const {
    std::vector<int> torn;
    for (int v = 0; v < static_cast<int>(vertices.size()); ++v) {
        if (degree(v) == 2) {  // most are, and two edges need no sorting
            const Edge& here = edges[spokes[v].edge[0]];
            const Edge& next = edges[spokes[v].edge[1]];
            if (here.right_from(v) != next.left_from(v) || next.right_from(v) != here.left_from(v)) torn.push_back(v);
            continue;
        }
        const Fan fan = fan_at(*this, v);
        for (int k = 0; k < fan.count; ++k) {
            // Angles grow clockwise on the screen: the wedge after an edge lies to its right.
            const Edge& here = edges[fan.edge[k]];
            const Edge& next = edges[fan.edge[(k + 1) % fan.count]];
            if (here.right_from(v) != next.left_from(v)) {
                torn.push_back(v);
                break;
            }
        }
    }
    return torn;
}

}  // namespace rbdn
