// Visibility by one ray a pixel; where surfaces meet, by 256 rays, whose mean is the pixel.
//
// The 256 points form a (0,8,2)-net: every 1/256 wide column or row of the pixel holds exactly one, so that
// edges along the pixel grid, too, are placed to 1/256 px. The net is scrambled and shifted pixel by pixel,
// which turns what error is left from a bias into noise. An edge pixel keeps 4x4 means of its own, so that the blur
// of the lens sees where in the pixel the edge runs: blurring whole pixels would shift edges by their place
// in the grid.
#include "render.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "places.hpp"
#include "shading.hpp"

namespace {

constexpr int samples = 256;
constexpr int cells = 4; // a side
constexpr int blur_radius = 3;
constexpr int tile = 8; // side of a tile of pixels that shares one list of surfaces

// Pixels with a margin all round; (x, y) counts from the image proper.
template <class T> class Plane {
public:
    Plane(int width, int height, int pad, T value)
        : pad_(pad), stride_(width + 2 * pad), data_(static_cast<std::size_t>(stride_) * (height + 2 * pad), value)
    {
    }
    T &at(int x, int y) { return data_[static_cast<std::size_t>(y + pad_) * stride_ + (x + pad_)]; }
    const T &at(int x, int y) const { return data_[static_cast<std::size_t>(y + pad_) * stride_ + (x + pad_)]; }

private:
    int pad_, stride_;
    std::vector<T> data_;
};

// Colours as rows of three floats a pixel, with a margin all round.
class Light3 {
public:
    Light3(int width, int height, int pad)
        : pad_(pad), stride_(width + 2 * pad), data_(3 * static_cast<std::size_t>(stride_) * (height + 2 * pad))
    {
    }
    float *at(int x, int y) { return &data_[place(x, y)]; }
    const float *at(int x, int y) const { return &data_[place(x, y)]; }
    const std::vector<float> &data() const { return data_; }

private:
    std::size_t place(int x, int y) const { return 3 * (static_cast<std::size_t>(y + pad_) * stride_ + (x + pad_)); }

    int pad_, stride_;
    std::vector<float> data_;
};

constexpr int16_t nothing = -1;

struct Visible {
    Places places;
    std::vector<Seen> seen;
    Plane<int16_t> which; // index into seen
    Plane<double> inverse_depth;

    Visible(const Scene &scene, const View &view, int margin)
        : places(view, margin), which(view.width, view.height, margin, nothing),
          inverse_depth(view.width, view.height, margin, 0.0)
    {
        for (const Surface &surface : scene.surfaces) {
            Seen s;
            if (see(surface, view, places, s))
                seen.push_back(s);
        }
        for (std::size_t k = 0; k < seen.size(); k++)
            draw(static_cast<int16_t>(k));
    }

