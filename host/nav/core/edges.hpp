// What the feet and the outline of a thing say of its shape: straight edges on the floor, or an end in a point.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace nav {

// One region in a picture of regions by column, lowest pixel first.
struct Shape {
    const std::uint16_t* labels;  // (columns, rows)
    std::size_t rows;
    std::uint16_t kind;
    std::span<const double> slopes;           // of the feet, of all columns of the picture
    std::span<const std::int64_t> feet;       // columns in which its foot is seen, in order
    std::span<const std::int64_t> covered;    // and in which it is seen itself, in order
    const bool* cut;                          // of all columns, whether the foot is below the picture
};

// Of slopes over columns.
struct Line {
    double offset, rise;
    double at(double column) const { return offset + rise * column; }
};

double mean(std::span<const double> values);

// The line through slopes over columns; none where they lie about it by rms or more.
std::optional<Line> straight(std::span<const std::int64_t> columns, std::span<const double> slopes, double rms);

// Of a shape's feet, in the order of its columns.
std::vector<double> own_slopes(const Shape& shape);

// Slopes of feet on one straight edge, or on two that meet in a corner, in all columns covered; none of what has no
// such edges, is not upright at the ends of its feet or is half a ball.
//
// They are nowhere flatter than a foot that was seen, for floor was seen up to there, and steeper only where the foot
// is below the picture. rms: of feet about the line of an edge.
std::optional<std::vector<double>> along_edges(const Shape& shape, double rms);

// Whether a thing that is seen whole ends in a point at both sides with its feet higher there, as a ball does; or does
// so at the one end in sight, where what is before it or the picture's border hides the other.
bool tapers(const Shape& shape);

}  // namespace nav
