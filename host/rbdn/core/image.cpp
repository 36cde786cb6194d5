// The working image: colours in the net's own space, with row prefix sums for fast means.
#include "image.hpp"

#include <bit>
#include <cmath>

namespace rbdn {

namespace {

// What each value of each channel contributes to a pixel, ready to be put together by "or".
struct ChannelTables {
    std::array<std::array<std::uint64_t, 256>, 3> packed;

    explicit ChannelTables(double lightness_weight) {
        for (int v = 0; v < 256; ++v) {
            // Lightness carries an object's own shading; discounting it keeps lit and dark sides together.
            const double lightness = v * (100.0 / 255.0) * lightness_weight * Image::kUnitsPerLab;
            const auto hue = static_cast<std::int16_t>((v - 128) * Image::kUnitsPerLab);
            packed[0][v] = std::bit_cast<std::uint64_t>(Pixel{{static_cast<std::int16_t>(std::lround(lightness)), 0, 0, 0}});
            packed[1][v] = std::bit_cast<std::uint64_t>(Pixel{{0, hue, 0, 0}});
            packed[2][v] = std::bit_cast<std::uint64_t>(Pixel{{0, 0, hue, 0}});
        }
    }
};

}  // namespace

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
    const ChannelTables table(lightness_weight);

    for (int y = 0; y < height; ++y) {
        const std::uint8_t* in = lab + static_cast<std::size_t>(y) * width * 3;
        Pixel* out = &pixels_[static_cast<std::size_t>(y) * width];
        for (int x = 0; x < width; ++x, in += 3)
            out[x] = std::bit_cast<Pixel>(table.packed[0][in[0]] | table.packed[1][in[1]] | table.packed[2][in[2]]);
        PrefixSum* sum = &prefix_[static_cast<std::size_t>(y) * (width + 1)];
        PrefixSum total{};
        sum[0] = total;
        for (int x = 0; x < width; ++x) {
            for (int k = 0; k < 4; ++k) total.c[k] += out[x].c[k];
            sum[x + 1] = total;
        }
    }
}

}  // namespace rbdn
