// Sub-pixel outlines: where the blurred step between two regions really lies, without touching the net.
#include "refine.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace rbdn {

namespace {

constexpr double kBand = 3.0;         // half width of the band that holds the blurred step, px
constexpr double kTap = 0.5;          // sampling along the normal, px
constexpr int kHalfTaps = 6;          // kBand / kTap
constexpr int kTaps = 2 * kHalfTaps + 1;
constexpr int kSideTaps = 4;          // samples of each side's own colour, beyond the band, 1 px apart
constexpr int kMeanReach = 6;         // neighbouring profiles that share the sides' colours
constexpr double kWeakContrast = 0.02;  // in linear light, 1 = white
constexpr double kFarthest = 2.5;     // px between the net and a believable step
constexpr double kSharpTurn = 0.7;    // rad; profiles near a sharper corner see both edges
constexpr double kCornerMargin = 3.0;
constexpr double kCorrelation = 2.0;  // px along the outline over which errors go together
constexpr double kFloorSigma = 0.02;  // px; interpolation and quantisation
constexpr double kStepLimit = 2.0;    // px a vertex may be moved

using Rgb = std::array<double, 3>;

double dot3(const Rgb& a, const Rgb& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// The image along the normal of one edge at one place.
struct Profile {
    double s;  // distance from end a, px
    bool usable = false;
    std::array<Rgb, kTaps> band;  // from the right side to the left one
    Rgb left_sum{}, right_sum{};
    int left_count = 0, right_count = 0;
    double offset = 0;   // of the step from the edge, towards the left, px
    double sigma = 0;
};

struct EdgeFit {
    std::vector<Profile> profiles;
    double spacing = 0;
    double offset_a = 0, offset_b = 0;  // of the fitted line at the edge's ends
    double information = 0;             // 1 / variance of the line's mean offset
};

class Refiner {
public:
    Refiner(const Mesh& mesh, const LinearImage& image, const std::vector<int>& labels,
            const std::vector<int>& region_of, int region_count)
        : mesh_(mesh), image_(image), labels_(labels), region_of_(region_of), region_count_(region_count),
          fits_(mesh.edges.size()) {}

    Refinement run() {
        for (int e = 0; e < static_cast<int>(mesh_.edges.size()); ++e)
            if (is_outline(mesh_.edges[e])) fits_[e] = fit_edge(mesh_.edges[e]);
        Refinement out;
        place_vertices(out);
        measure_areas(out);
        return out;
    }

private:
    int region(int face) const { return face < 0 ? kOutside : region_of_[face]; }
    bool is_outline(const Edge& e) const { return !e.on_border() && region(e.left) != region(e.right); }

    int region_at(Vec2 p) const {
        const int x = floor_px(p.x), y = floor_px(p.y);
        return region_of_[labels_[static_cast<std::size_t>(y) * mesh_.width + x]];
    }
    bool inside(Vec2 p) const {
        return p.x >= 0.5 && p.y >= 0.5 && p.x <= mesh_.width - 0.5 - 1e-9 && p.y <= mesh_.height - 0.5 - 1e-9;
    }

    // Length at an edge's end whose profiles are spoilt by another edge.
    double margin_at(const Edge& e, int vertex) const {
        int outlines = 0;
        const Edge* other = nullptr;
        for (int k : mesh_.spokes[vertex]) {
            const Edge& spoke = mesh_.edges[k];
            if (!is_outline(spoke)) continue;
            ++outlines;
            if (&spoke != &e) other = &spoke;
        }
        if (mesh_.vertices[vertex].sides != 0) return kBand;
        if (outlines != 2) return kCornerMargin;
        const Vec2 here = mesh_.vertices[vertex].p;
        const Vec2 in = here - mesh_.vertices[e.other_end(vertex)].p;
        const Vec2 out = mesh_.vertices[other->other_end(vertex)].p - here;
        return std::abs(std::atan2(cross(in, out), dot(in, out))) > kSharpTurn ? kCornerMargin : 0.0;
    }

    Profile sample_profile(const Edge& e, double s, Vec2 centre, Vec2 normal) const {
        Profile profile;
        profile.s = s;
        const int left = region(e.left), right = region(e.right);
        const Vec2 reach = kBand * normal;
        if (!inside(centre + reach) || !inside(centre - reach)) return profile;
        for (int k = 0; k < kTaps; ++k) {
            const int owner = region_at(centre + ((k - kHalfTaps) * kTap) * normal);
            if (owner != left && owner != right) return profile;
        }
        for (int k = 0; k < kTaps; ++k) {
            const auto c = image_.at(centre + ((k - kHalfTaps) * kTap) * normal);
            profile.band[k] = {c[0], c[1], c[2]};
        }
        for (int k = 0; k < kSideTaps; ++k) {
            const double d = kBand + 0.5 + k;
            const auto add = [&](Vec2 p, int owner, Rgb& sum, int& count) {
                if (!inside(p) || region_at(p) != owner) return;
                const auto c = image_.at(p);
                for (int i = 0; i < 3; ++i) sum[i] += c[i];
                ++count;
            };
            add(centre + d * normal, left, profile.left_sum, profile.left_count);
            add(centre - d * normal, right, profile.right_sum, profile.right_count);
        }
        profile.usable = true;
        return profile;
    }

    // The step's place in one profile: the integral of the mixing ratio, which is not clamped so that noise
    // does not push it to one side.
    static void locate_step(std::vector<Profile>& profiles, std::size_t index) {
        Profile& profile = profiles[index];
        Rgb left{}, right{}, d{};
        int left_count = 0, right_count = 0;
        const std::size_t low = index >= kMeanReach ? index - kMeanReach : 0;
        const std::size_t high = std::min(profiles.size(), index + kMeanReach + 1);
        for (std::size_t k = low; k < high; ++k) {
            for (int i = 0; i < 3; ++i) {
                left[i] += profiles[k].left_sum[i];
                right[i] += profiles[k].right_sum[i];
            }
            left_count += profiles[k].left_count;
            right_count += profiles[k].right_count;
        }
        profile.usable = false;
        if (left_count < 4 || right_count < 4) return;
        for (int i = 0; i < 3; ++i) {
            left[i] /= left_count;
            right[i] /= right_count;
            d[i] = left[i] - right[i];
        }
        const double contrast2 = dot3(d, d);
        if (contrast2 < kWeakContrast * kWeakContrast) return;
        double integral = 0;
        double ripple = 0;  // of the outer taps, which should be pure
        const std::size_t n = profile.band.size();
        for (std::size_t k = 0; k < n; ++k) {
            Rgb from_right{};
            for (int i = 0; i < 3; ++i) from_right[i] = profile.band[k][i] - right[i];
            const double ratio = dot3(from_right, d) / contrast2;
            integral += (k == 0 || k + 1 == n ? 0.5 : 1.0) * kTap * ratio;
            if (k < 2) ripple += ratio * ratio;
            if (k + 2 >= n) ripple += (1.0 - ratio) * (1.0 - ratio);
        }
        profile.offset = kBand - integral;
        profile.sigma = std::sqrt(ripple / 4.0 * 2.0 * kBand * 0.5 + kFloorSigma * kFloorSigma);
        profile.usable = std::abs(profile.offset) <= kFarthest;
    }

    EdgeFit fit_edge(const Edge& e) const {
        EdgeFit fit;
        const double size = mesh_.edge_length(e);
        if (size < 1e-6) return fit;
        const Vec2 a = mesh_.vertices[e.a].p;
        const Vec2 unit = (1.0 / size) * mesh_.along(e);
        const Vec2 normal = left_normal(mesh_.along(e));
        const int count = std::max(1, static_cast<int>(std::lround(size)));
        fit.spacing = size / count;
        double margin_a = margin_at(e, e.a), margin_b = margin_at(e, e.b);
        if (margin_a + margin_b > size - 2.0) {
            margin_a = std::min(margin_a, 0.25 * size);
            margin_b = std::min(margin_b, 0.25 * size);
        }
        fit.profiles.reserve(count);
        for (int k = 0; k < count; ++k) {
            const double s = (k + 0.5) * fit.spacing;
            if (s < margin_a || s > size - margin_b) continue;
            Profile profile = sample_profile(e, s, a + s * unit, normal);
            if (profile.usable) fit.profiles.push_back(std::move(profile));
        }
        for (std::size_t k = 0; k < fit.profiles.size(); ++k) locate_step(fit.profiles, k);
        std::erase_if(fit.profiles, [](const Profile& p) { return !p.usable; });
        fit_line(fit, size);
        return fit;
    }

    // Robust straight line through the steps of one edge.
    static void fit_line(EdgeFit& fit, double size) {
        const auto& points = fit.profiles;
        if (points.empty()) return;
        std::vector<double> sorted;
        for (const Profile& p : points) sorted.push_back(p.offset);
        std::nth_element(sorted.begin(), sorted.begin() + sorted.size() / 2, sorted.end());
        double mean = sorted[sorted.size() / 2], slope = 0, variance = 0;
        for (int round = 0; round < 3; ++round) {
            double w = 0, ws = 0, wss = 0, wo = 0, wso = 0, wrr = 0;
            for (const Profile& p : points) {
                const double s = p.s - size / 2;
                const double r = p.offset - mean - slope * s;
                const double u = r / (3.0 * std::max(p.sigma, 0.15));
                if (std::abs(u) >= 1.0) continue;
                const double weight = (1 - u * u) * (1 - u * u) / (p.sigma * p.sigma);
                w += weight;
                ws += weight * s;
                wss += weight * s * s;
                wo += weight * p.offset;
                wso += weight * s * p.offset;
                wrr += weight * r * r;
            }
            if (w <= 0) return;
            const double spread = wss - ws * ws / w;
            // Short edges, and those seen in few places, keep their direction.
            slope = points.size() >= 4 && spread / w > 2.0 ? (wso - ws * wo / w) / spread : 0.0;
            slope = std::clamp(slope, -0.3, 0.3);
            mean = (wo - slope * ws) / w;
            variance = std::max(wrr / w, kFloorSigma * kFloorSigma);
        }
        fit.offset_a = std::clamp(mean - slope * size / 2, -kFarthest, kFarthest);
        fit.offset_b = std::clamp(mean + slope * size / 2, -kFarthest, kFarthest);
        const double independent = std::max(1.0, static_cast<double>(points.size()) * fit.spacing / kCorrelation);
        fit.information = independent / variance;
    }

    // Every vertex goes where the fitted lines of its edges meet.
    void place_vertices(Refinement& out) const {
        const std::size_t n = mesh_.vertices.size();
        out.vertices.resize(n);
        out.vertex_sigma.assign(n, std::numeric_limits<double>::quiet_NaN());
        for (std::size_t k = 0; k < n; ++k) {
            const Vertex& v = mesh_.vertices[k];
            out.vertices[k] = v.p;
            double xx = 0, xy = 0, yy = 0, x = 0, y = 0;
            for (int spoke : mesh_.spokes[k]) {
                const Edge& e = mesh_.edges[spoke];
                const EdgeFit& fit = fits_[spoke];
                if (fit.information <= 0) continue;
                const Vec2 normal = left_normal(mesh_.along(e));
                const double offset = e.a == static_cast<int>(k) ? fit.offset_a : fit.offset_b;
                xx += fit.information * normal.x * normal.x;
                xy += fit.information * normal.x * normal.y;
                yy += fit.information * normal.y * normal.y;
                x += fit.information * normal.x * offset;
                y += fit.information * normal.y * offset;
            }
            const double trace = xx + yy;
            if (trace <= 0 || mesh_.is_corner(static_cast<int>(k))) continue;
            const double determinant = xx * yy - xy * xy;
            const bool is_corner = determinant > 0.02 * trace * trace;
            const double damping = is_corner ? 0.0 : 0.01 * trace;
            const double axx = xx + damping, ayy = yy + damping;
            const double det = axx * ayy - xy * xy;
            Vec2 move{(ayy * x - xy * y) / det, (axx * y - xy * x) / det};
            if (v.sides & (kLeftSide | kRightSide)) move = {0.0, yy > 0 ? y / yy : 0.0};
            if (v.sides & (kTopSide | kBottomSide)) move = {xx > 0 ? x / xx : 0.0, 0.0};
            const double size = length(move);
            if (size > kStepLimit) move = (kStepLimit / size) * move;
            out.vertices[k] = v.p + move;
            if (is_corner && v.sides == 0) {
                const double weakest = 0.5 * (trace - std::sqrt(std::max(0.0, trace * trace - 4 * determinant)));
                if (weakest > 0) out.vertex_sigma[k] = std::sqrt(1.0 / weakest);
            }
        }
    }

    // Area of the refined polygons, plus what lies between them and the measured outline.
    void measure_areas(Refinement& out) const {
        out.area.assign(region_count_, 0.0);
        std::vector<double> variance(region_count_, 0.0);
        for (std::size_t k = 0; k < mesh_.edges.size(); ++k) {
            const Edge& e = mesh_.edges[k];
            const int left = region(e.left), right = region(e.right);
            if (left == right) continue;
            const Vec2 a = out.vertices[e.a], b = out.vertices[e.b];
            // Shoelace; a region on the left is walked anticlockwise on the screen.
            const double swept = -0.5 * cross(a, b);
            if (left >= 0) out.area[left] += swept;
            if (right >= 0) out.area[right] -= swept;

            const EdgeFit& fit = fits_[k];
            if (fit.profiles.empty()) continue;
            const Vec2 start = mesh_.vertices[e.a].p;
            const double size = mesh_.edge_length(e);
            const Vec2 unit = (1.0 / size) * mesh_.along(e);
            const Vec2 normal = left_normal(mesh_.along(e));
            const Vec2 chord_unit = (1.0 / std::max(length(b - a), 1e-9)) * (b - a);
            double bulge = 0, spread = 0;
            for (const Profile& p : fit.profiles) {
                const Vec2 step = start + p.s * unit + p.offset * normal;
                bulge += cross(step - a, chord_unit) * fit.spacing;  // positive towards the left
                spread += p.sigma * p.sigma * fit.spacing * kCorrelation;
                out.outline.push_back({step, -1.0 * normal, left, right, fit.spacing, p.sigma});
            }
            out.area[left] -= bulge;
            out.area[right] += bulge;
            variance[left] += spread;
            variance[right] += spread;
        }
        out.area_sigma.resize(region_count_);
        for (int r = 0; r < region_count_; ++r) out.area_sigma[r] = std::sqrt(variance[r]);
    }

    const Mesh& mesh_;
    const LinearImage& image_;
    const std::vector<int>& labels_;
    const std::vector<int>& region_of_;
    int region_count_;
    std::vector<EdgeFit> fits_;
};

}  // namespace

LinearImage::LinearImage() {
    for (int v = 0; v < 256; ++v) {
        const double s = v / 255.0;
        linear_[v] = static_cast<float>(s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4));
    }
}