    // Do surfaces meet in this pixel?
    bool mixed(int x, int y) const
    {
        const int16_t centre = which.at(x, y);
        for (int dy = -1; dy <= 1; dy++)
            for (int dx = -1; dx <= 1; dx++)
                if (which.at(x + dx, y + dy) != centre)
                    return true;
        return false;
    }

private:
    void draw(int16_t k)
    {
        const Seen &s = seen[k];
        const bool quad = s.surface->shape == Shape::quad;
        for (int y = s.box.y0; y < s.box.y1; y++)
            for (int x = s.box.x0; x < s.box.x1; x++) {
                const Place place = places.at(x, y);
                const double inverse
                    = quad ? quad_inverse_depth(s, place.x, place.y) : inverse_depth_at(s, place.x, place.y);
                if (inverse > inverse_depth.at(x, y)) {
                    inverse_depth.at(x, y) = inverse;
                    which.at(x, y) = k;
                }
            }
    }
};

// For each tile the surfaces that may show in it.
class Tiles {
public:
    explicit Tiles(const Visible &visible)
        : pad_(visible.places.pad), across_((visible.places.width + 2 * pad_) / tile + 1),
          lists_(static_cast<std::size_t>(across_) * ((visible.places.height + 2 * pad_) / tile + 1))
    {
        for (std::size_t k = 0; k < visible.seen.size(); k++) {
            const Box &box = visible.seen[k].box;
            for (int ty = (box.y0 + pad_) / tile; ty <= (box.y1 - 1 + pad_) / tile; ty++)
                for (int tx = (box.x0 + pad_) / tile; tx <= (box.x1 - 1 + pad_) / tile; tx++)
                    lists_[static_cast<std::size_t>(ty) * across_ + tx].push_back(static_cast<int16_t>(k));
        }
    }
    const std::vector<int16_t> &at(int x, int y) const
    {
        return lists_[static_cast<std::size_t>((y + pad_) / tile) * across_ + (x + pad_) / tile];
    }

private:
    int pad_, across_;
    std::vector<std::vector<int16_t>> lists_;
};

// Where in a pixel the samples are.
struct Net {
    std::array<double, samples> x{}, y{}; // from the pixel's centre
    std::array<uint8_t, samples> cell{};
};

// The net scrambled in several ways, and shifted by several parts of 1/256.
constexpr uint32_t net_count = 64;

const std::array<Net, net_count> &nets()
{
    static const std::array<Net, net_count> all = [] {
        std::array<Net, net_count> made;
        uint32_t h = 1;
        for (uint32_t n = 0; n < net_count; n++) {
            Net &net = made[n];
            h = h * 1664525u + 1013904223u;
            const int flip_x = h >> 24, flip_y = (h >> 16) & 255;
            const double shift_x = (n + 0.5) / net_count, shift_y = (n * 37 % net_count + 0.5) / net_count;
            for (int i = 0; i < samples; i++) {
                int reversed = ((i & 0x55) << 1) | ((i & 0xAA) >> 1);
                reversed = ((reversed & 0x33) << 2) | ((reversed & 0xCC) >> 2);
                reversed = ((reversed & 0x0F) << 4) | ((reversed & 0xF0) >> 4);
                const int ix = i ^ flip_x, iy = reversed ^ flip_y;
                net.x[i] = (ix + shift_x) / samples - 0.5;
                net.y[i] = (iy + shift_y) / samples - 0.5;
                net.cell[i] = static_cast<uint8_t>((iy / (samples / cells)) * cells + ix / (samples / cells));
            }
        }
        return made;
    }();
    return all;
}

const Net &net_of(int x, int y)
{
    uint32_t h = static_cast<uint32_t>(x) * 0x9E3779B1u ^ static_cast<uint32_t>(y) * 0x85EBCA77u;
    h ^= h >> 15, h *= 0x2C1B3C6Du;
    return nets()[h >> 26];
}

// What one surface has of a pixel.
struct Share {
    int16_t which = nothing;
    int count = 0;       // of the samples
    double x = 0, y = 0; // mean place of its samples in the pinhole's image
    double inverse_depth = 0; // mean
    std::array<uint16_t, cells * cells> in_cell{};
};

using Corners = std::array<double, 4>;

class Sampler {
public:
    explicit Sampler(const Visible &visible) : seen_(visible.seen), places_(visible.places) {}

    // Shares of the candidates that the pixel shows.
    const std::vector<Share> &shares(int x, int y, const std::vector<int16_t> &candidates)
    {
        place_ = places_.at(x, y);
        sort_out(candidates);
        shares_.clear();
        if (rivals_.size() == 1 && rivals_[0].whole) {
            Share &all = shares_.emplace_back();
            all = {rivals_[0].which, samples, place_.x, place_.y,
                   seen_[rivals_[0].which].inverse_depth.at(place_.x, place_.y), {}};
            all.in_cell.fill(samples / (cells * cells));
            return shares_;
        }
        const Net &net = net_of(x, y);
        for (int i = 0; i < samples; i++) {
            x_[i] = place_.x + place_.right_x * net.x[i] + place_.down_x * net.y[i];
            y_[i] = place_.y + place_.right_y * net.x[i] + place_.down_y * net.y[i];
        }
        inverse_.fill(0.0);
        winner_.fill(0); // 0: nothing
        shares_.resize(1);
        for (const Rival &rival : rivals_)
            test(rival);
        for (int i = 0; i < samples; i++) {
            Share &share = shares_[winner_[i]];
            share.count++;
            share.x += x_[i] - place_.x;
            share.y += y_[i] - place_.y;
            share.inverse_depth += inverse_[i];
            share.in_cell[net.cell[i]]++;
        }
        std::erase_if(shares_, [](const Share &s) { return s.which == nothing || s.count == 0; });
        for (Share &share : shares_) {
            share.x = place_.x + share.x / share.count;
            share.y = place_.y + share.y / share.count;
            share.inverse_depth /= share.count;
        }
        return shares_;
    }

private:
    struct Rival {
        int16_t which;
        bool whole;     // a quad that covers the pixel
        bool flat;      // so that its inverse depth at the corners bounds it
        Corners nearby; // inverse depth at the pixel's corners, from which it lies between
    };

