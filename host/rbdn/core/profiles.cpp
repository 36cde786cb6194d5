// The image along the rows or columns that cross an edge: what sub-pixel measurement looks at.
#include "profiles.hpp"

#include <algorithm>
#include <cmath>

namespace rbdn {

namespace {

constexpr double kSideFrom = 2.7;   // distances at which a side shows its own colour, px
constexpr double kSideNear = 6.5;   // and to which it counts as near by
constexpr double kSideTo = 12.0;
constexpr double kTwilight = 2.5;   // before an edge, where its blur begins
constexpr double kUncertain = 2.0;  // within which a pixel may lie on the wrong side of the net
constexpr double kLeastBand = 1.0;
constexpr int kGuard = 3;            // lines off at which a side must still be itself
constexpr std::size_t kMeanRows = 4;  // regions' colours are taken from every so many rows

// One line of pixels through the image.
struct Line {
    const std::uint8_t* bgr;  // pixel 0
    const int* labels;
    int pixel_stride;   // bytes
    int label_stride;
    int count;
    int across_stride;  // from a label to that of the next line
    int before, after;  // lines on either side
};

class Taker {
public:
    Taker(const View& view, const Edge& edge, std::vector<Profile>& profiles, SideColours& left, SideColours& right)
        : view_(view), edge_(edge), profiles_(profiles), left_(left), right_(right) {}

    void take(double clear_a, double clear_b) {
        const Mesh& mesh = view_.mesh;
        const Vec2 along = mesh.along(edge_);
        const double size = length(along);
        if (size < 1e-6) return;
        const Vec2 a = mesh.vertices[edge_.a].p, b = mesh.vertices[edge_.b].p;
        const Vec2 unit = (1.0 / size) * along;
        const Vec2 normal = left_normal(along);
        const bool rows = std::abs(unit.y) >= std::abs(unit.x);
        // Across: from line to line; inside: from pixel to pixel of a line.
        const double across_a = rows ? a.y : a.x, across_b = rows ? b.y : b.x;
        const double inside_a = rows ? a.x : a.y;
        const double across_unit = rows ? unit.y : unit.x, inside_unit = rows ? unit.x : unit.y;
        normal_ = rows ? normal.x : normal.y;
        inside_unit_ = inside_unit;
        length_ = 1.0 / std::abs(across_unit);
        const int first = std::max(0, ceil_px(std::min(across_a, across_b) - 0.5));
        const int last = std::min(rows ? mesh.height : mesh.width, ceil_px(std::max(across_a, across_b) - 0.5)) - 1;
        const bool upwards = across_unit > 0;
        for (int k = 0; k <= last - first; ++k) {
            const int line = upwards ? first + k : last - k;
            const double s = (line + 0.5 - across_a) / across_unit;
            const bool clear = s > clear_a && s < size - clear_b;
            take_line(line_through(line, rows), inside_a + s * inside_unit, s - 0.5 * size, clear);
        }
    }

private:
    Line line_through(int line, bool rows) const {
        const int width = view_.mesh.width;
        const std::size_t start = rows ? static_cast<std::size_t>(line) * width : line;
        const int lines = rows ? view_.mesh.height : width;
        return {view_.bgr + 3 * start, view_.labels.data() + start, rows ? 3 : 3 * width, rows ? 1 : width,
                rows ? width : view_.mesh.height, rows ? width : 1, line, lines - 1 - line};
    }

    double distance_of(int k, double at) const { return std::abs((k + 0.5 - at) * normal_); }

    // Pixels from the crossing to the first one that is not the side's own.
    int run(const Line& line, int begin, int step, double at, int own, int other) const {
        const int room = step > 0 ? line.count - begin : begin + 1;
        int most = std::min(room, static_cast<int>(kSideTo / std::abs(normal_)) + 2);
        while (most > 0 && distance_of(begin + (most - 1) * step, at) > kSideTo) --most;
        const std::ptrdiff_t label_step = static_cast<std::ptrdiff_t>(step) * line.label_stride;
        const int* label = line.labels + static_cast<std::ptrdiff_t>(begin) * line.label_stride;
        int own_face = kOutside;  // a face of the side's own region
        for (int n = 0; n < most; ++n, label += label_step) {
            if (*label == own_face) continue;
            const int here = view_.region_of[*label];
            if (here == own)
                own_face = *label;
            else if (!(here == other && distance_of(begin + n * step, at) < kUncertain))
                return n;
        }
        return std::max(most, 0);
    }

    // How far from the edge pixels see nothing else, for a side of this many pixels.
    double clear_reach(int run_px, bool at_image_end) const {
        const double width = run_px * std::abs(normal_);
        if (width >= kSideTo - 1.0 || at_image_end) return width;
        return std::max(width - kTwilight, 0.5 * width);
    }

