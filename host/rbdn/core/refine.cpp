// Sub-pixel outlines: where the blurred step between two regions really lies, without touching the net.
#include "refine.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "corners.hpp"

namespace rbdn {

namespace {

constexpr double kPixelVariance = 1.0 / 12.0;
constexpr double kLeastWidth = 0.29, kMostWidth = 2.0;
constexpr float kLeastSeen = 1.2F;       // px
constexpr float kMostSeen = 4.0F;        // the same at places that a bent course takes farther off
constexpr float kSeen = 2.0F;            // widths of the blur in which a profile tells where the step is
constexpr int kPasses = 2;
constexpr int kFirstPasses = 4;          // where the blur is not known from the last frame
constexpr int kFewSidePixels = 8;
constexpr float kShade = 6.0F;           // grey levels between near and far that are no noise
constexpr int kRounds = 2;               // of the robust fit, each time
constexpr double kFirstGate = 1.5;       // px beyond which a profile is left out
constexpr double kGate = 5.0;            // and then in standard deviations
constexpr double kLeastGate = 0.25;
constexpr double kWeakContrast = 6.0;    // grey levels
constexpr double kFarthest = 2.5;        // px between the net and a believable step
constexpr double kStep = 2.0;            // px a vertex may be moved
constexpr double kCornerStep = 5.0;      // and a corner, which its edges' lines determine
constexpr double kCornerMargin = 2.9;    // px to another edge within which its blur is seen
constexpr double kStraightOn = 0.35;     // rad; outlines that turn less are smooth
constexpr double kSurelySharp = 1.3;     // rad; those that turn more are corners
constexpr double kArcShare = 0.4;        // of what an arc cuts off a corner, that tells one from the other
constexpr double kUnmeasured = 0.5;      // px that an edge may be off where nothing shows it
constexpr double kFloorSigma = 0.004;    // px, of a whole edge

// Evidence of how edges mix.
constexpr float kPure = 3.0F;            // widths of the blur from an edge
constexpr double kAlike = 0.3;
constexpr float kLeastAside = 5.0F;      // grey levels
constexpr int kMixingStride = 2;         // one profile in so many is asked
constexpr double kAsideError = 0.03;     // of light's full departure
constexpr double kVagueAside = 0.6;
constexpr double kMemory = 0.9;          // from frame to frame
constexpr double kExplained = 3.0;       // mean square error, in sigmas, that is no contradiction
constexpr double kProof = 20.0;          // difference of squares, in sigmas, that decides

double square(double v) { return v * v; }

// A side's colour, from near by only where it changes with the distance. Adds its variance, in those of a pixel.
Bgr own_colour(const SideColours& side, const Bgr& of_region, double& variance) {
    if (side.near.count < kFewSidePixels) {
        variance += 1.0 / kFewSidePixels;
        return side.far.count < kFewSidePixels ? of_region : side.far.mean();
    }
    const Bgr near = side.near.mean();
    if (side.far.count >= kFewSidePixels) {
        const Bgr change = side.far.mean() - near;
        if (dot(change, change) < kShade * kShade) {
            SideSum both = side.near;
            for (int c = 0; c < 3; ++c) both.sum[c] += side.far.sum[c];
            both.count += side.far.count;
            variance += 1.0 / both.count;
            return both.mean();
        }
    }
    variance += 1.0 / side.near.count;
    return near;
}

}  // namespace

Refinement Refiner::refine(const Mesh& mesh, const std::uint8_t* bgr, const std::vector<int>& labels,
                           const std::vector<int>& region_of, int region_count) {
    Refinement out;
    out.region_bgr = mean_colours(mesh, bgr, labels, region_of, region_count);
    out.mesh = with_whole_corners({mesh, bgr, labels, region_of, out.region_bgr});
    const View view{out.mesh, bgr, labels, region_of, out.region_bgr};
    view_ = &view;
    collect_edges();
    meet();
    for (EdgeFit& fit : fits_) {
        sample(fit);
        curves_.emplace_back(fit.low, fit.high, fit.weights);
    }
    for (std::size_t k = 0; k < fits_.size(); ++k) start(fits_[k], curves_[k]);
    weigh_mixing();
    if (mixing_.numbers_mix()) {
        curves_.assign(fits_.size(), MixCurve());
        for (std::size_t k = 0; k < fits_.size(); ++k) start(fits_[k], curves_[k]);
    }
    const int passes = width_is_known_ ? kPasses : kFirstPasses;
    width_is_known_ = !fits_.empty();
    for (int pass = 0; pass < passes; ++pass) {
        width_pull_ = width_weight_ = 0;
        for (std::size_t k = 0; k < fits_.size(); ++k) {
            if (!fits_[k].measured) continue;
            compare(fits_[k], curves_[k]);
            if (pass + 1 < passes) fit_course(fits_[k]);
        }
        if (pass + 1 < passes && width_weight_ > 0)
            width_ = std::clamp(width_ + std::clamp(width_pull_ / width_weight_, -0.3, 0.3), kLeastWidth, kMostWidth);
        if (pass == 0) judge_bends();
    }
    place_vertices(out);
    measure_areas(out);
    view_ = nullptr;
    return out;
}

void Refiner::collect_edges() {
    const Mesh& mesh = view_->mesh;
    fits_.clear();
    profiles_.clear();
    levels_.clear();
    curves_.clear();
    fit_of_edge_.assign(mesh.edges.size(), -1);
    for (int k = 0; k < static_cast<int>(mesh.edges.size()); ++k) {
        const Edge& e = mesh.edges[k];
        const double size = mesh.edge_length(e);
        if (!view_->is_outline(e) || size < 1e-6) continue;
        EdgeFit fit;
        fit.edge = k;
        fit.left = view_->region(e.left);
        fit.right = view_->region(e.right);
        fit.size = size;
        fit.unit = (1.0 / size) * mesh.along(e);
        fit.normal = left_normal(mesh.along(e));
        fit_of_edge_[k] = static_cast<int>(fits_.size());
        fits_.push_back(fit);
    }
}

void Refiner::sample(EdgeFit& fit) {
    SideColours left, right;
    fit.begin = static_cast<int>(profiles_.size());
    take_profiles(*view_, view_->mesh.edges[fit.edge], fit.clear_a, fit.clear_b, profiles_, left, right);
    fit.end = static_cast<int>(profiles_.size());
    fit.high = own_colour(left, view_->region_bgr[fit.left], fit.side_share);
    fit.low = own_colour(right, view_->region_bgr[fit.right], fit.side_share);

    const Bgr d = fit.high - fit.low;
    const float contrast2 = dot(d, d);
    fit.contrast2 = contrast2;
    fit.measured = contrast2 >= kWeakContrast * kWeakContrast && fit.end > fit.begin;
    if (!fit.measured) return;
    for (int c = 0; c < 3; ++c) fit.weights[c] = d[c] / contrast2;
    const float base = dot(fit.low, fit.weights);
    for (int k = fit.begin; k < fit.end; ++k) {
        Profile& p = profiles_[k];
        p.levels = static_cast<int>(levels_.size());
        const std::uint8_t* pixel = p.first;
        for (int i = 0; i < p.count; ++i, pixel += p.stride)
            levels_.push_back(pixel[0] * fit.weights[0] + pixel[1] * fit.weights[1] + pixel[2] * fit.weights[2] - base);
    }
}

// Which vertices are corners, and how much of each edge they spoil.
void Refiner::meet() {
    const Mesh& mesh = view_->mesh;
    smooth_.assign(mesh.vertices.size(), 0);
    doubtful_.assign(mesh.vertices.size(), 0);
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
        int count = 0;
        std::array<int, kMaxDegree> met{};
        for (int k : mesh.spokes[v])
            if (fit_of_edge_[k] >= 0) met[count++] = k;
        const Vec2 here = mesh.vertices[v].p;
        const auto away = [&](int k) {
            return (1.0 / fits_[fit_of_edge_[k]].size) * (mesh.vertices[mesh.edges[k].other_end(static_cast<int>(v))].p - here);
        };
        if (count == 2 && mesh.vertices[v].sides == 0) {
            const Vec2 u = away(met[0]), w = away(met[1]);
            const double turn = std::numbers::pi - std::acos(std::clamp(dot(u, w), -1.0, 1.0));
            smooth_[v] = turn <= kStraightOn;
            doubtful_[v] = turn > kStraightOn && turn < kSurelySharp;
            if (turn < kStraightOn) continue;
        }
        for (int i = 0; i < count; ++i) {
            EdgeFit& fit = fits_[fit_of_edge_[met[i]]];
            double clear = mesh.vertices[v].sides != 0 ? kCornerMargin : 0.0;
            const Vec2 u = away(met[i]);
            for (int j = 0; j < count; ++j) {
                if (j == i) continue;
                const Vec2 w = away(met[j]);
                const double sine = dot(u, w) > 0 ? std::abs(cross(u, w)) : 1.0;
                clear = std::max(clear, kCornerMargin / std::max(sine, 0.35));
            }
            clear = std::min(clear, 0.3 * fit.size);
            (mesh.edges[fit.edge].a == static_cast<int>(v) ? fit.clear_a : fit.clear_b) = clear;
        }
    }
    for (EdgeFit& fit : fits_) {
        const Edge& e = mesh.edges[fit.edge];
        fit.bent = smooth_[e.a] || smooth_[e.b] || doubtful_[e.a] || doubtful_[e.b];
    }
}

