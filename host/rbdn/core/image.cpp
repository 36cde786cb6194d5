// The working image: the camera's pixels seen in the net's own colour space, with sums for fast means.
#include "image.hpp"

#include <cmath>

namespace rbdn {

namespace {

// Linear sRGB to X, Y and Z as shares of the white point D65 (IEC 61966-2-1); columns are blue, green, red.
constexpr double kToXyz[3][3] = {
    {0.1804375 / 0.95047, 0.3575761 / 0.95047, 0.4124564 / 0.95047},
    {0.0721750, 0.7151522, 0.2126729},
    {0.9503041 / 1.08883, 0.1191920 / 1.08883, 0.0193339 / 1.08883},
};

double linear_light(double v) { return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4); }

// The cube root of CIELAB with its straight foot.
double cielab_curve(double t) { return t > 216.0 / 24389.0 ? std::cbrt(t) : (24389.0 / 27.0 * t + 16.0) / 116.0; }

std::uint64_t packed(double first, double second, double third) {
    const std::array<std::int16_t, 4> lanes{static_cast<std::int16_t>(std::lround(first)),
                                            static_cast<std::int16_t>(std::lround(second)),
                                            static_cast<std::int16_t>(std::lround(third)), 0};
    return std::bit_cast<std::uint64_t>(lanes);
}

}  // namespace

Colour ColourSum::mean() const {
    Colour out{};
    if (count == 0) return out;
    for (int k = 0; k < 3; ++k) out[k] = static_cast<float>(static_cast<double>(sum[k]) / static_cast<double>(count));
    return out;
}

ColourTables::ColourTables(const Config& config) {
    for (auto& curve : curve_) curve.resize(1 << kCurveBits);
    if (config.mode == Mode::kPaper)
        make_rgb();
    else
        make_cielab(config.lightness_weight);
}

void ColourTables::make_cielab(double lightness_weight) {
    const int size = 1 << kCurveBits;
    const double full = ((size - 1) << kFineBits) - 4;  // leaves room for the rounding of three shares
    for (int channel = 0; channel < 3; ++channel)
        for (int v = 0; v < 256; ++v) {
            const double light = full * linear_light(v / 255.0);
            light_[channel][v] =
                packed(light * kToXyz[0][channel], light * kToXyz[1][channel], light * kToXyz[2][channel]);
        }
    constexpr double kUnits = Image::kUnitsPerLab;
    for (int k = 0; k < size; ++k) {
        const double f = cielab_curve((k + 0.5) * (1 << kFineBits) / full);
        // Lightness carries an object's own shading; discounting it keeps lit and dark sides together.
        const double lightness = std::max(0.0, 116.0 * f - 16.0) * lightness_weight;
        curve_[0][k] = packed(0, 500 * f * kUnits, 0);
        curve_[1][k] = packed(lightness * kUnits, Image::kBlack[1] - 500 * f * kUnits, 200 * f * kUnits);
        curve_[2][k] = packed(0, 0, Image::kBlack[2] - 200 * f * kUnits);
    }
}

void ColourTables::make_rgb() {
    for (int v = 0; v < 256; ++v) {
        const double place = v << kFineBits, level = v * Image::kUnitsPerLab;
        light_[0][v] = packed(place, 0, 0);
        light_[1][v] = packed(0, place, 0);
        light_[2][v] = packed(0, 0, place);
        curve_[0][v] = packed(level, 0, 0);
        curve_[1][v] = packed(0, Image::kBlack[1] + level, 0);
        curve_[2][v] = packed(0, 0, Image::kBlack[2] + level);
    }
}

void Image::load(const std::uint8_t* bgr, int width, int height, int row_step, int column_step) {
    bgr_ = bgr;
    width_ = width;
    height_ = height;
    row_step_ = row_step;
    column_step_ = column_step;
    lattice_width_ = (width + column_step - 1) / column_step;
    const std::size_t needed = static_cast<std::size_t>(lattice_width_ + 1) * ((height + row_step - 1) / row_step);
    if (needed > prefix_size_) {
        prefix_ = std::make_unique_for_overwrite<PrefixSum[]>(needed);
        lattice_ = std::make_unique_for_overwrite<std::int16_t[]>(3 * needed);
        prefix_size_ = needed;
    }
    PrefixSum* sum = prefix_.get();
    std::int16_t* parts = lattice_.get();
    for (int y = 0; y < height; y += row_step, parts += 3 * lattice_width_) {
        const std::uint8_t* in = row(y);
        PrefixSum total{};
        *sum++ = total;
        for (int k = 0; k < lattice_width_; ++k, in += 3 * column_step) {
            const ShortColour pixel = colours_(in);
            for (int c = 0; c < 3; ++c) parts[c * lattice_width_ + k] = pixel[c];
            for (int c = 0; c < 4; ++c) total.c[c] += pixel[c];
            *sum++ = total;
        }
    }
}

void Image::mark_far(int y, int first, int last, const ShortColour& from, int gate2, std::uint8_t* far) const {
    const std::int16_t* one = lattice_row(y);
    const std::int16_t* two = one + lattice_width_;
    const std::int16_t* three = two + lattice_width_;
    const std::int16_t a = from[0], b = from[1], c = from[2];
    for (int k = first; k < last; ++k) {
        const auto x = static_cast<std::int16_t>(one[k] - a), z = static_cast<std::int16_t>(three[k] - c);
        const auto w = static_cast<std::int16_t>(two[k] - b);
        far[k] = x * x + w * w + z * z > gate2;
    }
}

}  // namespace rbdn
