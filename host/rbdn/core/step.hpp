// What a camera makes of a sharp edge: a step blurred by lens and pixel, whose sides mix in light or in numbers.
#pragma once

#include <array>

namespace rbdn {

using Bgr = std::array<float, 3>;  // blue, green, red as the camera encoded them, 0 to 255

inline float dot(const Bgr& a, const Bgr& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline Bgr operator-(const Bgr& a, const Bgr& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

// The share of its upper side that a pixel sees at a distance from an edge, and how fast it changes.
//
// Lens and pixel together are taken for a Gaussian of their common variance, with the fourth cumulant of the
// pixel's square put right: that serves every direction, and errs by a percent or two where the lens is ideal.
class BlurredStep {
public:
    static constexpr float kReach = 4.0F;  // widths, beyond which a pixel sees one side only

    // The width is the Gaussian's sigma; the normal tells how the pixel lies to the edge.
    BlurredStep(double width_px, double normal_x, double normal_y);

    struct Share {
        float share;
        float slope;  // by the distance in widths
    };

    // `u` is the distance in widths, within kReach.
    Share at(float u) const {
        const float place = (u + kReach) * kPerWidth;
        const int k = static_cast<int>(place);
        const float rest = place - static_cast<float>(k);
        const Node& a = nodes_[k];
        const Node& b = nodes_[k + 1];
        const float bell = a.bell + rest * (b.bell - a.bell);
        const float square = u * u;
        return {a.integral + rest * (b.integral - a.integral) - quartic_ * u * (square - 3.0F) * bell,
                bell * (1.0F + quartic_ * (square * square - 6.0F * square + 3.0F))};
    }

private:
    static constexpr int kPerWidth = 64;
    struct Node {
        float bell;
        float integral;
    };
    using Nodes = std::array<Node, 2 * static_cast<int>(kReach) * kPerWidth + 2>;
    static Nodes make_nodes();

    const Node* nodes_;
    float quartic_;
};

// The level between two sides (0 and 1) that follows from the upper side's share.
class MixCurve {
public:
    MixCurve();  // numbers mix, as where an image was drawn or resized: the share itself

    // Light mixes, as in a camera. `weights` project colours above `low` onto the way to `high`.
    MixCurve(const Bgr& low, const Bgr& high, const Bgr& weights);

    struct Level {
        float level;
        float slope;  // by the share
    };
    Level at(float share) const {
        const float place = share <= 0.0F ? 0.0F : share >= 1.0F ? kNodes - 1e-3F : share * kNodes;
        const int k = static_cast<int>(place);
        const float rise = level_[k + 1] - level_[k];
        return {level_[k] + (place - static_cast<float>(k)) * rise, rise * kNodes};
    }

private:
    static constexpr int kNodes = 64;
    std::array<float, kNodes + 1> level_;
};

// Both sides' light in equal parts, encoded as their numbers are.
Bgr half_light(const Bgr& low, const Bgr& high);

}  // namespace rbdn