// A first guess: where the levels pass the one that half of each side makes.
void Refiner::start(EdgeFit& fit, const MixCurve& curve) {
    if (!fit.measured) return;
    offsets_.clear();
    const float half_way = curve.at(0.5F).level;
    for (int k = fit.begin; k < fit.end; ++k) {
        Profile& p = profiles_[k];
        const float* level = &levels_[p.levels];
        p.weight = 1.0F;
        p.usable = false;
        for (int i = 0; i + 1 < p.count; ++i) {
            if ((level[i] < half_way) == (level[i + 1] < half_way)) continue;
            const float part = (half_way - level[i]) / (level[i + 1] - level[i]);
            const float at = p.distance + (static_cast<float>(i) + part) * p.distance_step;
            if (p.usable && std::abs(at) >= std::abs(p.offset)) continue;
            p.offset = at;
            p.usable = true;
        }
        if (is_clear(fit, p)) offsets_.push_back(p.offset);
    }
    fit.measured = !offsets_.empty();
    if (!fit.measured) return;
    const auto half = offsets_.begin() + static_cast<std::ptrdiff_t>(offsets_.size() / 2);
    std::nth_element(offsets_.begin(), half, offsets_.end());
    fit.course = {*half, 0, 0};
    fit.gate = kFirstGate;
    fit_course(fit);
}

