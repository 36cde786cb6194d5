// A net from a label image: the cracks between unlike pixels, simplified as far as the net stays planar.
#include "vectorise.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <numeric>
#include <tuple>

#include "planarity.hpp"

namespace rbdn {

namespace {

constexpr double kTolerance = 1.0;   // of the outlines' simplification, px
constexpr double kSameVertex = 2.0;  // an id is handed over within this distance, px

struct Point {
    int x;
    int y;
    bool operator==(const Point&) const = default;
};

// An outline between two nodes, or a closed one without nodes.
struct Chain {
    std::vector<Point> points;
    int left = kOutside;
    int right = kOutside;
    double tolerance = kTolerance;

    bool closed() const { return points.front() == points.back(); }
};

// The lattice of pixel corners: at each, in which directions a crack leaves, and which of them are walked.
class CrackGraph {
public:
    CrackGraph(const std::vector<int>& labels, int width, int height)
        : labels_(labels), width_(width), height_(height),
          cracks_(static_cast<std::size_t>(width + 1) * (height + 1), 0) {
        mark_cracks();
    }

    std::vector<Chain> chains() {
        std::vector<Chain> out;
        const std::vector<int> places = places_with_cracks();
        for (int k : places)
            if (is_node(k))
                for (int direction = 0; direction < 4; ++direction)
                    if (has_crack(k, direction) && !walked(k, direction)) out.push_back(follow(k, direction));
        for (int k : places)
            if (has_crack(k, 0) && !walked(k, 0)) out.push_back(follow(k, 0));
        return out;
    }

private:
    static constexpr int kDx[4] = {1, 0, -1, 0};
    static constexpr int kDy[4] = {0, 1, 0, -1};

    // Bit `direction` of a place says that a crack leaves it there, bit 4 + direction that it is walked.
    void mark_cracks() {
        const std::vector<int> nothing(width_, kOutside);
        std::vector<std::uint8_t> across(width_ + 2, 0);  // crack to the right of place x - 1
        std::vector<std::uint8_t> down(width_ + 1, 0), up(width_ + 1, 0);
        for (int y = 0; y <= height_; ++y) {
            const int* above = y > 0 ? row(y - 1) : nothing.data();
            const int* below = y < height_ ? row(y) : nothing.data();
            for (int x = 0; x < width_; ++x) across[x + 1] = above[x] != below[x];
            down[0] = down[width_] = y < height_;
            for (int x = 1; x < width_; ++x) down[x] = below[x - 1] != below[x];
            std::uint8_t* out = &cracks_[static_cast<std::size_t>(y) * (width_ + 1)];
            for (int x = 0; x <= width_; ++x)
                out[x] = static_cast<std::uint8_t>(across[x + 1] | down[x] << 1 | across[x] << 2 | up[x] << 3);
            up.swap(down);
        }
    }

    std::vector<int> places_with_cracks() const {
        std::vector<int> places;
        const std::size_t size = cracks_.size();
        for (std::size_t k = 0; k < size; ++k) {
            std::uint64_t eight = 0;
            while (k + 8 <= size && (std::memcpy(&eight, &cracks_[k], 8), eight == 0)) k += 8;
            if (k < size && cracks_[k]) places.push_back(static_cast<int>(k));
        }
        return places;
    }

    const int* row(int y) const { return labels_.data() + static_cast<std::size_t>(y) * width_; }
    Point point(int k) const { return {k % (width_ + 1), k / (width_ + 1)}; }
    int label(int x, int y) const { return x < 0 || y < 0 || x >= width_ || y >= height_ ? kOutside : row(y)[x]; }

    // Labels to the left and right of a step from p.
    std::pair<int, int> beside(Point p, int direction) const {
        switch (direction) {
            case 0: return {label(p.x, p.y - 1), label(p.x, p.y)};
            case 1: return {label(p.x, p.y), label(p.x - 1, p.y)};
            case 2: return {label(p.x - 1, p.y), label(p.x - 1, p.y - 1)};
            default: return {label(p.x - 1, p.y - 1), label(p.x, p.y - 1)};
        }
    }

    bool has_crack(int k, int direction) const { return cracks_[k] >> direction & 1; }
    bool walked(int k, int direction) const { return cracks_[k] >> (4 + direction) & 1; }
    void walk(int k, int direction) { cracks_[k] |= static_cast<std::uint8_t>(16 << direction); }

