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

#include "shading.hpp"

namespace {

constexpr int samples = 256;
constexpr int cells = 4; // a side
constexpr int tile = 8; // side of a tile of pixels that shares one list of surfaces

// Pixels x0 <= x < x1, y0 <= y < y1.
template <class T> class Plane {
public:
    Plane(const Box &box, T value)
        : box_(box), stride_(box.x1 - box.x0), data_(static_cast<std::size_t>(stride_) * (box.y1 - box.y0), value)
    {
    }
    T &at(int x, int y) { return data_[place(x, y)]; }
    const T &at(int x, int y) const { return data_[place(x, y)]; }
    int stride() const { return stride_; }

private:
    std::size_t place(int x, int y) const { return static_cast<std::size_t>(y - box_.y0) * stride_ + (x - box_.x0); }

    Box box_;
    int stride_;
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

Box widened(const Box &box, int by) { return {box.x0 - by, box.x1 + by, box.y0 - by, box.y1 + by}; }

// What the pixels of a box show at their centres, and those just round it, by which they are judged.
struct Visible {
    const Places &places;
    const Box box;
    std::vector<Seen> seen;
    Plane<int16_t> which; // index into seen
    Plane<double> inverse_depth;

    Visible(const Scene &scene, const View &view, const Places &all_places, const Box &shown)
        : places(all_places), box(widened(shown, 1)), which(box, nothing), inverse_depth(box, 0.0)
    {
        for (const Surface &surface : scene.surfaces) {
            Seen s;
            if (!see(surface, view, places, s))
                continue;
            s.box = {std::max(s.box.x0, box.x0), std::min(s.box.x1, box.x1), std::max(s.box.y0, box.y0),
                     std::min(s.box.y1, box.y1)};
            if (s.box.x0 < s.box.x1 && s.box.y0 < s.box.y1)
                seen.push_back(s);
        }
        for (std::size_t k = 0; k < seen.size(); k++)
            draw(static_cast<int16_t>(k));
    }

    // Do surfaces meet in this pixel?
    bool mixed(int x, int y) const
    {
        const int16_t *here = &which.at(x, y), *above = here - which.stride(), *below = here + which.stride();
        const int16_t centre = *here;
        const int differ = (above[-1] ^ centre) | (above[0] ^ centre) | (above[1] ^ centre) | (here[-1] ^ centre)
                           | (here[1] ^ centre) | (below[-1] ^ centre) | (below[0] ^ centre) | (below[1] ^ centre);
        return differ != 0;
    }

private:
    void draw(int16_t k)
    {
        const Seen &s = seen[k];
        for (int y = s.box.y0; y < s.box.y1; y++)
            for (int x = s.box.x0; x < s.box.x1; x += Places::block) {
                const int end = std::min(x + Places::block, s.box.x1);
                if (s.surface->shape != Shape::quad)
                    draw_block(k, x, end, y, [&](double px, double py) { return inverse_depth_at(s, px, py); });
                else
                    draw_quad_block(k, x, end, y);
            }
    }

    // Most blocks of a row lie wholly inside or outside of the quad, which their ends tell.
    void draw_quad_block(int16_t k, int x, int end, int y)
    {
        const Seen &s = seen[k];
        const Place first = places.at(x, y), last = places.at(end - 1, y);
        bool inside = true;
        for (const Linear &edge : s.inside) {
            const double from = edge.at(first.x, first.y), to = edge.at(last.x, last.y);
            const double slack = (places.bend() + 1e-6) * (std::abs(edge.x) + std::abs(edge.y));
            if (from < -slack && to < -slack)
                return;
            inside = inside && from > slack && to > slack;
        }
        if (inside)
            draw_block(k, x, end, y, [&](double px, double py) { return in_front(s.inverse_depth.at(px, py)); });
        else
            draw_block(k, x, end, y, [&](double px, double py) { return quad_inverse_depth(s, px, py); });
    }

    template <class Inverse> void draw_block(int16_t k, int x, int end, int y, const Inverse &inverse_at)
    {
        double *inverse_here = &inverse_depth.at(x, y);
        int16_t *which_here = &which.at(x, y);
        for (int n = 0; n < end - x; n++) {
            const Place place = places.at(x + n, y);
            const double inverse = inverse_at(place.x, place.y);
            if (inverse > inverse_here[n]) {
                inverse_here[n] = inverse;
                which_here[n] = k;
            }
        }
    }
};

// For each tile the surfaces that may show in it.
class Tiles {
public:
    explicit Tiles(const Visible &visible)
        : box_(visible.box), across_((box_.x1 - box_.x0) / tile + 1),
          lists_(static_cast<std::size_t>(across_) * ((box_.y1 - box_.y0) / tile + 1))
    {
        for (std::size_t k = 0; k < visible.seen.size(); k++) {
            const Box &box = visible.seen[k].box;
            for (int ty = (box.y0 - box_.y0) / tile; ty <= (box.y1 - 1 - box_.y0) / tile; ty++)
                for (int tx = (box.x0 - box_.x0) / tile; tx <= (box.x1 - 1 - box_.x0) / tile; tx++)
                    lists_[static_cast<std::size_t>(ty) * across_ + tx].push_back(static_cast<int16_t>(k));
        }
    }
    const std::vector<int16_t> &at(int x, int y) const
    {
        return lists_[static_cast<std::size_t>((y - box_.y0) / tile) * across_ + (x - box_.x0) / tile];
    }

private:
    Box box_;
    int across_;
    std::vector<std::vector<int16_t>> lists_;
};

// Where in a pixel the samples are.
struct Net {
    std::array<float, samples> x{}, y{}; // from the pixel's centre
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
                net.x[i] = static_cast<float>((ix + shift_x) / samples - 0.5);
                net.y[i] = static_cast<float>((iy + shift_y) / samples - 0.5);
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
    // Of a curved surface that fills a pixel the mean depth differs a little from that at its centre; `exact` tells.
    Sampler(const Visible &visible, bool exact) : exact_(exact), seen_(visible.seen), places_(visible.places) {}

    // Shares of the candidates that the pixel shows.
    const std::vector<Share> &shares(int x, int y, const std::vector<int16_t> &candidates)
    {
        place_ = places_.at(x, y);
        for (int k = 0; k < 4; k++) {
            const double right = (k & 1) - 0.5, down = (k >> 1) - 0.5;
            corner_x_[k] = place_.x + right * place_.right_x + down * place_.down_x;
            corner_y_[k] = place_.y + right * place_.right_y + down * place_.down_y;
        }
        sort_out(candidates);
        shares_.clear();
        if (rivals_.size() == 1 && rivals_[0].whole) {
            const Rival &only = rivals_[0];
            Share &all = shares_.emplace_back();
            all = {only.which, samples, place_.x, place_.y, inverse_depth_at(seen_[only.which], place_.x, place_.y), {}};
            all.in_cell.fill(samples / (cells * cells));
            return shares_;
        }
        const Net &net = net_of(x, y);
        inverse_.fill(0.0f);
        winner_.fill(0); // 0: nothing
        shares_.resize(1);
        for (const Rival &rival : rivals_)
            test(rival, net);
        gather(net);
        return shares_;
    }

private:
    struct Rival {
        int16_t which;
        bool whole;     // covers the pixel
        bool flat;      // so that its inverse depth at the corners bounds it
        Corners nearby; // inverse depth at the pixel's corners, from which it lies between or nearer
    };

    // A linear function of the samples' places in the pixel, in single precision: all that is small is precise.
    struct InPixel {
        float right, down, centre;
        float at(float net_x, float net_y) const { return right * net_x + down * net_y + centre; }
    };

    InPixel in_pixel(const Linear &f) const
    {
        return {static_cast<float>(f.x * place_.right_x + f.y * place_.right_y),
                static_cast<float>(f.x * place_.down_x + f.y * place_.down_y),
                static_cast<float>(f.at(place_.x, place_.y))};
    }

    // Surfaces that may show in the pixel, without those wholly behind another.
    void sort_out(const std::vector<int16_t> &candidates)
    {
        rivals_.clear();
        for (const int16_t which : candidates) {
            const Seen &s = seen_[which];
            Rival rival{which, false, s.surface->planar(), {}};
            if (!touches(s, rival))
                continue;
            if (rival.flat)
                for (int k = 0; k < 4; k++)
                    rival.nearby[k] = s.inverse_depth.at(corner_x_[k], corner_y_[k]);
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

    bool touches(const Seen &s, Rival &rival) const
    {
        if (s.surface->shape == Shape::disc)
            return may_touch(s, place_.x, place_.y);
        if (!rival.flat) {
            if (!may_touch(s, place_.x, place_.y))
                return false;
            rival.whole = !exact_ && covers(s, corner_x_, corner_y_, rival.nearby);
            return true;
        }
        rival.whole = true;
        for (const Linear &edge : s.inside) {
            const double middle = edge.at(place_.x, place_.y), half = swing(edge);
            if (middle < -half)
                return false;
            rival.whole = rival.whole && middle > half;
        }
        const double nearest = s.inverse_depth.at(place_.x, place_.y) + swing(s.inverse_depth);
        rival.whole = rival.whole && nearest < 1.0 / near_cm;
        return true;
    }

    // Let a surface have the samples at which it is nearer than all before it.
    void test(const Rival &rival, const Net &net)
    {
        const Seen &s = seen_[rival.which];
        const auto slot = static_cast<int32_t>(shares_.size());
        shares_.emplace_back().which = rival.which;
        const auto take = [&](auto &&inverse_depth) {
            for (int i = 0; i < samples; i++) {
                const float inverse = inverse_depth(net.x[i], net.y[i]);
                const bool nearer = inverse > inverse_[i];
                inverse_[i] = nearer ? inverse : inverse_[i];
                winner_[i] = nearer ? slot : winner_[i];
            }
        };
        if (s.surface->shape != Shape::quad) {
            take([&](float net_x, float net_y) {
                return static_cast<float>(
                    inverse_depth_at(s, place_.x + place_.right_x * net_x + place_.down_x * net_y,
                                     place_.y + place_.right_y * net_x + place_.down_y * net_y));
            });
            return;
        }
        const InPixel depth = in_pixel(s.inverse_depth);
        if (rival.whole) {
            take([&](float net_x, float net_y) { return depth.at(net_x, net_y); });
            return;
        }
        const InPixel a = in_pixel(s.inside[0]), b = in_pixel(s.inside[1]), c = in_pixel(s.inside[2]),
                      d = in_pixel(s.inside[3]);
        constexpr auto nearest = static_cast<float>(1.0 / near_cm);
        take([&](float net_x, float net_y) {
            const float inverse = depth.at(net_x, net_y);
            const float edge = std::min(std::min(a.at(net_x, net_y), b.at(net_x, net_y)),
                                        std::min(c.at(net_x, net_y), d.at(net_x, net_y)));
            return (edge >= 0.0f) & (inverse < nearest) ? inverse : 0.0f;
        });
    }

    // Who has how many samples, and where.
    void gather(const Net &net)
    {
        for (int i = 0; i < samples; i++) {
            Share &share = shares_[winner_[i]];
            share.count++;
            share.x += net.x[i];
            share.y += net.y[i];
            share.inverse_depth += inverse_[i];
            share.in_cell[net.cell[i]]++;
        }
        std::erase_if(shares_, [](const Share &s) { return s.which == nothing || s.count == 0; });
        for (Share &share : shares_) {
            const double net_x = share.x / share.count, net_y = share.y / share.count;
            share.x = place_.x + place_.right_x * net_x + place_.down_x * net_y;
            share.y = place_.y + place_.right_y * net_x + place_.down_y * net_y;
            const Seen &s = seen_[share.which];
            share.inverse_depth
                = s.surface->planar() ? s.inverse_depth.at(share.x, share.y) : share.inverse_depth / share.count;
        }
    }

    const bool exact_;
    const std::vector<Seen> &seen_;
    const Places &places_;
    Place place_; // of the pixel
    Corners corner_x_{}, corner_y_{};
    std::array<float, samples> inverse_{};
    std::array<int32_t, samples> winner_{}; // index into shares_
    std::vector<Share> shares_;
    std::vector<Rival> rivals_;
};

// A pixel in which surfaces meet: how its parts differ from its mean.
struct MixedPixel {
    int x = 0, y = 0;
    std::array<Vec3, cells * cells> residual;
};

// Mean colour of a mixed pixel and of its cells.
Vec3 resolve(Shader &shader, const std::vector<Share> &shares, MixedPixel &pixel)
{
    constexpr double cell_samples = samples / (cells * cells);
    pixel.residual.fill(Vec3{});
    Vec3 mean;
    for (const Share &share : shares) {
        const Vec3 colour = shader.at(share.which, share.x, share.y, share.inverse_depth);
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

// Light at the pixels of a box, and which of them are mixed.
void render_box(const Scene &scene, const View &view, const Places &places, const Box &box, Light3 &light,
                std::vector<MixedPixel> &mixed)
{
    const Visible visible(scene, view, places, box);
    const Tiles tiles(visible);
    Sampler sampler(visible, false);
    Shader shader(scene, view, visible.seen);
    for (int y = box.y0; y < box.y1; y++)
        for (int x = box.x0; x < box.x1; x++) {
            Vec3 colour;
            if (visible.mixed(x, y)) {
                MixedPixel pixel{x, y, {}};
                const std::vector<Share> &shares = sampler.shares(x, y, tiles.at(x, y));
                colour = resolve(shader, shares, pixel);
                if (shares.size() != 1 || shares[0].count != samples)
                    mixed.push_back(pixel);
            } else if (visible.which.at(x, y) != nothing) {
                const Place place = places.at(x, y);
                colour = shader.at(visible.which.at(x, y), place.x, place.y, visible.inverse_depth.at(x, y));
            }
            float *to = light.at(x, y);
            to[0] = static_cast<float>(colour.x);
            to[1] = static_cast<float>(colour.y);
            to[2] = static_cast<float>(colour.z);
        }
}

} // namespace

std::vector<float> render(const Scene &scene, const std::vector<View> &views, const Places &places, double psf_px)
{
    const int width = places.width, height = places.height, count = static_cast<int>(views.size());
    const int margin = psf_px > 0.0 ? blur_radius : 0;
    Light3 light(width, height, margin);
    std::vector<MixedPixel> mixed;
    for (int n = 0; n < count; n++) {
        const int top = n == 0 ? -margin : n * height / count;
        const int bottom = n == count - 1 ? height + margin : (n + 1) * height / count;
        render_box(scene, views[n], places, {-margin, width + margin, top, bottom}, light, mixed);
    }
    if (psf_px > 0.0)
        return blur(light, mixed, width, height, psf_px);
    return light.data();
}

Truth truth(const Scene &scene, const View &view, const Places &places, bool areas)
{
    const Visible visible(scene, view, places, {0, places.width, 0, places.height});
    Truth truth;
    truth.depth.reserve(static_cast<std::size_t>(places.width) * places.height);
    for (int y = 0; y < places.height; y++)
        for (int x = 0; x < places.width; x++) {
            const int16_t which = visible.which.at(x, y);
            const Surface *surface = which == nothing ? nullptr : visible.seen[which].surface;
            truth.depth.push_back(surface ? static_cast<float>(1.0 / visible.inverse_depth.at(x, y)) : 0.0f);
            truth.part.push_back(static_cast<uint16_t>(surface ? surface->part : 0));
            truth.object.push_back(static_cast<uint16_t>(surface ? surface->object : 0));
        }
    if (!areas)
        return truth;

    const Tiles tiles(visible);
    Sampler sampler(visible, true);
    int parts = 0;
    for (const Surface &surface : scene.surfaces)
        parts = std::max(parts, surface.part);
    truth.area.assign(parts + 1, 0.0);
    truth.mean_z.assign(parts + 1, 0.0);
    const auto count = [&](int16_t which, double area, double inverse_depth) {
        const int part = visible.seen[which].surface->part;
        truth.area[part] += area;
        truth.mean_z[part] += area / inverse_depth;
    };
    for (int y = 0; y < places.height; y++)
        for (int x = 0; x < places.width; x++) {
            if (!visible.mixed(x, y)) {
                if (visible.which.at(x, y) != nothing)
                    count(visible.which.at(x, y), 1.0, visible.inverse_depth.at(x, y));
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
    truth.area[0] = static_cast<double>(places.width) * places.height - total;
    return truth;
}
