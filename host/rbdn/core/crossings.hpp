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
    int edge;
    int before;  // face on the side of smaller coordinates
    int after;
};

enum class Axis { kRows, kColumns };

class CrossingLines {
public:
    void build(const Mesh& mesh, Axis axis);

    int line_count() const { return static_cast<int>(start_.size()) - 1; }
    std::span<const Crossing> line(int k) const {
        return {items_.data() + start_[k], static_cast<std::size_t>(start_[k + 1] - start_[k])};
    }

    // Edges at crossings whose neighbours disagree; empty for a planar net.
    void collect_bad_edges(std::vector<int>& bad) const;

private:
    std::vector<int> start_;
    std::vector<Crossing> items_;
    std::vector<int> fill_;
};

// First pixel whose centre lies at or beyond the coordinate.
inline int first_pixel_from(double coordinate) { return static_cast<int>(std::ceil(coordinate - 0.5)); }

class Crossings {
public:
    void build(const Mesh& mesh);

    const CrossingLines& rows() const { return rows_; }
    const CrossingLines& columns() const { return columns_; }

    // Pixel sums of every face, one ColourSum a face.
    std::vector<ColourSum> face_sums(const Mesh& mesh, const Image& image) const;

    // Face of every pixel, row after row.
    std::vector<int> face_of_pixels(const Mesh& mesh) const;

private:
    CrossingLines rows_;
    CrossingLines columns_;
};

}  // namespace rbdn