    void take_line(const Line& line, double at, double along, bool clear) {
        const int beyond = ceil_px(at - 0.5);  // first pixel on the side of larger coordinates
        const bool left_is_beyond = normal_ > 0;
        const int region_left = view_.region(edge_.left), region_right = view_.region(edge_.right);
        const int own_beyond = left_is_beyond ? region_left : region_right;
        const int own_before = left_is_beyond ? region_right : region_left;
        const int run_beyond = run(line, beyond, 1, at, own_beyond, own_before);
        const int run_before = run(line, beyond - 1, -1, at, own_before, own_beyond);
        const double reach_beyond = clear_reach(run_beyond, beyond + run_beyond >= line.count);
        const double reach_before = clear_reach(run_before, beyond - run_before <= 0);
        if (clear) {
            add_side(line, beyond, 1, at, run_beyond, reach_beyond, own_beyond,
                     left_is_beyond ? left_ : right_);
            add_side(line, beyond - 1, -1, at, run_before, reach_before, own_before,
                     left_is_beyond ? right_ : left_);
        }
        if (reach_beyond < kLeastBand || reach_before < kLeastBand) return;

        const double scale = 1.0 / std::abs(normal_);
        const int begin = std::max(beyond - run_before,
                                   ceil_px(at - scale * std::min<double>(reach_before, kBand) - 0.5));
        const int end = std::min(beyond + run_beyond,
                                 floor_px(at + scale * std::min<double>(reach_beyond, kBand) - 0.5) + 1);
        if (end - begin < 3) return;
        Profile profile;
        profile.first = line.bgr + static_cast<std::ptrdiff_t>(begin) * line.pixel_stride;
        profile.stride = line.pixel_stride;
        profile.count = end - begin;
        profile.distance = static_cast<float>((begin + 0.5 - at) * normal_);
        profile.distance_step = static_cast<float>(normal_);
        profile.along = static_cast<float>(along + (begin + 0.5 - at) * inside_unit_);
        profile.along_step = static_cast<float>(inside_unit_);
        profile.crossing = static_cast<float>(along);
        profile.length = static_cast<float>(length_);
        profiles_.push_back(profile);
    }

    // Whether the lines some way off show the same region too: an edge along the lines might be near.
    bool is_clear(const Line& line, int k, int own) const {
        const int* label = line.labels + static_cast<std::ptrdiff_t>(k) * line.label_stride;
        const std::ptrdiff_t off = static_cast<std::ptrdiff_t>(kGuard) * line.across_stride;
        return (line.before < kGuard || view_.region_of[*(label - off)] == own) &&
               (line.after < kGuard || view_.region_of[*(label + off)] == own);
    }

    void add_side(const Line& line, int begin, int step, double at, int run_px, double reach, int own,
                  SideColours& side) const {
        const double scale = 1.0 / std::abs(normal_);
        const double from = at + step * scale * kSideFrom, to = at + step * scale * reach;
        int first = step > 0 ? ceil_px(from - 0.5) : floor_px(from - 0.5);
        int last = step > 0 ? floor_px(to - 0.5) : ceil_px(to - 0.5);
        if ((begin + (run_px - 1) * step - last) * step < 0) last = begin + (run_px - 1) * step;
        if ((first - begin) * step < 0) first = begin;
        if ((last - first) * step < 0 || !is_clear(line, first, own)) return;
        while (!is_clear(line, last, own)) last -= step;
        const std::uint8_t* pixel = line.bgr + static_cast<std::ptrdiff_t>(first) * line.pixel_stride;
        const double near = at + step * scale * kSideNear - 0.5;
        for (int k = first; (last - k) * step >= 0; k += step, pixel += step * line.pixel_stride)
            ((k - near) * step < 0 ? side.near : side.far).add(pixel);
    }

    const View& view_;
    const Edge& edge_;
    std::vector<Profile>& profiles_;
    SideColours& left_;
    SideColours& right_;
    double normal_ = 0;       // distance from the edge gained from pixel to pixel
    double inside_unit_ = 0;  // way along the edge gained from pixel to pixel
    double length_ = 0;
};

}  // namespace

std::vector<Bgr> mean_colours(const Mesh& mesh, const std::uint8_t* bgr, const std::vector<int>& labels,
                              const std::vector<int>& region_of, int region_count) {
    struct Sum {
        std::array<std::int64_t, 3> sum{};
        std::int64_t count = 0;
    };
    std::vector<Sum> sums(region_count);
    const auto width = static_cast<std::size_t>(mesh.width);
    for (std::size_t y = 0; y < static_cast<std::size_t>(mesh.height); y += kMeanRows) {
        for (std::size_t k = y * width; k < (y + 1) * width;) {
            // Run by run, which is many times as fast as looking the region up at every pixel.
            const int face = labels[k];
            const std::size_t start = k;
            std::array<std::int64_t, 3> run{};
            for (; k < (y + 1) * width && labels[k] == face; ++k)
                for (int c = 0; c < 3; ++c) run[c] += bgr[3 * k + c];
            Sum& total = sums[region_of[face]];
            for (int c = 0; c < 3; ++c) total.sum[c] += run[c];
            total.count += static_cast<std::int64_t>(k - start);
        }
    }
    std::vector<Bgr> means(region_count);
    for (int r = 0; r < region_count; ++r)
        for (int c = 0; c < 3; ++c)
            means[r][c] = static_cast<float>(static_cast<double>(sums[r].sum[c]) /
                                             static_cast<double>(std::max<std::int64_t>(sums[r].count, 1)));
    return means;
}

void take_profiles(const View& view, const Edge& edge, double clear_a, double clear_b,
                   std::vector<Profile>& profiles, SideColours& left, SideColours& right) {
    Taker(view, edge, profiles, left, right).take(clear_a, clear_b);
}

}  // namespace rbdn