// Mixed light leaves the straight way between two colours, mixed numbers keep to it. What is seen to the side of
// that way does not depend on where the edge lies.
void Refiner::weigh_mixing() {
    mixing_.fade();
    for (const EdgeFit& fit : fits_) {
        if (!fit.measured) continue;
        const Bgr d = fit.high - fit.low, half = half_light(fit.low, fit.high);
        Bgr aside;  // by how much mixed light would leave the way, at most, times four
        for (int c = 0; c < 3; ++c) aside[c] = 4.0F * half[c] - 2.0F * (fit.low[c] + fit.high[c]);
        const float along = dot(aside, d) / fit.contrast2;
        for (int c = 0; c < 3; ++c) aside[c] -= along * d[c];
        const float size2 = dot(aside, aside);
        if (size2 < kLeastAside * kLeastAside) continue;
        const float base = dot(aside, fit.low);
        const BlurredStep step(width_, fit.normal.x, fit.normal.y);
        const auto per_width = static_cast<float>(1.0 / width_);
        const float size = std::sqrt(size2);
        double m = 0, mm = 0, ma = 0, aa = 0;
        int count = 0;
        for (int k = fit.begin; k < fit.end; k += kMixingStride) {
            const Profile& p = profiles_[k];
            if (!is_clear(fit, p)) continue;
            const std::uint8_t* pixel = p.first;
            float before = 0;
            bool was_pure = false;
            for (int i = 0; i < p.count; ++i, pixel += p.stride) {
                const float u = (p.distance + static_cast<float>(i) * p.distance_step - p.offset) * per_width;
                const float seen = (dot({float(pixel[0]), float(pixel[1]), float(pixel[2])}, aside) - base) / size2;
                const bool pure = std::abs(u) > kPure;
                if (pure && was_pure) mixing_.add_neighbours(seen * size, before * size);
                before = seen;
                was_pure = pure;
                if (std::abs(u) > kSeen) continue;
                const float share = step.at(u).share, mix = share * (1.0F - share);
                m += mix;
                mm += mix * mix;
                ma += mix * seen;
                aa += seen * seen;
                ++count;
            }
        }
        if (count < 10 || mm <= 0) continue;
        const double noise = (aa - ma * ma / mm) / (count - 1);
        mixing_.add(ma / mm, noise * (1.0 / mm + fit.side_share * square(m / mm)));
    }
}

