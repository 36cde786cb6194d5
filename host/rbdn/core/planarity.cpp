// Is the net still a plane graph? Everything that changes it asks here before the change is kept.
#include "planarity.hpp"

#include <algorithm>

namespace rbdn {

namespace {

constexpr double kCell = 16.0;

// Edges without a common vertex may not even touch: along a touch, faces would have no area.
bool meet(Vec2 a, Vec2 b, Vec2 c, Vec2 d) {
    const Vec2 ab = b - a, cd = d - c;
    const double c_side = cross(ab, c - a), d_side = cross(ab, d - a);
    if (c_side * d_side > 0) return false;
    const double a_side = cross(cd, a - c), b_side = cross(cd, b - c);
    if (a_side * b_side > 0) return false;
    if (c_side != 0 || d_side != 0 || a_side != 0 || b_side != 0) return true;
    // All on one line.
    return std::max(std::min(a.x, b.x), std::min(c.x, d.x)) <= std::min(std::max(a.x, b.x), std::max(c.x, d.x)) &&
           std::max(std::min(a.y, b.y), std::min(c.y, d.y)) <= std::min(std::max(a.y, b.y), std::max(c.y, d.y));
}

// Edges from a common vertex in the same direction.
bool overlap(Vec2 common, Vec2 a, Vec2 b) {
    return cross(a - common, b - common) == 0 && dot(a - common, b - common) >= 0;
}

// Cells of a coarse grid that an edge's bounding box covers.
struct CellRange {
    int x0, x1, y0, y1;
};

// Edges sorted into the cells of a coarse grid, so that only neighbours are compared.
class EdgeGrid {
public:
    explicit EdgeGrid(const Mesh& mesh)
        : mesh_(mesh), columns_(static_cast<int>(mesh.width / kCell) + 1),
          start_(static_cast<std::size_t>(columns_) * (static_cast<int>(mesh.height / kCell) + 1) + 1, 0) {
        for (const Edge& e : mesh.edges) for_each_cell(e, [&](int cell) { ++start_[cell + 1]; });
        for (std::size_t k = 1; k < start_.size(); ++k) start_[k] += start_[k - 1];
        items_.resize(start_.back());
        std::vector<int> fill(start_.begin(), start_.end() - 1);
        for (int k = 0; k < static_cast<int>(mesh.edges.size()); ++k)
            for_each_cell(mesh.edges[k], [&](int cell) { items_[fill[cell]++] = k; });
    }

    void collect_crossing(std::vector<int>& bad) const {
        for (std::size_t cell = 0; cell + 1 < start_.size(); ++cell)
            for (int i = start_[cell]; i < start_[cell + 1]; ++i)
                for (int j = i + 1; j < start_[cell + 1]; ++j) {
                    const Edge& e = mesh_.edges[items_[i]];
                    const Edge& f = mesh_.edges[items_[j]];
                    if (!are_at_fault(e, f)) continue;
                    bad.push_back(items_[i]);
                    bad.push_back(items_[j]);
                }
    }

private:
    bool are_at_fault(const Edge& e, const Edge& f) const {
        const bool by_a = e.a == f.a || e.a == f.b, by_b = e.b == f.a || e.b == f.b;
        if (!by_a && !by_b) return meet(at(e.a), at(e.b), at(f.a), at(f.b));
        const int common = by_a ? e.a : e.b;
        return overlap(at(common), at(e.other_end(common)), at(f.other_end(common)));
    }

    Vec2 at(int vertex) const { return mesh_.vertices[vertex].p; }

    template <class Visit>
    void for_each_cell(const Edge& e, Visit visit) const {
        // Vertices off the border never leave the image, so border edges cannot be crossed.
        if (e.dead || e.on_border()) return;
        const Vec2 a = at(e.a), b = at(e.b);
        const CellRange r{static_cast<int>(std::min(a.x, b.x) / kCell), static_cast<int>(std::max(a.x, b.x) / kCell),
                          static_cast<int>(std::min(a.y, b.y) / kCell), static_cast<int>(std::max(a.y, b.y) / kCell)};
        for (int y = r.y0; y <= r.y1; ++y)
            for (int x = r.x0; x <= r.x1; ++x) visit(y * columns_ + x);
    }

    const Mesh& mesh_;
    int columns_;
    std::vector<int> start_;
    std::vector<int> items_;
};

// Edges of the image border that run backwards or nowhere: their vertices have passed each other, perhaps by less
// than a pixel, where no row or column sees it. And inner edges that lie on the border.
void collect_folded_border(const Mesh& mesh, std::vector<int>& bad) {
    const Vec2 centre{0.5 * mesh.width, 0.5 * mesh.height};
    for (int k = 0; k < static_cast<int>(mesh.edges.size()); ++k) {
        const Edge& e = mesh.edges[k];
        if (e.dead) continue;
        if (!e.on_border()) {
            if (mesh.vertices[e.a].sides & mesh.vertices[e.b].sides) bad.push_back(k);
            continue;
        }
        // Positive where the centre, and so the image, lies to the right of the edge.
        const double turn = cross(mesh.along(e), centre - mesh.vertices[e.a].p);
        if (e.left == kOutside ? turn <= 0 : turn >= 0) bad.push_back(k);
    }
}

}  // namespace

std::vector<int> find_faults(const Mesh& mesh, const Crossings& crossings) {
    std::vector<int> bad;
    crossings.rows().collect_bad_edges(bad);
    crossings.columns().collect_bad_edges(bad);
    for (int v : mesh.vertices_with_torn_wedges())
        for (int e : mesh.spokes[v]) bad.push_back(e);
    EdgeGrid(mesh).collect_crossing(bad);
    collect_folded_border(mesh, bad);
    std::sort(bad.begin(), bad.end());
    bad.erase(std::unique(bad.begin(), bad.end()), bad.end());
    return bad;
}

}  // namespace rbdn
