// The working image: the camera's CIELAB bytes seen in the net's own colour space, with sums for fast means.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

namespace rbdn {

// Colour units are quarters of a CIELAB unit, with lightness discounted; see image.cpp.
using Colour = std::array<float, 3>;

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

class Image {
public:
    static constexpr float kUnitsPerLab = 4.0F;

    explicit Image(double lightness_weight);

    // `lab` is OpenCV's 8-bit CIELAB, (height, width, 3), row after row without gaps; it is not copied and must
    // outlive the use of the image. Means are taken over every `row_step`-th row.
    void load(const std::uint8_t* lab, int width, int height, int row_step);

    int width() const { return width_; }
    int height() const { return height_; }
    int row_step() const { return row_step_; }

    // Pixels of a row, three bytes each, for colour_of().
    const std::uint8_t* row(int y) const { return lab_ + 3 * static_cast<std::size_t>(y) * width_; }
    Colour colour_of(const std::uint8_t* pixel) const {
        return {lightness_[pixel[0]], hue_[pixel[1]], hue_[pixel[2]]};
    }

    // Prefix sums of row y, a multiple of row_step: width + 1 of them.
    RowSums row_sums(int y) const { return &prefix_[static_cast<std::size_t>(y / row_step_) * (width_ + 1)]; }

private:
    const std::uint8_t* lab_ = nullptr;
    int width_ = 0;
    int height_ = 0;
    int row_step_ = 1;
    std::array<float, 256> lightness_{};
    std::array<float, 256> hue_{};
    std::array<std::array<std::uint64_t, 256>, 3> packed_{};  // four 16-bit numbers each, for the sums
    // Not a vector, which would write it all once more.
    std::unique_ptr<PrefixSum[]> prefix_;
    std::size_t prefix_size_ = 0;
};

}  // namespace rbdn
