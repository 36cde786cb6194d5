// Where the net's edges cross the lines through the pixel centres.
#include "crossings.hpp"

#include <algorithm>
#include <numeric>

namespace rbdn {

namespace {

constexpr double kTie = 2e-3;     // crossings closer than this may be listed in either order
constexpr int kBucketShift = 2;   // edges are sorted to 4 px

// First pixel whose centre lies at or beyond the coordinate.
int first_pixel_from(double coordinate) { return ceil_px(coordinate - 0.5); }

}  // namespace

void CrossingLines::build(const Mesh& mesh, Axis axis, int step) {
    const bool rows = axis == Axis::kRows;
    step_ = step;
    const int lines = ((rows ? mesh.height : mesh.width) + step - 1) / step;
    const int size_px = rows ? mesh.width : mesh.height;
    start_.assign(lines + 1, 0);
    collect_tracks(mesh, rows);
    sort_tracks(size_px);
    for (int k = 0; k < lines; ++k) start_[k + 1] += start_[k];
    items_.resize(start_[lines]);
    fill_lines(size_px);
    consistent_ = put_ties_in_order();
}

// One track an edge, counted into start_.
void CrossingLines::collect_tracks(const Mesh& mesh, bool rows) {
    const int lines = static_cast<int>(start_.size()) - 1;
    const auto first_line_from = [&](double u) { return ceil_px((u - 0.5) / step_); };
    tracks_.clear();
    for (int n = 0; n < static_cast<int>(mesh.edges.size()); ++n) {
        const Edge& e = mesh.edges[n];
        if (e.dead) continue;
        const Vec2 a = mesh.vertices[e.a].p, b = mesh.vertices[e.b].p;
        const double u = rows ? a.y : a.x, v = rows ? b.y : b.x;
        const double at_u = rows ? a.x : a.y, at_v = rows ? b.x : b.y;
        // Half open, so that a vertex on a line is counted by exactly one of its edges.
        const int first = std::max(0, first_line_from(std::min(u, v)));
        const int last = std::min(lines, first_line_from(std::max(u, v))) - 1;
        if (first > last) continue;
        // A row meets the left face second where the edge runs down, a column where it runs left.
        const bool left_is_after = rows ? v > u : v < u;
        tracks_.push_back({first, last, u, at_u, (at_v - at_u) / (v - u), n, left_is_after ? e.right : e.left,
                           left_is_after ? e.left : e.right});
        for (int k = first; k <= last; ++k) ++start_[k + 1];
    }
}

// Roughly from left to right (or top to bottom), so that the lines come out nearly sorted.
void CrossingLines::sort_tracks(int size_px) {
    const auto bucket_of = [&](const Track& t) {
        const double middle = t.at_from + t.slope * (0.5 * step_ * (t.first + t.last) + 0.5 - t.from);
        return std::clamp(static_cast<int>(middle), 0, size_px) >> kBucketShift;
    };
    bucket_.assign((size_px >> kBucketShift) + 2, 0);
    for (const Track& t : tracks_) ++bucket_[bucket_of(t) + 1];
    for (std::size_t k = 1; k < bucket_.size(); ++k) bucket_[k] += bucket_[k - 1];
    sorted_.resize(tracks_.size());
    for (const Track& t : tracks_) sorted_[bucket_[bucket_of(t)]++] = t;
}

void CrossingLines::fill_lines(int size_px) {
    fill_.assign(start_.begin(), start_.end() - 1);
    // By pointers of its own, or they would be looked up again at every crossing.
    Crossing* const items = items_.data();
    const int* const start = start_.data();
    int* const fill = fill_.data();
    const double step = step_;
    for (const Track& t : sorted_) {
        double line = t.first * step + 0.5;
        for (int k = t.first; k <= t.last; ++k, line += step) {
            const double at = t.at_from + t.slope * (line - t.from);
            Crossing* place = items + fill[k]++;
            for (const Crossing* const first = items + start[k]; place > first && place[-1].at > at; --place)
                *place = place[-1];
            *place = {at, std::clamp(first_pixel_from(at), 0, size_px), t.edge, t.before, t.after};
        }
    }
}

// Swaps crossings that nearly coincide where that makes neighbours agree; returns whether all agree then.
bool CrossingLines::put_ties_in_order() {
    bool consistent = true;
    for (int k = 0; k < line_count(); ++k) {
        int expected = kOutside;
        for (int i = start_[k]; i < start_[k + 1]; ++i) {
            for (int j = i + 1; items_[i].before != expected; ++j) {
                if (j == start_[k + 1] || items_[j].at - items_[i].at >= kTie) {
                    consistent = false;
                    break;
                }
                if (items_[j].before == expected) std::swap(items_[i], items_[j]);
            }
            expected = items_[i].after;
        }
        if (expected != kOutside) consistent = false;
    }
    return consistent;
}

void CrossingLines::collect_bad_edges(std::vector<int>& bad) const {
    if (consistent_) return;
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

void Crossings::build(const Mesh& mesh, int step) {
    rows_.build(mesh, Axis::kRows, step);
    columns_.build(mesh, Axis::kColumns, step);
    ++version_;
}

std::vector<ColourSum> Crossings::face_sums(const Mesh& mesh, const Image& image) const {
    std::vector<ColourSum> sums(mesh.faces.size());
    const int common = std::lcm(rows_.step(), image.row_step());
    for (int y = 0; y < mesh.height; y += common) {
        const auto crossings = rows_.line(y / rows_.step());
        for (std::size_t i = 0; i + 1 < crossings.size(); ++i) {
            const int x0 = crossings[i].pixel, x1 = crossings[i + 1].pixel;
            if (x1 > x0 && crossings[i].after >= 0) image.add_span(sums[crossings[i].after], y, x0, x1);
        }
    }
    return sums;
}

void Crossings::face_of_pixels(const Mesh& mesh, std::vector<int>& face) const {
    face.resize(static_cast<std::size_t>(mesh.width) * mesh.height);
    for (int y = 0; y < rows_.line_count(); ++y) {
        const auto crossings = rows_.line(y);
        int* row = face.data() + static_cast<std::size_t>(y) * mesh.width;
        for (std::size_t i = 0; i + 1 < crossings.size(); ++i)
            if (crossings[i + 1].pixel > crossings[i].pixel)
                std::fill(row + crossings[i].pixel, row + crossings[i + 1].pixel, crossings[i].after);
    }
}

}  // namespace rbdn
