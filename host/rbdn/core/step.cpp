// What a camera makes of a sharp edge: a step blurred by lens and pixel, whose sides mix in light or in numbers.
#include "step.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace rbdn {

namespace {

constexpr double kPixelQuartic = -1.0 / 120.0;  // fourth cumulant of a box one pixel wide

double decode(double number) {
    const double s = number / 255.0;
    return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}

double encode(double light) {
    return 255.0 * (light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055);
}

// sRGB and back by table, between whose entries lines are good to a hundredth of a grey level.
class Encoding {
public:
    Encoding() {
        for (int k = 0; k < kNumbers + 2; ++k) light_[k] = static_cast<float>(decode(k));
        for (int k = 0; k < kLights + 2; ++k) number_[k] = static_cast<float>(encode(square(k / double{kLights})));
    }
    float light(float number) const { return between(light_.data(), std::clamp(number, 0.0F, 255.0F)); }
    float number(float light) const {
        // A square root spreads the dark end, where the curve is steep.
        return between(number_.data(), std::sqrt(std::clamp(light, 0.0F, 1.0F)) * kLights);
    }

private:
    static constexpr int kNumbers = 255;
    static constexpr int kLights = 1024;
    static double square(double v) { return v * v; }
    static float between(const float* table, float place) {
        const int k = static_cast<int>(place);
        return table[k] + (place - static_cast<float>(k)) * (table[k + 1] - table[k]);
    }
    std::array<float, kNumbers + 2> light_;
    std::array<float, kLights + 2> number_;
};

const Encoding& encoding() {
    static const Encoding table;
    return table;
}

}  // namespace

BlurredStep::Nodes BlurredStep::make_nodes() {
    Nodes nodes;
    for (std::size_t k = 0; k < nodes.size(); ++k) {
        const double u = static_cast<double>(k) / kPerWidth - kReach;
        nodes[k].bell = static_cast<float>(std::exp(-0.5 * u * u) / std::sqrt(2.0 * std::numbers::pi));
        nodes[k].integral = static_cast<float>(0.5 * std::erfc(-u / std::numbers::sqrt2));
    }
    return nodes;
}

BlurredStep::BlurredStep(double width_px, double normal_x, double normal_y) {
    static const Nodes nodes = make_nodes();
    nodes_ = nodes.data();
    const double x2 = normal_x * normal_x, y2 = normal_y * normal_y, w2 = width_px * width_px;
    quartic_ = static_cast<float>(kPixelQuartic * (x2 * x2 + y2 * y2) / (24.0 * w2 * w2));
}

MixCurve::MixCurve() {
    for (int k = 0; k <= kNodes; ++k) level_[k] = static_cast<float>(k) / kNodes;
}

MixCurve::MixCurve(const Bgr& low, const Bgr& high, const Bgr& weights) {
    const Encoding& srgb = encoding();
    level_.fill(0.0F);
    for (int c = 0; c < 3; ++c) {
        const float dark = srgb.light(low[c]), rise = (srgb.light(high[c]) - dark) / kNodes;
        for (int k = 1; k <= kNodes; ++k)
            level_[k] += weights[c] * (srgb.number(dark + static_cast<float>(k) * rise) - low[c]);
    }
}

Bgr half_light(const Bgr& low, const Bgr& high) {
    const Encoding& srgb = encoding();
    Bgr out;
    for (int c = 0; c < 3; ++c) out[c] = srgb.number(0.5F * (srgb.light(low[c]) + srgb.light(high[c])));
    return out;
}

}  // namespace rbdn
