// Colour steps across edges, lightness in full: what tells an outline from shading.
#include "jumps.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace rbdn {

namespace {

// Pixels from the edge at which its sides are looked at: past its blur, and farther on for their slopes.
constexpr std::array<int, 2> kNear{2, 3};
constexpr std::array<int, 2> kFar{5, 6};
constexpr float kAcross = 6.0F;  // px from the near pixels of one side to those of the other
constexpr float kOutward = 3.0F;  // px from near to far
constexpr int kFewSamples = 3;
constexpr float kPaintProof = 4.0F;  // an outline may jump by so many times what the paint differs

struct Side {
    std::array<float, 3> near{};
    std::array<float, 3> rise{};  // from near to far
    int near_count = 0;
    int rise_count = 0;

    float mean(int channel) const { return near[channel] / static_cast<float>(near_count); }
    float slope(int channel) const {
        return rise_count == 0 ? 0.0F : rise[channel] / (kOutward * static_cast<float>(rise_count));
    }
};

struct Sides {
    Side before, after;
};

// How much the hue of two colours differs beyond what a shadow does: that takes the same share of all light, and so
// of the cube roots in CIELAB.
float difference_of_paint(const Side& one, const Side& two, float lightness_gain) {
    const auto root = [&](const Side& side) {
        return lightness_gain * (side.mean(0) - Image::kBlack[0]) + 16.0F * Image::kUnitsPerLab;
    };
    const Side& dark = root(one) < root(two) ? one : two;
    const Side& light = root(one) < root(two) ? two : one;
    const float share = root(dark) / root(light);
    float difference2 = 0;
    for (int k : {1, 2}) {
        const float difference =
            (dark.mean(k) - Image::kBlack[k]) - share * (light.mean(k) - Image::kBlack[k]);
        difference2 += difference * difference;
    }
    return std::sqrt(difference2);
}

float jump_between(const Sides& s, float lightness_gain) {
    if (s.before.near_count < kFewSamples || s.after.near_count < kFewSamples) return 0.0F;
    float jump2 = 0;
    for (int k = 0; k < 3; ++k) {
        const float step = s.after.mean(k) - s.before.mean(k);
        const float drift = 0.5F * kAcross * (s.after.slope(k) - s.before.slope(k));
        // Slopes explain a step that goes their way; they never make one.
        const float explained = step > 0 ? std::clamp(drift, 0.0F, step) : std::clamp(drift, step, 0.0F);
        const float jump = (step - explained) * (k == 0 ? lightness_gain : 1.0F);
        jump2 += jump * jump;
    }
    return std::min(std::sqrt(jump2), kPaintProof * difference_of_paint(s.before, s.after, lightness_gain));
}

void look_along(const Mesh& mesh, const CrossingLines& lines, bool rows, const Image& image,
                const std::vector<char>& wanted, std::vector<Sides>& sides) {
    const int stride = 3 * (rows ? 1 : mesh.width);
    for (int k = 0; k < lines.line_count(); ++k) {
        const auto line = lines.line(k);
        const int at = k * lines.step();
        const std::uint8_t* first = rows ? image.row(at) : image.row(0) + 3 * at;
        for (std::size_t i = 1; i + 1 < line.size(); ++i) {
            const Crossing& c = line[i];
            if (!wanted[c.edge]) continue;
            const Vec2 along = mesh.along(mesh.edges[c.edge]);
            if ((std::abs(along.y) >= std::abs(along.x)) != rows) continue;
            const auto look = [&](Side& side, int from, int step, int room) {
                for (std::size_t n = 0; n < kNear.size() && kNear[n] < room; ++n) {
                    const Colour near = image.colour_of(first + (from + step * kNear[n]) * stride);
                    for (int ch = 0; ch < 3; ++ch) side.near[ch] += near[ch];
                    ++side.near_count;
                    if (kFar[n] >= room) continue;
                    const Colour far = image.colour_of(first + (from + step * kFar[n]) * stride);
                    for (int ch = 0; ch < 3; ++ch) side.rise[ch] += far[ch] - near[ch];
                    ++side.rise_count;
                }
            };
            const bool forward = c.before == mesh.edges[c.edge].left;
            Sides& s = sides[c.edge];
            look(forward ? s.before : s.after, c.pixel - 1, -1, c.pixel - line[i - 1].pixel);
            look(forward ? s.after : s.before, c.pixel, 1, line[i + 1].pixel - c.pixel);
        }
    }
}

}  // namespace

std::vector<float> measure_jumps(const Mesh& mesh, const Crossings& crossings, const Image& image,
                                 double most_apart, double lightness_gain) {
    std::vector<char> wanted(mesh.edges.size(), 0);
    bool any = false;
    for (std::size_t k = 0; k < mesh.edges.size(); ++k) {
        const Edge& e = mesh.edges[k];
        if (e.on_border() || e.left == e.right) continue;
        wanted[k] = distance2(mesh.faces[e.left].mean, mesh.faces[e.right].mean) <= most_apart * most_apart;
        any = any || wanted[k];
    }
    std::vector<float> jumps(mesh.edges.size(), 0.0F);
    if (!any) return jumps;
    std::vector<Sides> sides(mesh.edges.size());
    look_along(mesh, crossings.rows(), true, image, wanted, sides);
    look_along(mesh, crossings.columns(), false, image, wanted, sides);
    for (std::size_t k = 0; k < mesh.edges.size(); ++k)
        if (wanted[k]) jumps[k] = jump_between(sides[k], static_cast<float>(lightness_gain));
    return jumps;
}

double typical_difference(const Mesh& mesh, double lightness_gain) {
    std::vector<double> differences;
    for (const Edge& e : mesh.edges) {
        if (e.on_border() || e.left == e.right) continue;
        Colour a = mesh.faces[e.left].mean, b = mesh.faces[e.right].mean;
        a[0] *= static_cast<float>(lightness_gain);
        b[0] *= static_cast<float>(lightness_gain);
        differences.push_back(distance2(a, b));
    }
    if (differences.empty()) return 0.0;
    const auto middle = differences.begin() + static_cast<std::ptrdiff_t>(differences.size() / 2);
    std::nth_element(differences.begin(), middle, differences.end());
    return std::sqrt(*middle);
}

}  // namespace rbdn
