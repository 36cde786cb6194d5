// The working image: colours in the net's own space, with row prefix sums for fast means.
#include "image.hpp"

#include <cmath>

namespace rbdn {

void ColourSum::add(const ColourSum& other) {
    count += other.count;
    for (int k = 0; k < 3; ++k) sum[k] += other.sum[k];
}

Colour ColourSum::mean() const {
    Colour out{};
    if (count == 0) return out;
    for (int k = 0; k < 3; ++k) out[k] = static_cast<float>(static_cast<double>(sum[k]) / static_cast<double>(count));
    return out;
}

void Image::load(const std::uint8_t* lab, int width, int height, double lightness_weight) {
    width_ = width;
    height_ = height;
    pixels_.resize(static_cast<std::size_t>(width) * height);
    prefix_.resize(static_cast<std::size_t>(width + 1) * height);

    // Lightness carries an object's own shading; discounting it keeps lit and dark sides together.
    std::array<std::int16_t, 256> lightness{};
    for (int v = 0; v < 256; ++v)
        lightness[v] = static_cast<std::int16_t>(std::lround(v * (100.0 / 255.0) * lightness_weight * kUnitsPerLab));

    for (int y = 0; y < height; ++y) {
        const std::uint8_t* in = lab + static_cast<std::size_t>(y) * width * 3;
        Pixel* out = &pixels_[static_cast<std::size_t>(y) * width];
        auto* sum = &prefix_[static_cast<std::size_t>(y) * (width + 1)];
        sum[0] = {0, 0, 0};
        for (int x = 0; x < width; ++x, in += 3) {
            out[x] = {{lightness[in[0]], static_cast<std::int16_t>((in[1] - 128) * 4),
                       static_cast<std::int16_t>((in[2] - 128) * 4), 0}};
            for (int k = 0; k < 3; ++k) sum[x + 1][k] = sum[x][k] + out[x].c[k];
        }
    }
}

ColourSum Image::span(int y, int x0, int x1) const {
    const auto* sum = &prefix_[static_cast<std::size_t>(y) * (width_ + 1)];
    ColourSum out;
    out.count = x1 - x0;
    for (int k = 0; k < 3; ++k) out.sum[k] = sum[x1][k] - sum[x0][k];
    return out;
}

}  // namespace rbdn
