// Where the net's edges cross the lines through the pixel centres.
//
// Sorted along each row and each column, the crossings give at once which face owns a pixel, the faces' means,
// the place where forces look for mismatched pixels, and whether the net is planar: neighbouring crossings must
// agree about the face between them.
#pragma once

#include <span>
#include <vector>

#include "image.hpp"
#include "mesh.hpp"

namespace rbdn {

struct Crossing {
    double at;   // coordinate along the line
    int pixel;   // first pixel of the line whose centre lies at or beyond it
    int edge;
    int before;  // face on the side of smaller coordinates
    int after;
};

enum class Axis { kRows, kColumns };

class CrossingLines {
public:
    // Takes every `step`-th line, from the first.
    void build(const Mesh& mesh, Axis axis, int step);

    int line_count() const { return static_cast<int>(start_.size()) - 1; }
    int step() const { return step_; }  // line k lies at pixel k * step()
    std::span<const Crossing> line(int k) const {
        return {items_.data() + start_[k], static_cast<std::size_t>(start_[k + 1] - start_[k])};
    }

    // Edges at crossings whose neighbours disagree; empty for a planar net.
    void collect_bad_edges(std::vector<int>& bad) const;

private:
    // What an edge adds to every line it crosses.
    struct Track {
        int first, last;  // lines
        double from, at_from, slope;
        int edge, before, after;
    };

    void collect_tracks(const Mesh& mesh, bool rows);
    void sort_tracks(int size_px);
    void fill_lines(int size_px);
    bool put_ties_in_order();

    int step_ = 1;
    std::vector<int> start_;
    std::vector<Crossing> items_;
    bool consistent_ = true;

    // Scratch, kept for its memory.
    std::vector<Track> tracks_, sorted_;
    std::vector<int> bucket_, fill_;
};

class Crossings {
public:
    // Over all lines, or every `step`-th of them, which is enough to see where a moving net should go.
    void build(const Mesh& mesh, int step = 1);

    int step() const { return rows_.step(); }  // of the last build

    // Changes with every build(), so that what was derived from the lists can be kept as long as they stand.
    int version() const { return version_; }

    const CrossingLines& rows() const { return rows_; }
    const CrossingLines& columns() const { return columns_; }

    // Pixel sums of every face, one ColourSum a face, over those lines that the image keeps sums of.
    std::vector<ColourSum> face_sums(const Mesh& mesh, const Image& image) const;

    // Face of every pixel, row after row. Needs all lines.
    void face_of_pixels(const Mesh& mesh, std::vector<int>& face) const;

private:
    CrossingLines rows_;
    CrossingLines columns_;
    int version_ = 0;
};

}  // namespace rbdn