void MixingEvidence::add(double aside, double variance) {
    variance += kAsideError * kAsideError;
    if (variance > kVagueAside * kVagueAside) return;
    count_ += 1.0;
    against_numbers_ += aside * aside / variance;
    against_light_ += (aside - 1.0) * (aside - 1.0) / variance;
}

void MixingEvidence::add_neighbours(double a, double b) {
    noise_ += 0.5 * (a * a + b * b);
    common_ += a * b;
    pairs_ += 1.0;
}

void MixingEvidence::fade() {
    for (double* sum : {&count_, &against_numbers_, &against_light_, &noise_, &common_, &pairs_}) *sum *= kMemory;
}

bool MixingEvidence::numbers_mix() const {
    // Demosaicing, compression and texture make neighbours err alike.
    const bool is_camera = common_ > kAlike * (noise_ + pairs_);
    return !is_camera && against_numbers_ < kExplained * count_ && against_light_ - against_numbers_ > kProof;
}

// Where each profile's step lies beside the course, to first order.
void Refiner::compare(EdgeFit& fit, const MixCurve& curve) {
    const BlurredStep step(width_, fit.normal.x, fit.normal.y);
    const auto width = static_cast<float>(width_), per_width = 1.0F / width;
    const auto c0 = static_cast<float>(fit.course.c0), c1 = static_cast<float>(fit.course.c1),
               c2 = static_cast<float>(fit.course.c2);
    double rest2 = 0;
    int free = 0;
    for (int k = fit.begin; k < fit.end; ++k) {
        Profile& p = profiles_[k];
        const float middle = (static_cast<float>(fit.course.at(p.crossing)) - p.distance) / p.distance_step;
        const float reach = std::max(kSeen * width, kLeastSeen) / std::abs(p.distance_step);
        const int begin = std::max(0, ceil_px(middle - reach)), end = std::min(p.count, floor_px(middle + reach) + 1);
        float gg = 0, gr = 0, rr = 0, hh = 0, hr = 0, gh = 0;
        for (int i = begin; i < end; ++i) {
            const float along = p.along + static_cast<float>(i) * p.along_step;
            const float course = c0 + along * (c1 + along * c2);
            const float u = (p.distance + static_cast<float>(i) * p.distance_step - course) * per_width;
            const BlurredStep::Share share = step.at(std::clamp(u, -kMostSeen, kMostSeen));
            const MixCurve::Level level = curve.at(share.share);
            const float r = levels_[p.levels + i] - level.level;
            const float g = -level.slope * share.slope * per_width;  // by the offset
            const float h = g * u;                                   // by the width
            gg += g * g;
            gr += g * r;
            rr += r * r;
            hh += h * h;
            hr += h * r;
            gh += g * h;
        }
        if (gg <= 0.02F * per_width) {
            p.usable = false;
            continue;
        }
        const float shift = gr / gg;
        p.offset = static_cast<float>(fit.course.at(p.crossing)) + shift;
        p.weight = gg;
        p.usable = std::abs(p.offset) <= kFarthest;
        if (!is_clear(fit, p)) continue;
        rest2 += std::max(0.0F, rr - shift * gr);
        free += end - begin - 1;
        const float square_rest = hh - gh * gh / gg;
        width_pull_ += fit.contrast2 * (hr - gh * shift);
        width_weight_ += fit.contrast2 * square_rest;
    }
    fit.level_noise = free > 0 ? rest2 / free : 0.0;
    fit.noise = fit.level_noise;
}