    // Surfaces that may show in the pixel, without those wholly behind another.
    void sort_out(const std::vector<int16_t> &candidates)
    {
        rivals_.clear();
        for (const int16_t which : candidates) {
            const Seen &s = seen_[which];
            Rival rival{which, false, s.surface->planar(), {}};
            if (!touches(s, rival.whole))
                continue;
            for (int k = 0; k < 4; k++) {
                const double right = (k & 1) - 0.5, down = (k >> 1) - 0.5;
                rival.nearby[k] = s.inverse_depth.at(place_.x + right * place_.right_x + down * place_.down_x,
                                                     place_.y + right * place_.right_y + down * place_.down_y);
            }
            rivals_.push_back(rival);
        }
        for (std::size_t k = 0; k < rivals_.size(); k++) {
            if (!rivals_[k].whole)
                continue;
            const Rival front = rivals_[k];
            std::erase_if(rivals_, [&](const Rival &r) {
                return r.flat && r.which != front.which && front.nearby[0] > r.nearby[0] && front.nearby[1] > r.nearby[1]
                       && front.nearby[2] > r.nearby[2] && front.nearby[3] > r.nearby[3];
            });
            for (k = 0; rivals_[k].which != front.which;)
                k++;
        }
    }

    // By how much a linear function differs between the pixel's centre and its corners at most.
    double swing(const Linear &f) const
    {
        return 0.5 * (std::abs(f.x * place_.right_x + f.y * place_.right_y)
                      + std::abs(f.x * place_.down_x + f.y * place_.down_y));
    }

    bool touches(const Seen &s, bool &whole) const
    {
        if (s.surface->shape != Shape::quad)
            return may_touch(s, place_.x, place_.y);
        whole = true;
        for (const Linear &edge : s.inside) {
            const double middle = edge.at(place_.x, place_.y), half = swing(edge);
            if (middle < -half)
                return false;
            whole = whole && middle > half;
        }
        const double nearest = s.inverse_depth.at(place_.x, place_.y) + swing(s.inverse_depth);
        whole = whole && nearest < 1.0 / near_cm;
        return true;
    }

    // Let a surface have the samples at which it is nearer than all before it.
    void test(const Rival &rival)
    {
        const Seen &s = seen_[rival.which];
        const auto slot = static_cast<uint8_t>(shares_.size());
        if (slot == UINT8_MAX)
            return;
        shares_.emplace_back().which = rival.which;
        const auto take = [&](auto &&inverse_depth) {
            for (int i = 0; i < samples; i++) {
                const double inverse = inverse_depth(x_[i], y_[i]);
                const bool nearer = inverse > inverse_[i];
                inverse_[i] = nearer ? inverse : inverse_[i];
                winner_[i] = nearer ? slot : winner_[i];
            }
        };
        if (rival.whole)
            take([&](double px, double py) { return s.inverse_depth.at(px, py); });
        else if (s.surface->shape == Shape::quad)
            take([&](double px, double py) { return quad_inverse_depth(s, px, py); });
        else
            take([&](double px, double py) { return inverse_depth_at(s, px, py); });
    }

