// The working image: colours in the net's own space, with row prefix sums for fast means.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace rbdn {

// Colour units are quarters of a CIELAB unit, with lightness discounted; see image.cpp.
using Colour = std::array<float, 3>;

struct Pixel {
    std::int16_t c[4];  // lightness, a, b; the fourth keeps pixels aligned
};

// Sums over the pixels of a row before each place; four numbers, so that they are added in one go.
struct PrefixSum {
    std::int32_t c[4];
};
using RowSums = const PrefixSum*;

struct ColourSum {
    std::int64_t count = 0;
    std::array<std::int64_t, 3> sum{};

    void add(const ColourSum& other) {
        count += other.count;
        for (int k = 0; k < 3; ++k) sum[k] += other.sum[k];
    }
    // The pixels [x0, x1) of a row.
    void add_span(RowSums row, int x0, int x1) {
        count += x1 - x0;
        for (int k = 0; k < 3; ++k) sum[k] += row[x1].c[k] - row[x0].c[k];
    }
    Colour mean() const;
};

inline float distance2(const Colour& a, const Colour& b) {
    const float x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
}

inline float distance2(const Pixel& p, const Colour& b) {
    const float x = p.c[0] - b[0], y = p.c[1] - b[1], z = p.c[2] - b[2];
    return x * x + y * y + z * z;
}

class Image {
public:
    static constexpr float kUnitsPerLab = 4.0F;

    // `lab` is OpenCV's 8-bit CIELAB, (height, width, 3), row after row without gaps.
    void load(const std::uint8_t* lab, int width, int height, double lightness_weight);

    int width() const { return width_; }
    int height() const { return height_; }
    const Pixel& at(int x, int y) const { return pixels_[static_cast<std::size_t>(y) * width_ + x]; }

    // Prefix sums of row y: width + 1 of them.
    RowSums row_sums(int y) const { return &prefix_[static_cast<std::size_t>(y) * (width_ + 1)]; }

private:
    int width_ = 0;
    int height_ = 0;
    std::vector<Pixel> pixels_;
    std::vector<PrefixSum> prefix_;
};

}  // namespace rbdn
