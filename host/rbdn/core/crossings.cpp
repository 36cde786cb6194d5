// Where the net's edges cross the lines through the pixel centres.
#include "crossings.hpp"

#include <algorithm>

namespace rbdn {

namespace {

constexpr double kTie = 2e-3;  // crossings closer than this may be listed in either order

// Lines whose coordinate lies in [low, high), so that an edge's end is counted by exactly one of its edges.
struct LineRange {
    int first;
    int last;
};
LineRange lines_between(double low, double high, int count) {
    return {std::max(0, first_pixel_from(low)), std::min(count, first_pixel_from(high)) - 1};
}

}  // namespace

void CrossingLines::build(const Mesh& mesh, Axis axis) {
    const bool rows = axis == Axis::kRows;
    const int lines = rows ? mesh.height : mesh.width;
    start_.assign(lines + 1, 0);

    const auto across = [rows](Vec2 p) { return rows ? p.y : p.x; };
    const auto along = [rows](Vec2 p) { return rows ? p.x : p.y; };

    for (const Edge& e : mesh.edges) {
        if (e.dead) continue;
        const double u = across(mesh.vertices[e.a].p), v = across(mesh.vertices[e.b].p);
        const auto [first, last] = lines_between(std::min(u, v), std::max(u, v), lines);
        for (int k = first; k <= last; ++k) ++start_[k + 1];
    }
    for (int k = 0; k < lines; ++k) start_[k + 1] += start_[k];
    items_.resize(start_[lines]);
    fill_.assign(start_.begin(), start_.end() - 1);

    for (int n = 0; n < static_cast<int>(mesh.edges.size()); ++n) {
        const Edge& e = mesh.edges[n];
        if (e.dead) continue;
        const Vec2 a = mesh.vertices[e.a].p, b = mesh.vertices[e.b].p;
        const double u = across(a), v = across(b);
        const auto [first, last] = lines_between(std::min(u, v), std::max(u, v), lines);
        if (first > last) continue;
        const double slope = (along(b) - along(a)) / (v - u);
        // A row meets the left face second where the edge runs down, a column where it runs left.
        const bool left_is_after = rows ? v > u : v < u;
        const int before = left_is_after ? e.right : e.left;
        const int after = left_is_after ? e.left : e.right;
        for (int k = first; k <= last; ++k) {
            const double at = along(a) + slope * (k + 0.5 - u);
            int place = fill_[k]++;
            for (; place > start_[k] && items_[place - 1].at > at; --place) items_[place] = items_[place - 1];
            items_[place] = {at, n, before, after};
        }
    }

    for (int k = 0; k < lines; ++k) {
        int expected = kOutside;
        for (int i = start_[k]; i < start_[k + 1]; ++i) {
            if (items_[i].before != expected) {
                for (int j = i + 1; j < start_[k + 1] && items_[j].at - items_[i].at < kTie; ++j) {
                    if (items_[j].before == expected) {
                        std::swap(items_[i], items_[j]);
                        break;
                    }
                }
            }
            expected = items_[i].after;
        }
    }
}

void CrossingLines::collect_bad_edges(std::vector<int>& bad) const {
    for (int k = 0; k < line_count(); ++k) {
        const auto crossings = line(k);
        int expected = kOutside;
        for (std::size_t i = 0; i < crossings.size(); ++i) {
            if (crossings[i].before != expected) {
                bad.push_back(crossings[i].edge);
                if (i > 0) bad.push_back(crossings[i - 1].edge);
            }
            expected = crossings[i].after;
        }
        if (expected != kOutside) bad.push_back(crossings.back().edge);
    }
}

void Crossings::build(const Mesh& mesh) {
    rows_.build(mesh, Axis::kRows);
    columns_.build(mesh, Axis::kColumns);
}

std::vector<ColourSum> Crossings::face_sums(const Mesh& mesh, const Image& image) const {
    std::vector<ColourSum> sums(mesh.faces.size());
    for (int y = 0; y < rows_.line_count(); ++y) {
        const auto crossings = rows_.line(y);
        for (std::size_t i = 0; i + 1 < crossings.size(); ++i) {
            const int x0 = std::clamp(first_pixel_from(crossings[i].at), 0, mesh.width);
            const int x1 = std::clamp(first_pixel_from(crossings[i + 1].at), 0, mesh.width);
            if (x1 > x0 && crossings[i].after >= 0) sums[crossings[i].after].add(image.span(y, x0, x1));
        }
    }
    return sums;
}

std::vector<int> Crossings::face_of_pixels(const Mesh& mesh) const {
    std::vector<int> face(static_cast<std::size_t>(mesh.width) * mesh.height, 0);
    for (int y = 0; y < rows_.line_count(); ++y) {
        const auto crossings = rows_.line(y);
        int* row = face.data() + static_cast<std::size_t>(y) * mesh.width;
        for (std::size_t i = 0; i + 1 < crossings.size(); ++i) {
            const int x0 = std::clamp(first_pixel_from(crossings[i].at), 0, mesh.width);
            const int x1 = std::clamp(first_pixel_from(crossings[i + 1].at), 0, mesh.width);
            if (x1 > x0) std::fill(row + x0, row + x1, crossings[i].after);
        }
    }
    return face;
}

}  // namespace rbdn
