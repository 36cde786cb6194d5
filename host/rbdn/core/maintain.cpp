// Maintenance of the net's shape: insertion, deletion, thorns, contacts (section 2.3 of the paper).
#include "maintain.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "near.hpp"
#include "planarity.hpp"

namespace rbdn {

namespace {

constexpr double kShortEdge = 3.0;
constexpr double kFlatHeight = 0.7;   // of a vertex over the line through its neighbours
constexpr double kThornAngle = 25.0 * std::numbers::pi / 180.0;
constexpr double kThornWidth = 6.0;   // px; a wider wedge is the tip of something
constexpr double kTouch = 0.8;        // distance at which a vertex and an edge are in contact
constexpr double kNearEnd = 1.2;      // contacts this near to an edge's end go to the end
constexpr double kBadFit = 0.8;       // delta of the paper, as mean disparity in px

bool may_touch(const Mesh& mesh, int v, const Spared& spared) {
    return !mesh.vertices[v].dead && !spared.contains(mesh.vertices[v].id);
}

bool are_joined(const Mesh& mesh, int a, int b) {
    return std::any_of(mesh.spokes[a].begin(), mesh.spokes[a].end(),
                       [&](int e) { return mesh.edges[e].other_end(a) == b; });
}

bool same_side(const Mesh& mesh, int a, int b) { return mesh.vertices[a].sides & mesh.vertices[b].sides; }

// Removes a vertex of degree two by joining its neighbours.
bool drop_flat_vertex(Mesh& mesh, int v, const NearVertices& near, const Spared& spared) {
    if (mesh.degree(v) != 2 || mesh.is_corner(v)) return false;
    const int first = mesh.spokes[v].edge[0], second = mesh.spokes[v].edge[1];
    const int a = mesh.edges[first].other_end(v), b = mesh.edges[second].other_end(v);
    if (a == b || !may_touch(mesh, a, spared) || !may_touch(mesh, b, spared)) return false;
    const Vec2 pa = mesh.vertices[a].p, pb = mesh.vertices[b].p, p = mesh.vertices[v].p;
    const double chord = length(pb - pa);
    if (chord < 1e-9) return false;
    const bool flat = std::abs(cross(pb - pa, p - pa)) / chord < kFlatHeight && dot(pa - p, pb - p) < 0;
    const bool short_edge = std::min(length(pa - p), length(pb - p)) < kShortEdge;
    if (!flat && !short_edge) return false;
    if (mesh.vertices[v].sides ? !(same_side(mesh, a, v) && same_side(mesh, b, v)) : false) return false;
    if (are_joined(mesh, a, b) || !near.triangle_is_empty(a, v, b)) return false;
    const bool useless = flat && mesh.vertices[v].fresh;
    const int left = mesh.edges[first].left_from(a), right = mesh.edges[first].right_from(a);
    mesh.kill_edge(first);
    mesh.kill_edge(second);
    mesh.vertices[v].dead = true;
    const int joined = mesh.add_edge(a, b, left, right);
    mesh.edges[joined].settled = useless;
    return true;
}

// Contracts a short edge between two vertices that both matter.
bool contract_short_edge(Mesh& mesh, int e, NearVertices& near, const Spared& spared) {
    const Edge edge = mesh.edges[e];
    if (edge.dead || mesh.edge_length(edge) >= kShortEdge) return false;
    int gone = edge.a, kept = edge.b;
    if (!may_touch(mesh, gone, spared) || !may_touch(mesh, kept, spared)) return false;
    const auto rank = [&](int v) {
        return 100 * (mesh.is_corner(v) ? 2 : mesh.vertices[v].sides ? 1 : 0) + mesh.degree(v);
    };
    if (rank(gone) > rank(kept)) std::swap(gone, kept);
    if (mesh.is_corner(gone)) return false;
    if (mesh.vertices[gone].sides && !same_side(mesh, gone, kept)) return false;
    if (mesh.degree(gone) + mesh.degree(kept) > kMaxDegree) return false;
    for (int spoke : mesh.spokes[gone]) {
        const int far = mesh.edges[spoke].other_end(gone);
        if (far == kept) continue;
        if (!may_touch(mesh, far, spared) || !near.triangle_is_empty(gone, far, kept)) return false;
    }
    const bool both_free = !mesh.vertices[gone].sides && !mesh.vertices[kept].sides &&
                           mesh.degree(gone) == mesh.degree(kept);
    const Vec2 middle = 0.5 * (mesh.vertices[gone].p + mesh.vertices[kept].p);
    if (!mesh.merge_vertices(gone, kept)) return false;
    if (both_free) {
        mesh.vertices[kept].p = middle;
        near.add(kept);
    }
    return true;
}

double angle_between(Vec2 a, Vec2 b) { return std::abs(std::atan2(cross(a, b), dot(a, b))); }

// Closes the wedge between two neighbouring edges of a vertex, from the vertex to the end of the shorter edge.
bool zip_wedge(Mesh& mesh, int v, int e1, int e2, int face, const NearVertices& near, const Spared& spared) {
    int shorter = e1, longer = e2;
    if (mesh.edge_length(mesh.edges[shorter]) > mesh.edge_length(mesh.edges[longer])) std::swap(shorter, longer);
    const int a = mesh.edges[shorter].other_end(v), b = mesh.edges[longer].other_end(v);
    if (a == b || mesh.edges[shorter].on_border() || mesh.edges[longer].on_border()) return false;
    if (!may_touch(mesh, a, spared) || !may_touch(mesh, b, spared)) return false;
    if (mesh.vertices[a].sides && mesh.vertices[b].sides) return false;
    const Vec2 to_a = mesh.vertices[a].p - mesh.vertices[v].p, to_b = mesh.vertices[b].p - mesh.vertices[v].p;
    if (dot(to_a, to_b) <= 0) return false;
    const double angle = angle_between(to_a, to_b);
    const double apart = std::abs(cross(to_a, to_b)) / length(to_b);
    if (!((angle < kThornAngle && apart < kThornWidth) || (apart < 1.0 && std::sin(angle) < 0.8))) return false;
    if (mesh.degree(a) >= kMaxDegree || are_joined(mesh, a, b) || !near.triangle_is_empty(v, a, b)) return false;

    // The wedge's face gives up the strip to the face beyond the longer edge.
    const int beyond = mesh.edges[longer].other_face(face);
    Edge& short_edge = mesh.edges[shorter];
    (short_edge.left == face ? short_edge.left : short_edge.right) = beyond;
    const int left = mesh.edges[longer].left_from(v), right = mesh.edges[longer].right_from(v);
    mesh.kill_edge(longer);
    mesh.add_edge(a, b, left, right);
    if (mesh.edges[shorter].left == mesh.edges[shorter].right) mesh.kill_edge(shorter);
    return true;
}

// Face in which a direction leaves a vertex.
int face_towards(const Mesh& mesh, int v, Vec2 direction) {
    const Fan fan = fan_at(mesh, v);
    if (fan.count == 0) return kOutside;
    const double turn = turn_of(direction);
    int before = fan.count - 1;
    for (int k = 0; k < fan.count; ++k) {
        const Vec2 d = mesh.vertices[mesh.edges[fan.edge[k]].other_end(v)].p - mesh.vertices[v].p;
        if (turn_of(d) <= turn) before = k;
    }
    return mesh.edges[fan.edge[before]].right_from(v);
}

bool is_near_border(const Mesh& mesh, int v) {
    const Vec2 p = mesh.vertices[v].p;
    return std::min({p.x, p.y, mesh.width - p.x, mesh.height - p.y}) < kTouch;
}

// Joins vertex v to edge e, which it touches. Returns the vertex at the contact, or -1 where there is none.
int snap_vertex(Mesh& mesh, int v, int e, const NearVertices& near, const Spared& spared) {
    const Edge edge = mesh.edges[e];
    const Vec2 p = mesh.vertices[v].p, pa = mesh.vertices[edge.a].p, pb = mesh.vertices[edge.b].p;
    if (!may_touch(mesh, edge.a, spared) || !may_touch(mesh, edge.b, spared)) return -1;
    const double t = nearest_fraction(p, pa, pb);
    const Vec2 foot = pa + t * (pb - pa);
    const double gap = length(foot - p);
    if (gap >= kTouch) return -1;
    const Vec2 normal = left_normal(pb - pa);
    const int face = dot(p - foot, normal) > 0 ? edge.left : edge.right;
    if (face == kOutside) return -1;
    if (gap > 1e-6 && face_towards(mesh, v, foot - p) != face) return -1;

    const double to_a = length(p - pa), to_b = length(p - pb);
    if (std::min(to_a, to_b) < kNearEnd) {
        const int end = to_a <= to_b ? edge.a : edge.b;
        if (are_joined(mesh, v, end) || mesh.is_corner(end)) return -1;
        if (mesh.vertices[end].sides != 0) return -1;
        for (int spoke : mesh.spokes[v]) {
            const int far = mesh.edges[spoke].other_end(v);
            if (!may_touch(mesh, far, spared) || !near.triangle_is_empty(v, far, end)) return -1;
        }
        return mesh.merge_vertices(v, end) ? end : -1;
    }
    if (mesh.degree(v) + 2 > kMaxDegree || !near.triangle_is_empty(edge.a, v, edge.b)) return -1;
    mesh.split_edge(e, v);
    return v;
}

}  // namespace

int transact(Mesh& mesh, Crossings& crossings, Mesh& saved, const Operation& operation) {
    constexpr int kTries = 6;
    Spared spared;
    for (int attempt = 0; attempt < kTries; ++attempt) {
        const int changes = operation(mesh, spared);
        if (changes == 0) {
            if (attempt > 0) {
                mesh = saved;
                crossings.build(mesh, crossings.step());
            }
            return 0;
        }
        mesh.compact();
        crossings.build(mesh, crossings.step());
        const std::vector<int> bad = find_faults(mesh, crossings);
        if (bad.empty()) {
            for (Vertex& v : mesh.vertices) v.held = v.p;
            saved = mesh;
            return changes;
        }
        std::set<int> offenders;
        for (int e : bad) offenders.insert({mesh.edges[e].a, mesh.edges[e].b});
        // New vertices do not exist before the operation, so their neighbours stand in for them.
        std::set<int> widened = offenders;
        for (int v : offenders)
            if (attempt >= 2 || mesh.vertices[v].id >= saved.next_vertex_id)
                for (int e : mesh.spokes[v]) widened.insert(mesh.edges[e].other_end(v));
        for (int v : widened) spared.insert(mesh.vertices[v].id);
        mesh = saved;
    }
    crossings.build(mesh, crossings.step());
    return 0;
}

int insert_vertices(Mesh& mesh, const std::vector<Disparity>& disparity, const Spared& spared) {
    int made = 0;
    const int count = static_cast<int>(mesh.edges.size());
    for (int k = 0; k < count; ++k) {
        const Edge edge = mesh.edges[k];
        const double size = mesh.edge_length(edge);
        if (edge.on_border() || edge.settled || size <= 2.5 * kShortEdge) continue;
        if (!may_touch(mesh, edge.a, spared) || !may_touch(mesh, edge.b, spared)) continue;
        const Disparity& d = disparity[k];
        const double worst = 2.0 / size * std::max({d.left_claimed[0], d.left_claimed[1], d.right_claimed[0],
                                                    d.right_claimed[1]});
        if (worst <= kBadFit) continue;
        const double net = std::max(std::abs(half_displacement(d, 0, size)), std::abs(half_displacement(d, 1, size)));
        const bool balanced = net <= 0.5 * worst + 0.3;
        const bool resting = mesh.vertices[edge.a].moved < 1.0 && mesh.vertices[edge.b].moved < 1.0;
        if (!balanced && !resting) continue;
        const int middle = mesh.add_vertex(0.5 * (mesh.vertices[edge.a].p + mesh.vertices[edge.b].p), 0);
        mesh.vertices[middle].fresh = true;
        mesh.split_edge(k, middle);
        ++made;
    }
    return made;
}

int delete_vertices(Mesh& mesh, const Spared& spared) {
    int gone = 0;
    NearVertices near(mesh);
    for (int v = 0; v < static_cast<int>(mesh.vertices.size()); ++v)
        if (may_touch(mesh, v, spared) && drop_flat_vertex(mesh, v, near, spared)) ++gone;
    for (int e = 0; e < static_cast<int>(mesh.edges.size()); ++e)
        if (contract_short_edge(mesh, e, near, spared)) ++gone;
    if (gone > 0) mesh.remove_doubled_edges();
    return gone;
}

int zip_thorns(Mesh& mesh, const Spared& spared) {
    int zipped = 0;
    const NearVertices near(mesh);
    for (int v = 0; v < static_cast<int>(mesh.vertices.size()); ++v) {
        if (!may_touch(mesh, v, spared) || mesh.degree(v) < 2) continue;
        for (bool again = true; again;) {
            again = false;
            const Fan fan = fan_at(mesh, v);
            for (int k = 0; k < fan.count && fan.count >= 2; ++k) {
                const int e1 = fan.edge[k], e2 = fan.edge[(k + 1) % fan.count];
                const int face = mesh.edges[e1].right_from(v);
                if (e1 == e2 || face == kOutside || mesh.edges[e2].left_from(v) != face) continue;
                if (zip_wedge(mesh, v, e1, e2, face, near, spared)) {
                    ++zipped;
                    again = mesh.degree(v) >= 2;
                    break;
                }
            }
        }
    }
    if (zipped > 0) mesh.remove_doubled_edges();
    return zipped;
}

int snap_contacts(Mesh& mesh, const Spared& spared) {
    const NearVertices near(mesh);
    Buckets edges(mesh);
    const auto file = [&](int e) {
        const Vec2 a = mesh.vertices[mesh.edges[e].a].p, b = mesh.vertices[mesh.edges[e].b].p;
        edges.add(e, {std::min(a.x, b.x) - kTouch, std::min(a.y, b.y) - kTouch},
                  {std::max(a.x, b.x) + kTouch, std::max(a.y, b.y) + kTouch});
    };
    for (int e = 0; e < static_cast<int>(mesh.edges.size()); ++e)
        if (!mesh.edges[e].on_border()) file(e);

    int snapped = 0;
    std::vector<int> touching;
    for (int v = 0; v < static_cast<int>(mesh.vertices.size()); ++v) {
        if (!may_touch(mesh, v, spared) || mesh.vertices[v].sides != 0) continue;
        const Vec2 p = mesh.vertices[v].p;
        touching.clear();
        edges.any_near(p, p, [&](int e) {
            const Edge& edge = mesh.edges[e];
            if (edge.dead || edge.a == v || edge.b == v) return false;
            const Vec2 a = mesh.vertices[edge.a].p, b = mesh.vertices[edge.b].p;
            if (p.x >= std::min(a.x, b.x) - kTouch && p.x <= std::max(a.x, b.x) + kTouch &&
                p.y >= std::min(a.y, b.y) - kTouch && p.y <= std::max(a.y, b.y) + kTouch)
                touching.push_back(e);
            return false;
        });
        // Oldest edge first, whatever the order of the buckets.
        std::sort(touching.begin(), touching.end());
        for (int e : touching) {
            const int contact = snap_vertex(mesh, v, e, near, spared);
            if (contact < 0) continue;
            for (int spoke : mesh.spokes[contact]) file(spoke);
            ++snapped;
            break;
        }
    }
    if (snapped > 0) mesh.remove_doubled_edges();
    return snapped;
}

int snap_to_border(Mesh& mesh, const Spared& spared) {
    int snapped = 0;
    for (int v = 0; v < static_cast<int>(mesh.vertices.size()); ++v) {
        if (!may_touch(mesh, v, spared) || mesh.vertices[v].sides != 0 || !is_near_border(mesh, v)) continue;
        for (int e = 0; e < static_cast<int>(mesh.edges.size()); ++e) {
            const Edge edge = mesh.edges[e];
            if (edge.dead || !edge.on_border()) continue;
            const Vec2 p = mesh.vertices[v].p, a = mesh.vertices[edge.a].p, b = mesh.vertices[edge.b].p;
            const double t = nearest_fraction(p, a, b);
            const Vec2 foot = a + t * (b - a);
            if (length(foot - p) >= kTouch) continue;
            if (!may_touch(mesh, edge.a, spared) || !may_touch(mesh, edge.b, spared)) continue;
            const int face = edge.left == kOutside ? edge.right : edge.left;
            if (face_towards(mesh, v, foot - p) != face) continue;
            const int near = t < 0.5 ? edge.a : edge.b;
            if (length(mesh.vertices[near].p - p) < kNearEnd) {
                if (!mesh.merge_vertices(v, near)) continue;
            } else {
                if (mesh.degree(v) + 2 > kMaxDegree) continue;
                mesh.vertices[v].p = foot;
                mesh.vertices[v].sides = mesh.vertices[edge.a].sides & mesh.vertices[edge.b].sides;
                mesh.split_edge(e, v);
            }
            ++snapped;
            break;
        }
    }
    if (snapped > 0) mesh.remove_doubled_edges();
    return snapped;
}

}  // namespace rbdn
