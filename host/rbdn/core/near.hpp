// What lies near a point: a coarse grid of buckets, so that contacts are not looked for among all vertices and edges.
#pragma once

#include <algorithm>
#include <vector>

#include "mesh.hpp"

namespace rbdn {

// Items are filed under every cell that their bounding box touches. They are never taken out: whoever asks must
// look at where an item is now.
class Buckets {
public:
    explicit Buckets(const Mesh& mesh)
        : columns_(cell(mesh.width) + 1), rows_(cell(mesh.height) + 1),
          first_(static_cast<std::size_t>(columns_) * rows_, -1) {}

    void add(int item, Vec2 low, Vec2 high) {
        for_each_cell(low, high, [&](int& first) {
            entries_.push_back({item, first});
            first = static_cast<int>(entries_.size()) - 1;
        });
    }

    // Calls `visit` with the items filed near a box, some of them more than once, until it returns true.
    template <class Visit>
    bool any_near(Vec2 low, Vec2 high, Visit visit) const {
        bool found = false;
        for_each_cell(low, high, [&](const int& first) {
            for (int k = first; k >= 0 && !found; k = entries_[k].next) found = visit(entries_[k].item);
        });
        return found;
    }

private:
    static constexpr double kCell = 16.0;

    struct Entry {
        int item;
        int next;  // in the same cell, -1 for none
    };

    static int cell(double coordinate) { return static_cast<int>(coordinate / kCell); }
    int column(double x) const { return std::clamp(cell(x), 0, columns_ - 1); }
    int row(double y) const { return std::clamp(cell(y), 0, rows_ - 1); }

    template <class Visit>
    void for_each_cell(Vec2 low, Vec2 high, Visit visit) {
        for (int y = row(low.y); y <= row(high.y); ++y)
            for (int x = column(low.x); x <= column(high.x); ++x) visit(first_[y * columns_ + x]);
    }
    template <class Visit>
    void for_each_cell(Vec2 low, Vec2 high, Visit visit) const {
        for (int y = row(low.y); y <= row(high.y); ++y)
            for (int x = column(low.x); x <= column(high.x); ++x) visit(first_[y * columns_ + x]);
    }

    int columns_;
    int rows_;
    std::vector<int> first_;  // entry of each cell
    std::vector<Entry> entries_;
};

// The vertices of a mesh, for the empty-triangle test.
class NearVertices {
public:
    explicit NearVertices(const Mesh& mesh) : mesh_(mesh), buckets_(mesh) {
        for (int v = 0; v < static_cast<int>(mesh.vertices.size()); ++v) add(v);
    }

    // Also for a vertex that was moved.
    void add(int v) { buckets_.add(v, mesh_.vertices[v].p, mesh_.vertices[v].p); }

    // No other vertex lies in the triangle of three of them.
    bool triangle_is_empty(int a, int b, int c) const {
        const Vec2 pa = mesh_.vertices[a].p, pb = mesh_.vertices[b].p, pc = mesh_.vertices[c].p;
        const Vec2 low{std::min({pa.x, pb.x, pc.x}), std::min({pa.y, pb.y, pc.y})};
        const Vec2 high{std::max({pa.x, pb.x, pc.x}), std::max({pa.y, pb.y, pc.y})};
        return !buckets_.any_near(low, high, [&](int v) {
            if (v == a || v == b || v == c || mesh_.vertices[v].dead) return false;
            const Vec2 p = mesh_.vertices[v].p;
            return p.x >= low.x && p.x <= high.x && p.y >= low.y && p.y <= high.y && inside_triangle(p, pa, pb, pc);
        });
    }

private:
    const Mesh& mesh_;
    Buckets buckets_;
};

}  // namespace rbdn