// The course through the profiles' places, robust against those that saw something else.
void Refiner::fit_course(EdgeFit& fit) {
    Course course = fit.course;
    for (int round = 0; round < kRounds; ++round) {
        // Moments about the middle of the edge, in units of its half length.
        const double unit = 2.0 / fit.size;
        std::array<double, 5> m{};
        std::array<double, 3> o{};
        double rest = 0;
        int used = 0;
        for (int k = fit.begin; k < fit.end; ++k) {
            const Profile& p = profiles_[k];
            if (!is_clear(fit, p)) continue;
            const double r = p.offset - course.at(p.crossing);
            const double q = r / fit.gate;
            if (std::abs(q) >= 1.0) continue;
            const double weight = p.weight * square(1.0 - q * q);
            const double t = p.crossing * unit;
            double power = weight;
            for (int j = 0; j < 5; ++j, power *= t) {
                m[j] += power;
                if (j < 3) o[j] += power * p.offset;
            }
            rest += weight * r * r;
            ++used;
        }
        if (used == 0 && fit.gate < kFirstGate) {
            // A sharp step moves as a whole when its blur is first guessed, out of its own narrow gate.
            fit.gate = kFirstGate;
            --round;
            continue;
        }
        if (used == 0) {
            fit.measured = false;
            return;
        }
        fit.weight = m[0];
        fit.centre = m[1] / m[0] / unit;
        fit.spread = (m[2] - m[1] * m[1] / m[0]) / (unit * unit);
        Course line{o[0] / m[0], 0, 0};
        // Short edges, and those seen in few places, keep their direction.
        if (used >= 4 && fit.spread / fit.weight > 1.0) {
            const double c1 = (o[1] - m[1] * o[0] / m[0]) / (m[2] - m[1] * m[1] / m[0]);
            line.c1 = std::clamp(c1 * unit, -0.3, 0.3);
            line.c0 -= line.c1 * fit.centre;
        }
        fit.line = course = line;
        if (fit.bent && used >= 5) {
            // Normal equations of the parabola, by Cramer's rule.
            const auto det = [](double a, double b, double c, double d, double e, double f, double g, double h,
                                double i) { return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g); };
            const double all = det(m[0], m[1], m[2], m[1], m[2], m[3], m[2], m[3], m[4]);
            if (all > 1e-7 * m[0] * m[0] * m[0]) {
                course.c0 = det(o[0], m[1], m[2], o[1], m[2], m[3], o[2], m[3], m[4]) / all;
                course.c1 = det(m[0], o[0], m[2], m[1], o[1], m[3], m[2], o[2], m[4]) / all * unit;
                course.c2 = det(m[0], m[1], o[0], m[1], m[2], o[1], m[2], m[3], o[2]) / all * unit * unit;
            }
        }
        fit.gate = std::max(kLeastGate, kGate * std::sqrt(rest / m[0]));
    }
    fit.course = course;
}

