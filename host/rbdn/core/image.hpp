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

struct ColourSum {
    std::int64_t count = 0;
    std::array<std::int64_t, 3> sum{};

    void add(const ColourSum& other);
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

    // Sum over the pixels [x0, x1) of row y.
    ColourSum span(int y, int x0, int x1) const;

private:
    int width_ = 0;
    int height_ = 0;
    std::vector<Pixel> pixels_;
    std::vector<std::array<std::int32_t, 3>> prefix_;  // per row, width + 1 entries
};

}  // namespace rbdn