void LinearImage::load(const std::uint8_t* bgr, int width, int height) {
    bgr_ = bgr;
    width_ = width;
    height_ = height;
}

std::array<float, 3> LinearImage::at(Vec2 p) const {
    const double x = p.x - 0.5, y = p.y - 0.5;
    const int x0 = std::clamp(floor_px(x), 0, width_ - 2);
    const int y0 = std::clamp(floor_px(y), 0, height_ - 2);
    const auto u = static_cast<float>(x - x0), v = static_cast<float>(y - y0);
    const std::uint8_t* row = bgr_ + 3 * (static_cast<std::size_t>(y0) * width_ + x0);
    const std::uint8_t* below = row + 3 * width_;
    std::array<float, 3> out{};
    for (int k = 0; k < 3; ++k) {
        const int c = 2 - k;
        out[k] = (1 - v) * ((1 - u) * linear_[row[c]] + u * linear_[row[3 + c]]) +
                 v * ((1 - u) * linear_[below[c]] + u * linear_[below[3 + c]]);
    }
    return out;
}

Refinement refine(const Mesh& mesh, const LinearImage& image, const std::vector<int>& labels,
                  const std::vector<int>& region_of, int region_count) {
    return Refiner(mesh, image, labels, region_of, region_count).run();
}

}  // namespace rbdn