// A doubtful vertex is smooth where the outline near it cuts the corner of its edges' lines, more than blur does.
void Refiner::judge_bends() {
    const Mesh& mesh = view_->mesh;
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
        if (!doubtful_[v]) continue;
        double cut = 0, size = 0;
        std::array<Vec2, 2> away{};
        int count = 0;
        for (int k : mesh.spokes[v]) {
            if (fit_of_edge_[k] < 0) continue;
            const EdgeFit& fit = fits_[fit_of_edge_[k]];
            const bool at_a = mesh.edges[k].a == static_cast<int>(v);
            // As seen walking in through the first edge and out through the second one.
            const double facing = (count == 0) == at_a ? -1.0 : 1.0;
            for (int i = fit.begin; i < fit.end; ++i) {
                const Profile& p = profiles_[i];
                const bool near = at_a ? p.crossing < fit.clear_a - 0.5 * fit.size
                                       : p.crossing > 0.5 * fit.size - fit.clear_b;
                if (near && p.usable) cut += facing * (p.offset - fit.line.at(p.crossing)) * p.length;
            }
            size += 0.5 * fit.size;
            away[count++] = (at_a ? 1.0 : -1.0) * fit.unit;
        }
        const double turn = -std::atan2(cross(-1.0 * away[0], away[1]), dot(-1.0 * away[0], away[1]));
        const double bend = std::abs(turn);
        // What an arc of two such chords would leave outside, within the margins.
        const double height = size * bend / 8.0, seen = std::min(1.0, 2.0 * kCornerMargin / size);
        const double arc = height * size / 3.0 * (1.0 - square(1.0 - seen) * (1.0 - seen));
        const double blur = 0.5 * square(width_) * bend;
        smooth_[v] = (turn < 0 ? -cut : cut) > blur + kArcShare * arc;
        if (!smooth_[v]) continue;
        for (int k : mesh.spokes[v]) {
            if (fit_of_edge_[k] < 0) continue;
            EdgeFit& fit = fits_[fit_of_edge_[k]];
            (mesh.edges[k].a == static_cast<int>(v) ? fit.clear_a : fit.clear_b) = 0.0;
        }
    }
    for (EdgeFit& fit : fits_) {
        const Edge& e = mesh.edges[fit.edge];
        fit.bent = smooth_[e.a] || smooth_[e.b];
        if (!fit.bent) fit.course = fit.line;
    }
}

// Every vertex goes where the lines of its edges meet.
void Refiner::place_vertices(Refinement& out) {
    const Mesh& mesh = view_->mesh;
    const std::size_t n = mesh.vertices.size();
    out.vertices.resize(n);
    out.vertex_sigma.assign(n, std::numeric_limits<double>::quiet_NaN());
    on_outline_.resize(n);
    for (std::size_t k = 0; k < n; ++k) {
        const Vertex& v = mesh.vertices[k];
        out.vertices[k] = on_outline_[k] = v.p;
        double xx = 0, xy = 0, yy = 0, x = 0, y = 0;
        Vec2 sum{};
        double ends = 0;
        for (int spoke : mesh.spokes[k]) {
            if (fit_of_edge_[spoke] < 0) continue;
            const EdgeFit& fit = fits_[fit_of_edge_[spoke]];
            if (!fit.measured) continue;
            const double end = (mesh.edges[spoke].a == static_cast<int>(k) ? -0.5 : 0.5) * fit.size;
            // The line turned away from the edge by its slope.
            const double lengthening = std::sqrt(1.0 + square(fit.line.c1));
            const Vec2 normal = (1.0 / lengthening) * (fit.normal - fit.line.c1 * fit.unit);
            const double offset = fit.line.at(end) / lengthening;
            const double information = 1.0 / end_variance(fit, end);
            xx += information * normal.x * normal.x;
            xy += information * normal.x * normal.y;
            yy += information * normal.y * normal.y;
            x += information * normal.x * offset;
            y += information * normal.y * offset;
            sum = sum + std::clamp(fit.course.at(end), -kFarthest, kFarthest) * fit.normal;
            ends += 1.0;
        }
        const double trace = xx + yy;
        if (trace <= 0 || mesh.is_corner(static_cast<int>(k))) continue;
        const double determinant = xx * yy - xy * xy;
        const bool is_corner = !smooth_[k] && determinant > 0.02 * trace * trace;
        const double damping = is_corner ? 0.0 : 0.01 * trace;
        const double axx = xx + damping, ayy = yy + damping;
        const double det = axx * ayy - xy * xy;
        Vec2 move{(ayy * x - xy * y) / det, (axx * y - xy * x) / det};
        if (v.sides & (kLeftSide | kRightSide)) move = {0.0, yy > 0 ? y / yy : 0.0};
        if (v.sides & (kTopSide | kBottomSide)) move = {xx > 0 ? x / xx : 0.0, 0.0};
        const double limit = is_corner ? kCornerStep : kStep, size = length(move);
        if (size > limit) move = (limit / size) * move;
        const Vec2 place = v.p + move;
        out.vertices[k] = {std::clamp(place.x, 0.0, double(mesh.width)), std::clamp(place.y, 0.0, double(mesh.height))};
        on_outline_[k] = smooth_[k] ? v.p + (1.0 / ends) * sum : out.vertices[k];
        if (is_corner && v.sides == 0) {
            const double weakest = 0.5 * (trace - std::sqrt(std::max(0.0, trace * trace - 4 * determinant)));
            if (weakest > 0) out.vertex_sigma[k] = std::sqrt(1.0 / weakest);
        }
    }
}