    const std::vector<Seen> &seen_;
    const Places &places_;
    Place place_;                          // of the pixel
    std::array<double, samples> x_{}, y_{}; // of its samples in the pinhole's image
    std::array<double, samples> inverse_{};
    std::array<uint8_t, samples> winner_{}; // index into shares_
    std::vector<Share> shares_;
    std::vector<Rival> rivals_;
};

// A pixel in which surfaces meet: how its parts differ from its mean.
struct MixedPixel {
    int x = 0, y = 0;
    std::array<Vec3, cells * cells> residual;
};

// Mean colour of a mixed pixel and of its cells.
Vec3 resolve(const Scene &scene, const View &view, const std::vector<Seen> &seen, const std::vector<Share> &shares,
             MixedPixel &pixel)
{
    constexpr double cell_samples = samples / (cells * cells);
    pixel.residual.fill(Vec3{});
    Vec3 mean;
    for (const Share &share : shares) {
        const Vec3 colour = shade(scene, seen[share.which], view, share.x, share.y, share.inverse_depth);
        mean = mean + (static_cast<double>(share.count) / samples) * colour;
        for (int c = 0; c < cells * cells; c++)
            pixel.residual[c] = pixel.residual[c] + (share.in_cell[c] / cell_samples) * colour;
    }
    for (Vec3 &cell : pixel.residual)
        cell = cell - mean;
    return mean;
}

// How much of a cell's light each pixel from -blur_radius to blur_radius receives, along one axis.
using Spread = std::array<std::array<double, 2 * blur_radius + 1>, cells>;

Spread spread_of(double sigma)
{
    // second antiderivative of the Gaussian
    const auto ramp = [&](double t) {
        constexpr double pi = 3.14159265358979323846;
        return 0.5 * t * std::erfc(-t / (sigma * std::sqrt(2.0)))
               + sigma * std::exp(-0.5 * t * t / (sigma * sigma)) / std::sqrt(2.0 * pi);
    };
    Spread spread{};
    for (int c = 0; c < cells; c++) {
        const double left = -0.5 + static_cast<double>(c) / cells, right = left + 1.0 / cells;
        double total = 0.0;
        for (int d = -blur_radius; d <= blur_radius; d++) {
            const double weight
                = ramp(d + 0.5 - left) - ramp(d + 0.5 - right) - ramp(d - 0.5 - left) + ramp(d - 0.5 - right);
            spread[c][d + blur_radius] = cells * weight;
            total += cells * weight;
        }
        for (double &weight : spread[c])
            weight /= total;
    }
    return spread;
}

// Lens blur of whole pixels, then of what mixed pixels have beyond their mean. `light` has a margin of
// blur_radius pixels; the result has none.
std::vector<float> blur(const Light3 &light, const std::vector<MixedPixel> &mixed, int width, int height, double sigma)
{
    const Spread spread = spread_of(sigma);
    std::array<float, 2 * blur_radius + 1> kernel{};
    for (std::size_t d = 0; d < kernel.size(); d++)
        for (const auto &cell : spread)
            kernel[d] += static_cast<float>(cell[d] / cells);

    const int row = 3 * width;
    std::vector<float> across(static_cast<std::size_t>(row) * (height + 2 * blur_radius));
    for (int y = -blur_radius; y < height + blur_radius; y++) {
        float *to = &across[static_cast<std::size_t>(y + blur_radius) * row];
        for (int d = -blur_radius; d <= blur_radius; d++) {
            const float *from = light.at(d, y), weight = kernel[d + blur_radius];
            for (int i = 0; i < row; i++)
                to[i] += weight * from[i];
        }
    }
    std::vector<float> bgr(static_cast<std::size_t>(row) * height);
    for (int y = 0; y < height; y++)
        for (int d = 0; d <= 2 * blur_radius; d++) {
            const float *from = &across[static_cast<std::size_t>(y + d) * row], weight = kernel[d];
            float *to = &bgr[static_cast<std::size_t>(y) * row];
            for (int i = 0; i < row; i++)
                to[i] += weight * from[i];
        }

    for (const MixedPixel &pixel : mixed) {
        for (int dx = -blur_radius; dx <= blur_radius; dx++) {
            const int x = pixel.x + dx;
            if (x < 0 || x >= width)
                continue;
            std::array<Vec3, cells> column{};
            for (int cy = 0; cy < cells; cy++)
                for (int cx = 0; cx < cells; cx++)
                    column[cy] = column[cy]
                                 + (spread[cx][dx + blur_radius] / (cells * cells)) * pixel.residual[cy * cells + cx];
            for (int dy = std::max(-blur_radius, -pixel.y); dy <= std::min(blur_radius, height - 1 - pixel.y); dy++) {
                Vec3 sum;
                for (int cy = 0; cy < cells; cy++)
                    sum = sum + spread[cy][dy + blur_radius] * column[cy];
                float *to = &bgr[static_cast<std::size_t>(pixel.y + dy) * row + 3 * x];
                to[0] += static_cast<float>(sum.x);
                to[1] += static_cast<float>(sum.y);
                to[2] += static_cast<float>(sum.z);
            }
        }
    }
    return bgr;
}

} // namespace