    bool is_node(int k) const {
        if (std::popcount(static_cast<unsigned>(cracks_[k] & 15)) > 2) return true;
        const Point p = point(k);
        return (p.x == 0 || p.x == width_) && (p.y == 0 || p.y == height_);
    }

    Chain follow(int k, int direction) {
        Chain chain;
        Point p = point(k);
        std::tie(chain.left, chain.right) = beside(p, direction);
        const int start = k;
        chain.points.push_back(p);
        for (;;) {
            const int back = (direction + 2) % 4;
            walk(k, direction);
            p = {p.x + kDx[direction], p.y + kDy[direction]};
            k += kDx[direction] + kDy[direction] * (width_ + 1);
            walk(k, back);
            chain.points.push_back(p);
            if (k == start || is_node(k)) return chain;
            direction = std::countr_zero(static_cast<unsigned>(cracks_[k] & 15 & ~(1 << back)));
        }
    }

    const std::vector<int>& labels_;
    int width_;
    int height_;
    std::vector<std::uint8_t> cracks_;
};

// The point of a chain that lies farthest from the chord between two of its points.
int farthest_between(const std::vector<Point>& points, int first, int last, double* distance) {
    int at = first;
    *distance = -1.0;
    if (last - first < 2) return at;
    const Point a = points[first], b = points[last];
    const std::int64_t dx = b.x - a.x, dy = b.y - a.y;
    const bool is_point = dx == 0 && dy == 0;
    // Heights times the chord's length, or squared distances: whole numbers, in the same order.
    std::int64_t most = -1;
    for (int k = first + 1; k < last; ++k) {
        const std::int64_t x = points[k].x - a.x, y = points[k].y - a.y;
        const std::int64_t height = is_point ? x * x + y * y : std::abs(dx * y - dy * x);
        if (height > most) {
            most = height;
            at = k;
        }
    }
    const auto far = static_cast<double>(most);
    *distance = is_point ? std::sqrt(far) : far / std::hypot(static_cast<double>(dx), static_cast<double>(dy));
    return at;
}

void douglas_peucker(const Chain& chain, int first, int last, std::vector<int>& kept) {
    if (last - first < 2) return;
    double distance = 0;
    const int at = farthest_between(chain.points, first, last, &distance);
    if (distance <= chain.tolerance) return;
    douglas_peucker(chain, first, at, kept);
    kept.push_back(at);
    douglas_peucker(chain, at, last, kept);
}

// Indices of the points to keep between the chain's ends, in order.
std::vector<int> simplify(const Chain& chain) {
    const int last = static_cast<int>(chain.points.size()) - 1;
    std::vector<int> kept;
    if (!chain.closed()) {
        douglas_peucker(chain, 0, last, kept);
        return kept;
    }
    // A closed outline needs two more anchors to enclose anything.
    double distance = 0;
    const int far = farthest_between(chain.points, 0, last, &distance);
    douglas_peucker(chain, 0, far, kept);
    kept.push_back(far);
    douglas_peucker(chain, far, last, kept);
    if (kept.size() < 2) {
        double before = 0, after = 0;
        const int at_before = farthest_between(chain.points, 0, far, &before);
        const int at_after = farthest_between(chain.points, far, last, &after);
        if (before >= after)
            kept.insert(kept.begin(), at_before);
        else
            kept.push_back(at_after);
    }
    return kept;
}

std::uint8_t sides_of(Point p, int width, int height) {
    std::uint8_t sides = 0;
    if (p.x == 0) sides |= kLeftSide;
    if (p.x == width) sides |= kRightSide;
    if (p.y == 0) sides |= kTopSide;
    if (p.y == height) sides |= kBottomSide;
    return sides;
}

// Builds vertices and edges from the chains; returns the chain of every edge.
std::vector<int> build_edges(Mesh& mesh, const std::vector<Chain>& chains) {
    mesh.vertices.clear();
    mesh.edges.clear();
    mesh.spokes.clear();
    std::map<std::pair<int, int>, int> node_at;
    const auto vertex_at = [&](Point p) {
        const auto [place, is_new] = node_at.try_emplace({p.x, p.y}, 0);
        if (is_new)
            place->second = mesh.add_vertex({static_cast<double>(p.x), static_cast<double>(p.y)},
                                            sides_of(p, mesh.width, mesh.height));
        return place->second;
    };

    std::map<std::pair<int, int>, int> straight;  // pairs of vertices joined by one edge
    std::vector<int> chain_of_edge;
    const auto add_chain = [&](int index) {
        const Chain& chain = chains[index];
        std::vector<int> kept = simplify(chain);
        const int last = static_cast<int>(chain.points.size()) - 1;
        const int first_vertex = vertex_at(chain.points.front()), last_vertex = vertex_at(chain.points.back());
        if (kept.empty()) {
            const auto pair = std::minmax(first_vertex, last_vertex);
            // A second straight connection between the same vertices would enclose nothing.
            if (!straight.try_emplace({pair.first, pair.second}, index).second && last > 1) {
                double distance = 0;
                kept.push_back(farthest_between(chain.points, 0, last, &distance));
            }
        }
        int from = first_vertex;
        for (int k : kept) {
            const int to = vertex_at(chain.points[k]);
            mesh.add_edge(from, to, chain.left, chain.right);
            chain_of_edge.push_back(index);
            from = to;
        }
        mesh.add_edge(from, last_vertex, chain.left, chain.right);
        chain_of_edge.push_back(index);
    };
    // Single cracks cannot bend, so they come first.
    for (int pass = 0; pass < 2; ++pass)
        for (int k = 0; k < static_cast<int>(chains.size()); ++k)
            if ((chains[k].points.size() == 2) == (pass == 0)) add_chain(k);
    return chain_of_edge;
}

void hand_over_ids(const std::vector<Vertex>& old, std::vector<Vertex>& fresh) {
    struct Match {
        double distance;
        int from, to;
    };
    std::vector<int> by_x(fresh.size());
    std::iota(by_x.begin(), by_x.end(), 0);
    std::sort(by_x.begin(), by_x.end(), [&](int a, int b) { return fresh[a].p.x < fresh[b].p.x; });
    std::vector<Match> matches;
    for (int i = 0; i < static_cast<int>(old.size()); ++i) {
        auto place = std::lower_bound(by_x.begin(), by_x.end(), old[i].p.x - kSameVertex,
                                      [&](int j, double x) { return fresh[j].p.x < x; });
        for (; place != by_x.end() && fresh[*place].p.x <= old[i].p.x + kSameVertex; ++place) {
            const double d = length(old[i].p - fresh[*place].p);
            if (d <= kSameVertex) matches.push_back({d, i, *place});
        }
    }
    std::sort(matches.begin(), matches.end(), [](const Match& a, const Match& b) {
        return std::tie(a.distance, a.from, a.to) < std::tie(b.distance, b.from, b.to);
    });
    std::vector<char> used(old.size(), 0), named(fresh.size(), 0);
    for (const Match& m : matches) {
        if (used[m.from] || named[m.to]) continue;
        used[m.from] = named[m.to] = 1;
        fresh[m.to].id = old[m.from].id;
    }
}

}  // namespace

void vectorise(Mesh& mesh, Crossings& crossings, const std::vector<int>& labels) {
    const std::vector<Vertex> old = mesh.vertices;
    std::vector<Chain> chains = CrackGraph(labels, mesh.width, mesh.height).chains();
    constexpr int kRounds = 6;
    for (int round = 0; round <= kRounds; ++round) {
        const std::int64_t first_id = mesh.next_vertex_id;
        const std::vector<int> chain_of_edge = build_edges(mesh, chains);
        crossings.build(mesh);
        const std::vector<int> bad = find_faults(mesh, crossings);
        if (bad.empty()) break;
        for (int e : bad) {
            Chain& chain = chains[chain_of_edge[e]];
            chain.tolerance = round < 4 ? chain.tolerance / 2 : 0.0;  // the cracks themselves cannot cross
        }
        if (round == kRounds - 1)
            for (Chain& chain : chains) chain.tolerance = 0.0;
        mesh.next_vertex_id = first_id;
    }
    hand_over_ids(old, mesh.vertices);
    const std::size_t edges = mesh.edges.size();
    mesh.compact();
    if (mesh.edges.size() != edges) crossings.build(mesh);
}

}  // namespace rbdn