// Of an edge's line at a place along it.
double Refiner::end_variance(const EdgeFit& fit, double t) const {
    const double slope = fit.spread / fit.weight > 1.0 ? square(t - fit.centre) / fit.spread : 0.0;
    return fit.noise * (1.0 / fit.weight + slope) + square(side_error(fit)) + square(kFloorSigma);
}

// Area of the polygon through the corners and points of the outline, plus what lies between both.
void Refiner::measure_areas(Refinement& out) {
    const Mesh& mesh = view_->mesh;
    std::vector<double> variance(view_->region_bgr.size(), 0.0);
    out.area.assign(view_->region_bgr.size(), 0.0);
    for (const Edge& e : mesh.edges) {
        const int left = view_->region(e.left), right = view_->region(e.right);
        if (e.dead || left == right) continue;
        // Shoelace; a region on the left is walked anticlockwise on the screen.
        const double swept = -0.5 * cross(on_outline_[e.a], on_outline_[e.b]);
        if (left >= 0) out.area[left] += swept;
        if (right >= 0) out.area[right] -= swept;
    }
    for (EdgeFit& fit : fits_) {
        const Edge& e = mesh.edges[fit.edge];
        double bulge = 0, error2 = square(kUnmeasured * fit.size);
        if (fit.measured) {
            const Vec2 a = on_outline_[e.a], b = on_outline_[e.b];
            const Vec2 chord = (1.0 / std::max(length(b - a), 1e-9)) * (b - a);
            const Vec2 middle = 0.5 * (mesh.vertices[e.a].p + mesh.vertices[e.b].p);
            for (int k = fit.begin; k < fit.end; ++k) {
                const Profile& p = profiles_[k];
                if (!is_clear(fit, p)) continue;
                const Vec2 at = middle + p.crossing * fit.unit + p.offset * fit.normal;
                bulge += cross(at - a, chord) * p.length;  // positive towards the left
                const double sigma = std::sqrt(fit.noise / p.weight + square(side_error(fit)) + square(kFloorSigma));
                out.outline.push_back({at, -1.0 * fit.normal, fit.left, fit.right, p.length, sigma});
            }
            error2 = square(fit.size) * (fit.noise / fit.weight + square(side_error(fit)) + square(kFloorSigma));
        }
        out.area[fit.left] -= bulge;
        out.area[fit.right] += bulge;
        variance[fit.left] += error2;
        variance[fit.right] += error2;
    }
    // The blur draws a bent outline inwards.
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
        if (!smooth_[v]) continue;
        const EdgeFit* met[2] = {nullptr, nullptr};
        int count = 0;
        for (int k : mesh.spokes[v])
            if (fit_of_edge_[k] >= 0 && count < 2) met[count++] = &fits_[fit_of_edge_[k]];
        const Vec2 here = mesh.vertices[v].p;
        const auto& in = mesh.edges[met[0]->edge];
        const auto& on = mesh.edges[met[1]->edge];
        const Vec2 before = mesh.vertices[in.other_end(static_cast<int>(v))].p;
        const Vec2 after = mesh.vertices[on.other_end(static_cast<int>(v))].p;
        const double turn = std::atan2(cross(here - before, after - here), dot(here - before, after - here));
        const bool is_b = in.b == static_cast<int>(v);
        const double drawn = 0.5 * square(width_) * turn;
        out.area[is_b ? met[0]->left : met[0]->right] -= drawn;
        out.area[is_b ? met[0]->right : met[0]->left] += drawn;
    }
    out.area_sigma.resize(variance.size());
    for (std::size_t r = 0; r < variance.size(); ++r) out.area_sigma[r] = std::sqrt(variance[r]);
}

// What errors of the sides' colours do to the place of the step, px.
double Refiner::side_error(const EdgeFit& fit) const {
    return std::sqrt(std::numbers::pi) * width_ * std::sqrt(fit.level_noise * fit.side_share);
}

}  // namespace rbdn