std::vector<float> render(const Scene &scene, const View &view, double psf_px)
{
    const int margin = psf_px > 0.0 ? blur_radius : 0;
    const Visible visible(scene, view, margin + 1); // one more: a pixel is judged by its neighbours
    const Tiles tiles(visible);
    Sampler sampler(visible);

    Light3 light(view.width, view.height, margin);
    std::vector<MixedPixel> mixed;
    for (int y = -margin; y < view.height + margin; y++)
        for (int x = -margin; x < view.width + margin; x++) {
            Vec3 colour;
            if (visible.mixed(x, y)) {
                MixedPixel pixel{x, y, {}};
                const std::vector<Share> &shares = sampler.shares(x, y, tiles.at(x, y));
                colour = resolve(scene, view, visible.seen, shares, pixel);
                if (shares.size() != 1 || shares[0].count != samples)
                    mixed.push_back(pixel);
            } else if (visible.which.at(x, y) != nothing) {
                const Place place = visible.places.at(x, y);
                colour = shade(scene, visible.seen[visible.which.at(x, y)], view, place.x, place.y,
                               visible.inverse_depth.at(x, y));
            }
            float *to = light.at(x, y);
            to[0] = static_cast<float>(colour.x);
            to[1] = static_cast<float>(colour.y);
            to[2] = static_cast<float>(colour.z);
        }
    if (psf_px > 0.0)
        return blur(light, mixed, view.width, view.height, psf_px);
    return light.data();
}

Truth truth(const Scene &scene, const View &view)
{
    const Visible visible(scene, view, 1);
    const Tiles tiles(visible);
    Sampler sampler(visible);

    int parts = 0;
    for (const Surface &surface : scene.surfaces)
        parts = std::max(parts, surface.part);
    Truth truth;
    truth.area.assign(parts + 1, 0.0);
    truth.mean_z.assign(parts + 1, 0.0);
    const auto count = [&](int16_t which, double area, double inverse_depth) {
        const int part = visible.seen[which].surface->part;
        truth.area[part] += area;
        truth.mean_z[part] += area / inverse_depth;
    };
    for (int y = 0; y < view.height; y++)
        for (int x = 0; x < view.width; x++) {
            const int16_t which = visible.which.at(x, y);
            const double inverse = visible.inverse_depth.at(x, y);
            const Surface *surface = which == nothing ? nullptr : visible.seen[which].surface;
            truth.depth.push_back(surface ? static_cast<float>(1.0 / inverse) : 0.0f);
            truth.part.push_back(static_cast<uint16_t>(surface ? surface->part : 0));
            truth.object.push_back(static_cast<uint16_t>(surface ? surface->object : 0));
            if (!visible.mixed(x, y)) {
                if (surface)
                    count(which, 1.0, inverse);
                continue;
            }
            for (const Share &share : sampler.shares(x, y, tiles.at(x, y)))
                count(share.which, static_cast<double>(share.count) / samples, share.inverse_depth);
        }
    double total = 0.0;
    for (int part = 1; part <= parts; part++) {
        total += truth.area[part];
        if (truth.area[part] > 0.0)
            truth.mean_z[part] /= truth.area[part];
    }
    truth.area[0] = static_cast<double>(view.width) * view.height - total;
    return truth;
}
