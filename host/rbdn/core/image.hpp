// The working image: the camera's pixels seen in the net's own colour space, with sums for fast means.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "config.hpp"

namespace rbdn {

// Colour units are quarters of a CIELAB unit, with lightness discounted, or of an RGB level; see image.cpp.
using Colour = std::array<float, 3>;

// The same as whole numbers; the fourth is unused.
using ShortColour = std::array<std::int16_t, 4>;

// Sums over the pixels of a row before each place; four numbers, so that they are added in one go.
struct PrefixSum {
    std::int32_t c[4];
};

struct ColourSum {
    std::int64_t count = 0;
    std::array<std::int64_t, 3> sum{};

    void add(const ColourSum& other) {
        count += other.count;
        for (int k = 0; k < 3; ++k) sum[k] += other.sum[k];
    }
    void add_between(const PrefixSum& first, const PrefixSum& last, int pixels) {
        count += pixels;
        for (int k = 0; k < 3; ++k) sum[k] += last.c[k] - first.c[k];
    }
    Colour mean() const;
};

inline float distance2(const Colour& a, const Colour& b) {
    const float x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
}

inline int distance2(const ShortColour& a, const ShortColour& b) {
    const int x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
}

// To the nearest whole number, as lround, for what is not negative, as no part of a colour is.
inline int whole(float v) { return static_cast<int>(static_cast<double>(v) + 0.5); }

// To whole units.
inline ShortColour to_short(const Colour& c) {
    ShortColour out{};
    for (int k = 0; k < 3; ++k) out[k] = static_cast<std::int16_t>(whole(c[k]));
    return out;
}

inline Colour to_float(const ShortColour& c) {
    return {static_cast<float>(c[0]), static_cast<float>(c[1]), static_cast<float>(c[2])};
}

// From the camera's blue, green and red to CIELAB with discounted lightness, or to themselves in the paper's mode,
// by tables alone: the same whole numbers on every machine.
class ColourTables {
public:
    explicit ColourTables(const Config& config);

    ShortColour operator()(const std::uint8_t* bgr) const {
        const std::uint64_t xyz = light_[0][bgr[0]] + light_[1][bgr[1]] + light_[2][bgr[2]];
        return std::bit_cast<ShortColour>(curve_[0][(xyz >> kFineBits) & kCurveMask] +
                                          curve_[1][(xyz >> (16 + kFineBits)) & kCurveMask] +
                                          curve_[2][(xyz >> (32 + kFineBits)) & kCurveMask]);
    }

private:
    void make_cielab(double lightness_weight);
    void make_rgb();

    static constexpr int kCurveBits = 12;
    static constexpr int kFineBits = 3;  // of the light beyond the curve's resolution; the sum stays in 16 bits
    static constexpr std::uint64_t kCurveMask = (1U << kCurveBits) - 1;

    // Four 16-bit numbers in each entry, added in one go; none is ever negative, so none borrows from the next.
    std::array<std::array<std::uint64_t, 256>, 3> light_;              // share of X, Y and Z, by channel and byte
    std::array<std::vector<std::uint64_t>, 3> curve_;                  // share of L, a and b, by X, Y and Z
};

class Image {
public:
    static constexpr float kUnitsPerLab = 4.0F;  // and per RGB level
    // Black; the space is shifted so that no colour has a negative part.
    static constexpr Colour kBlack{0.0F, 500 * kUnitsPerLab, 200 * kUnitsPerLab};

    explicit Image(const Config& config) : colours_(config) {}

    // `bgr` is (height, width, 3), row after row without gaps; it is not copied and must outlive the use of the
    // image. Means are taken over a lattice: every `row_step`-th row, every `column_step`-th column.
    void load(const std::uint8_t* bgr, int width, int height, int row_step, int column_step);

    int width() const { return width_; }
    int height() const { return height_; }
    int row_step() const { return row_step_; }
    int column_step() const { return column_step_; }

    // Pixels of a row, three bytes each, for the colour functions.
    const std::uint8_t* row(int y) const { return bgr_ + 3 * static_cast<std::size_t>(y) * width_; }
    ShortColour short_colour_of(const std::uint8_t* pixel) const { return colours_(pixel); }
    Colour colour_of(const std::uint8_t* pixel) const { return to_float(colours_(pixel)); }

    // Adds those of the pixels [x0, x1) of row y, a multiple of row_step(), that lie on the lattice.
    void add_span(ColourSum& to, int y, int x0, int x1) const {
        const int first = (x0 + column_step_ - 1) / column_step_, last = (x1 + column_step_ - 1) / column_step_;
        if (last <= first) return;
        const PrefixSum* sums = row_sums(y);
        to.add_between(sums[first], sums[last], last - first);
    }

    // Colour at a place of the lattice, without working it out again.
    ShortColour lattice_colour(int x, int y) const {
        const std::int16_t* place = lattice_row(y) + x / column_step_;
        return {place[0], place[lattice_width_], place[2 * lattice_width_], 0};
    }

    // Which of the places [first, last) of the lattice's row through y, counted in lattice steps, are farther than
    // the root of `gate2` from a colour: a 1 in `far` for each, else 0.
    void mark_far(int y, int first, int last, const ShortColour& from, int gate2, std::uint8_t* far) const;

private:
    const PrefixSum* row_sums(int y) const {
        return &prefix_[static_cast<std::size_t>(y / row_step_) * (lattice_width_ + 1)];
    }
    const std::int16_t* lattice_row(int y) const {
        return &lattice_[static_cast<std::size_t>(y / row_step_) * 3 * lattice_width_];
    }

    ColourTables colours_;
    const std::uint8_t* bgr_ = nullptr;
    int width_ = 0;
    int height_ = 0;
    int row_step_ = 1;
    int column_step_ = 1;
    // No vectors, which would write it all once more.
    std::unique_ptr<PrefixSum[]> prefix_;
    std::unique_ptr<std::int16_t[]> lattice_;  // colours, part by part in every row, so that many are looked at at once
    int lattice_width_ = 0;
    std::size_t prefix_size_ = 0;
};

}  // namespace rbdn
