// The working image: the camera's CIELAB bytes seen in the net's own colour space, with sums for fast means.
#include "image.hpp"

#include <bit>
#include <cmath>

namespace rbdn {

namespace {

using FourShorts = std::array<std::int16_t, 4>;

}  // namespace

Colour ColourSum::mean() const {
    Colour out{};
    if (count == 0) return out;
    for (int k = 0; k < 3; ++k) out[k] = static_cast<float>(static_cast<double>(sum[k]) / static_cast<double>(count));
    return out;
}

Image::Image(double lightness_weight) {
    for (int v = 0; v < 256; ++v) {
        // Lightness carries an object's own shading; discounting it keeps lit and dark sides together.
        const double scaled = v * (100.0 / 255.0) * lightness_weight * kUnitsPerLab;
        const auto lightness = static_cast<std::int16_t>(std::lround(scaled));
        const auto hue = static_cast<std::int16_t>((v - 128) * kUnitsPerLab);
        lightness_[v] = lightness;
        hue_[v] = hue;
        packed_[0][v] = std::bit_cast<std::uint64_t>(FourShorts{lightness, 0, 0, 0});
        packed_[1][v] = std::bit_cast<std::uint64_t>(FourShorts{0, hue, 0, 0});
        packed_[2][v] = std::bit_cast<std::uint64_t>(FourShorts{0, 0, hue, 0});
    }
}

void Image::load(const std::uint8_t* lab, int width, int height, int row_step) {
    lab_ = lab;
    width_ = width;
    height_ = height;
    row_step_ = row_step;
    const std::size_t needed = static_cast<std::size_t>(width + 1) * ((height + row_step - 1) / row_step);
    if (needed > prefix_size_) {
        prefix_ = std::make_unique_for_overwrite<PrefixSum[]>(needed);
        prefix_size_ = needed;
    }
    for (int y = 0; y < height; y += row_step) {
        const std::uint8_t* in = row(y);
        PrefixSum* sum = &prefix_[static_cast<std::size_t>(y / row_step) * (width + 1)];
        PrefixSum total{};
        sum[0] = total;
        for (int x = 0; x < width; ++x, in += 3) {
            const auto pixel = std::bit_cast<FourShorts>(packed_[0][in[0]] | packed_[1][in[1]] | packed_[2][in[2]]);
            for (int k = 0; k < 4; ++k) total.c[k] += pixel[k];
            sum[x + 1] = total;
        }
    }
}

}  // namespace rbdn
