// Deformation forces: mismatched pixels beside every edge, and the vertex moves they ask for (Eq. 1-6).
#include "forces.hpp"

#include <algorithm>
#include <cmath>

#include "planarity.hpp"

namespace rbdn {

namespace {

constexpr int kDeepestRun = 24;
constexpr double kStill = 0.2;  // px; smaller moves are noise of the counts, and edges at rest need no new look

// Does `other` claim the pixel from `own`? Nearest mean, without the dead zone of the paper's two thresholds,
// and near enough to `other` not to be a third colour.
class Claim {
public:
    Claim() = default;
    Claim(const Colour& own, const Colour& other, const ClaimRule& rule) {
        int between2 = 0, twice_middle = 0;
        for (int k = 0; k < 3; ++k) {
            const int from = whole(own[k]);
            other_[k] = whole(other[k]);
            direction_[k] = other_[k] - from;
            between2 += direction_[k] * direction_[k];
            twice_middle += direction_[k] * (other_[k] + from);
        }
        limit_ = twice_middle >> 1;
        gate2_ = std::max(static_cast<int>(rule.eta2), 3 * between2 / 10);
    }

    bool operator()(const ShortColour& p) const {
        int projected = 0, apart2 = 0;
        for (int k = 0; k < 3; ++k) {
            projected += direction_[k] * p[k];
            apart2 += (p[k] - other_[k]) * (p[k] - other_[k]);
        }
        return projected > limit_ && apart2 <= gate2_;
    }

private:
    // Whole colour units, so that sums are exact: below 2^12 a part, a product of two fits an int three times over.
    int other_[3] = {};
    int direction_[3] = {};
    int limit_ = 0;  // the middle between both, projected, in whole numbers
    int gate2_ = 0;
};

// What a scan needs to know of an edge, worked out once for all its crossings.
struct Scan {
    bool idle = true;         // nothing to claim (on the image border), or not asked for
    bool by_rows = false;     // scanned along rows (steep) or along columns (flat)
    bool a_is_first = false;  // half 0 lies at the smaller coordinates
    int depth = 0;            // px along the line that make up the reach
    double middle = 0;        // coordinate across the lines where half 1 begins
    Claim by_right;   // pixels of the left face
    Claim by_left;    // pixels of the right face
};

std::vector<Scan> plan_scans(const Mesh& mesh, const ClaimRule& rule, int reach_px, Which which) {
    std::vector<Scan> scans;
    scans.reserve(mesh.edges.size());
    for (const Edge& e : mesh.edges) {
        Scan& scan = scans.emplace_back();
        const bool asked = which == Which::kAllEdges || mesh.vertices[e.a].moved > 0 || mesh.vertices[e.b].moved > 0;
        if (e.on_border() || !asked) continue;
        const Vec2 a = mesh.vertices[e.a].p, b = mesh.vertices[e.b].p;
        const double dx = std::abs(b.x - a.x), dy = std::abs(b.y - a.y);
        const double steep = std::max({dx, dy, 1e-9});
        scan.idle = false;
        scan.by_rows = dy >= dx;
        const double from = scan.by_rows ? a.y : a.x, to = scan.by_rows ? b.y : b.x;
        scan.depth = std::min(kDeepestRun, ceil_px(reach_px * std::sqrt(dx * dx + dy * dy) / steep));
        scan.middle = 0.5 * (from + to);
        scan.a_is_first = from <= to;
        const Colour &left = mesh.faces[e.left].mean, &right = mesh.faces[e.right].mean;
        scan.by_right = Claim(left, right, rule);
        scan.by_left = Claim(right, left, rule);
    }
    return scans;
}

// One axis of the disparity: edges that cross these lines steeply.
void measure_along(const Mesh& mesh, const CrossingLines& lines, bool rows, const Image& image,
                   const std::vector<Scan>& scans, std::vector<Disparity>& out) {
    const int stride = 3 * (rows ? 1 : mesh.width);
    for (int k = 0; k < lines.line_count(); ++k) {
        const auto crossings = lines.line(k);
        const int place = k * lines.step();
        const std::uint8_t* line = rows ? image.row(place) : image.row(0) + 3 * place;
        const auto colour = [&](int at) { return image.short_colour_of(line + at * stride); };
        for (std::size_t i = 1; i + 1 < crossings.size(); ++i) {
            const Crossing& c = crossings[i];
            const Scan& scan = scans[c.edge];
            if (scan.by_rows != rows || scan.idle) continue;

            const bool left_is_before = c.before == mesh.edges[c.edge].left;
            const Claim& by_after = left_is_before ? scan.by_right : scan.by_left;
            const Claim& by_before = left_is_before ? scan.by_left : scan.by_right;
            const int here = c.pixel;
            const int low = std::max(crossings[i - 1].pixel, here - scan.depth);
            const int high = std::min(crossings[i + 1].pixel, here + scan.depth);
            int run_before = 0;
            for (int at = here - 1; at >= low && by_after(colour(at)); --at) ++run_before;
            int run_after = 0;
            for (int at = here; at < high && by_before(colour(at)); ++at) ++run_after;
            if (run_before + run_after == 0) continue;

            const int half = (place + 0.5 < scan.middle) == scan.a_is_first ? 0 : 1;
            Disparity& d = out[c.edge];
            d.left_claimed[half] += static_cast<float>(lines.step() * (left_is_before ? run_before : run_after));
            d.right_claimed[half] += static_cast<float>(lines.step() * (left_is_before ? run_after : run_before));
        }
    }
}

// The 2x2 normal equations of one vertex.
struct NormalEquations {
    double xx = 0, xy = 0, yy = 0, x = 0, y = 0;

