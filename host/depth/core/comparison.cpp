#include "comparison.hpp"

#include <algorithm>
#include <cmath>

namespace depth {

namespace {
constexpr double LIKE_NORMAL = 0.8;    // cosine between a sample's normal and its match's
constexpr double LIKE_RGB = 40.0;      // distance of mean colours below which two regions may be the same
constexpr double ALONG_PX = 3.0;       // a match may lie so far along the outline
constexpr double NEAREST_SHARE = 0.05; // of its depth, nearer than which a sample would be behind the camera
}  // namespace

std::vector<Face> faces_of(const FrameView& frame) {
    std::vector<Face> out;
    for (const RegionView& r : frame.regions) out.push_back({r.id, r.rgb});
    return out;
}

Comparison::Comparison(const Camera& camera, const std::vector<const Keyframe*>& keyframes,
                       const std::vector<Face>& faces, const Samples& samples)
    : camera_(camera), samples_(&samples), keyframes_(keyframes) {
    for (const Keyframe* then : keyframes_) {
        std::vector<char>& alike = alike_.emplace_back();
        for (const Face& a : faces)
            for (const Face& b : then->faces)
                alike.push_back(a.id == b.id || length(a.rgb - b.rgb) < LIKE_RGB);
    }
}

void Comparison::place(const Path& path, int present) {
    moves_.clear(), ahead_here_.clear(), ahead_there_.clear();
    for (const Keyframe* then : keyframes_) {
        moves_.push_back(path.move(present, then->frame));
        const Mat3 back = transposed(path.rotation(then->frame));
        ahead_here_.push_back(back * path.at(present).ahead);
        ahead_there_.push_back(back * path.at(then->frame).ahead);
    }
    const std::size_t points = samples_->rows.size() / 2, frames = keyframes_.size();
    turned_.resize(points * frames);
    for (std::size_t i = 0; i < points; ++i) {
        const Sample& s = samples_->rows[2 * i];
        for (std::size_t k = 0; k < frames; ++k) {
            Turned& t = turned_[i * frames + k];
            const Mat3& turn = moves_[k].turn;
            t.ray = turn * s.ray;
            // the outline's direction turns with the camera
            const Vec3 swing = turn * Vec3{s.along.x, s.along.y, 0.0};
            const double inverse = 1 / t.ray.z;
            const double tx = (swing.x - t.ray.x * inverse * swing.z) * camera_.fx;
            const double ty = (swing.y - t.ray.y * inverse * swing.z) * camera_.fy;
            const double size = 1 / std::sqrt(std::max(tx * tx + ty * ty, 1e-24));
            t.nx = static_cast<float>(ty * size), t.ny = static_cast<float>(-tx * size);
            t.direction = direction_of(t.nx, t.ny);
        }
    }
}

bool Comparison::match(std::size_t row, std::size_t k, double rho, Matched& out) const {
    const Turned& turned = turned_[row / 2 * keyframes_.size() + k];
    const Vec3 a = turned.ray + rho * moves_[k].shift_cm;
    if (!(a.z > NEAREST_SHARE)) return false;
    const Vec2 q = camera_.pixel(a);
    const ContourMap::Point* there = keyframes_[k]->map.nearest(static_cast<float>(q.x), static_cast<float>(q.y),
                                                                turned.direction);
    if (there == nullptr) return false;
    const double nx = turned.nx, ny = turned.ny;
    double cosine = nx * there->nx + ny * there->ny;
    const bool opposite = cosine < 0;
    if (opposite) cosine = -cosine;
    if (!(cosine > LIKE_NORMAL)) return false;
    const Sample& s = samples_->rows[row];
    // the region itself must lie on the same side of the edge; what lies beyond may have changed
    const std::int32_t inner = (s.side == 0) != opposite ? there->left : there->right;
    const std::size_t widest = keyframes_[k]->faces.size();
    if (!alike_[k][static_cast<std::size_t>(s.region) * widest + static_cast<std::size_t>(inner)]) return false;
    // between two points of an arc the mean normal is across their chord
    const double half = 1 / std::sqrt(2 + 2 * cosine), sense = opposite ? -1 : 1;
    out.nx = (there->nx * sense + nx) * half;
    out.ny = (there->ny * sense + ny) * half;
    const double dx = q.x - there->x, dy = q.y - there->y;
    if (!(std::abs(dx * out.ny - dy * out.nx) < ALONG_PX)) return false;
    out.residual = dx * out.nx + dy * out.ny;
    out.seen = a;
    return true;
}

bool Comparison::residual(std::size_t row, std::size_t k, double rho, double& px) const {
    Matched m;
    if (!match(row, k, rho, m)) return false;
    px = m.residual;
    return true;
}

Look Comparison::look(std::size_t row, std::size_t k, double rho, bool cameras) const {
    Look out;
    Matched m;
    if (!match(row, k, rho, m)) return out;
    const double inverse = 1 / m.seen.z, x = m.seen.x * inverse, y = m.seen.y * inverse;
    const double fx = camera_.fx * m.nx * inverse, fy = camera_.fy * m.ny * inverse;
    const auto px = [&](Vec3 da) { return (da.x - x * da.z) * fx + (da.y - y * da.z) * fy; };
    const Move& move = moves_[k];
    const Sample& s = samples_->rows[row];
    out.good = true;
    out.residual = m.residual;
    out.gain = px(move.shift_cm);
    if (!cameras) return out;
    // e_x x p = (0, -1, y), e_y x p = (1, 0, -x)
    out.here = {px(move.turn * Vec3{0, -1, s.ray.y}), px(move.turn * Vec3{1, 0, -s.ray.x}),
                rho * px(ahead_here_[k])};
    out.there = {px(Vec3{0, m.seen.z, -m.seen.y}), px(Vec3{-m.seen.z, 0, m.seen.x}), -rho * px(ahead_there_[k])};
    return out;
}

}  // namespace depth