    void add(Vec2 normal, double displacement, double weight) {
        xx += weight * normal.x * normal.x;
        xy += weight * normal.x * normal.y;
        yy += weight * normal.y * normal.y;
        x += weight * normal.x * displacement;
        y += weight * normal.y * displacement;
    }
};

Vec2 solve_move(const NormalEquations& n, std::uint8_t sides) {
    const double damping = 0.08 * (n.xx + n.yy);
    if (damping <= 0.0) return {};
    const bool slides_vertically = sides & (kLeftSide | kRightSide);
    const bool slides_horizontally = sides & (kTopSide | kBottomSide);
    if (slides_vertically && slides_horizontally) return {};
    if (slides_vertically) return {0.0, n.y / (n.yy + damping)};
    if (slides_horizontally) return {n.x / (n.xx + damping), 0.0};
    const double xx = n.xx + damping, yy = n.yy + damping;
    const double det = xx * yy - n.xy * n.xy;
    return {(yy * n.x - n.xy * n.y) / det, (xx * n.y - n.xy * n.x) / det};
}

}  // namespace

void measure_disparity(const Mesh& mesh, const Crossings& crossings, const Image& image, const ClaimRule& rule,
                       int reach_px, Which which, std::vector<Disparity>& disparity) {
    disparity.resize(mesh.edges.size());
    const std::vector<Scan> scans = plan_scans(mesh, rule, reach_px, which);
    for (std::size_t k = 0; k < scans.size(); ++k)
        if (which == Which::kAllEdges || !scans[k].idle) disparity[k] = {};
    measure_along(mesh, crossings.rows(), true, image, scans, disparity);
    measure_along(mesh, crossings.columns(), false, image, scans, disparity);
}

double total_disparity(const std::vector<Disparity>& disparity) {
    double sum = 0;
    for (const Disparity& d : disparity)
        sum += d.left_claimed[0] + d.left_claimed[1] + d.right_claimed[0] + d.right_claimed[1];
    return sum;
}

double half_displacement(const Disparity& d, int half, double edge_length) {
    // Eq. 1-2 give H / (2 lambda); over a half edge of lambda / 2 the true displacement is 2 H / lambda.
    return 2.0 * (d.left_claimed[half] - d.right_claimed[half]) / edge_length;
}

void move_vertices(Mesh& mesh, const std::vector<Disparity>& disparity, int reach_px, double gain) {
    std::vector<NormalEquations> equations(mesh.vertices.size());
    std::vector<double> shortest(mesh.vertices.size(), 1e9);
    for (std::size_t k = 0; k < mesh.edges.size(); ++k) {
        const Edge& e = mesh.edges[k];
        const double size = mesh.edge_length(e);
        shortest[e.a] = std::min(shortest[e.a], size);
        shortest[e.b] = std::min(shortest[e.b], size);
        if (e.on_border() || size < 1e-9) continue;
        const Vec2 normal = left_normal(mesh.along(e));
        const double weight = std::min(size, 30.0) / 2.0;
        equations[e.a].add(normal, half_displacement(disparity[k], 0, size), weight);
        equations[e.b].add(normal, half_displacement(disparity[k], 1, size), weight);
    }

    std::vector<Vec2> moves(mesh.vertices.size());
    for (std::size_t k = 0; k < mesh.vertices.size(); ++k) {
        moves[k] = gain * solve_move(equations[k], mesh.vertices[k].sides);
        const double limit = std::min(reach_px / 2.0, std::max(0.7, 0.45 * shortest[k]));
        const double size = length(moves[k]);
        if (size > limit) moves[k] = (limit / size) * moves[k];
    }
    displace_vertices(mesh, moves);
}

void displace_vertices(Mesh& mesh, const std::vector<Vec2>& moves) {
    for (std::size_t k = 0; k < mesh.vertices.size(); ++k)
        mesh.place(static_cast<int>(k), mesh.vertices[k].p + moves[k]);
}

void settle_moves(Mesh& mesh, Crossings& crossings) {
    constexpr int kTries = 9;
    std::vector<char> touched(mesh.vertices.size(), 0);
    for (int attempt = 0; attempt <= kTries; ++attempt) {
        crossings.build(mesh, crossings.step());
        const std::vector<int> bad = find_faults(mesh, crossings);
        if (bad.empty()) break;
        if (attempt == kTries) {
            for (Vertex& v : mesh.vertices) v.p = v.held;
            crossings.build(mesh, crossings.step());
            break;
        }
        for (int e : bad) touched[mesh.edges[e].a] = touched[mesh.edges[e].b] = 1;
        for (int ring = 2; ring <= attempt; ++ring) {
            std::vector<char> wider = touched;
            for (const Edge& e : mesh.edges)
                if (touched[e.a] || touched[e.b]) wider[e.a] = wider[e.b] = 1;
            touched.swap(wider);
        }
        for (std::size_t k = 0; k < mesh.vertices.size(); ++k) {
            if (!touched[k]) continue;
            Vertex& v = mesh.vertices[k];
            v.p = attempt == 0 ? v.held + 0.5 * (v.p - v.held) : v.held;
        }
    }
    for (Vertex& v : mesh.vertices) {
        v.moved = length(v.p - v.held);
        v.held = v.p;
    }
}

}  // namespace rbdn
