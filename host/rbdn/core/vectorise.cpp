// A net from a label image: the cracks between unlike pixels, simplified as far as the net stays planar.
#include "vectorise.hpp"

#include <algorithm>
#include <cmath>
#include <map>

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

class CrackGraph {
public:
    CrackGraph(const std::vector<int>& labels, int width, int height)
        : labels_(labels), width_(width), height_(height),
          walked_(4 * static_cast<std::size_t>(width + 1) * (height + 1), 0) {}

    std::vector<Chain> chains() {
        std::vector<Chain> out;
        for (int y = 0; y <= height_; ++y)
            for (int x = 0; x <= width_; ++x)
                if (is_node({x, y}))
                    for (int direction = 0; direction < 4; ++direction)
                        if (has_crack({x, y}, direction) && !walked({x, y}, direction))
                            out.push_back(follow({x, y}, direction));
        for (int y = 0; y <= height_; ++y)
            for (int x = 0; x <= width_; ++x)
                if (has_crack({x, y}, 0) && !walked({x, y}, 0)) out.push_back(follow({x, y}, 0));
        return out;
    }

private:
    static constexpr int kDx[4] = {1, 0, -1, 0};
    static constexpr int kDy[4] = {0, 1, 0, -1};

    int label(int x, int y) const {
        return x < 0 || y < 0 || x >= width_ || y >= height_ ? kOutside
                                                             : labels_[static_cast<std::size_t>(y) * width_ + x];
    }

    // Labels to the left and right of a step from p.
    std::pair<int, int> beside(Point p, int direction) const {
        switch (direction) {
            case 0: return {label(p.x, p.y - 1), label(p.x, p.y)};
            case 1: return {label(p.x, p.y), label(p.x - 1, p.y)};
            case 2: return {label(p.x - 1, p.y), label(p.x - 1, p.y - 1)};
            default: return {label(p.x - 1, p.y - 1), label(p.x, p.y - 1)};
        }
    }

    bool has_crack(Point p, int direction) const {
        const auto [left, right] = beside(p, direction);
        return left != right;
    }

    bool is_node(Point p) const {
        const bool corner = (p.x == 0 || p.x == width_) && (p.y == 0 || p.y == height_);
        if (corner) return true;
        int cracks = 0;
        for (int direction = 0; direction < 4; ++direction) cracks += has_crack(p, direction);
        return cracks > 2;
    }

    char& mark(Point p, int direction) {
        return walked_[4 * (static_cast<std::size_t>(p.y) * (width_ + 1) + p.x) + direction];
    }
    bool walked(Point p, int direction) { return mark(p, direction) != 0; }

    Chain follow(Point p, int direction) {
        Chain chain;
        std::tie(chain.left, chain.right) = beside(p, direction);
        const Point start = p;
        chain.points.push_back(p);
        for (;;) {
            mark(p, direction) = 1;
            p = {p.x + kDx[direction], p.y + kDy[direction]};
            mark(p, (direction + 2) % 4) = 1;
            chain.points.push_back(p);
            if (p == start || is_node(p)) return chain;
            const int back = (direction + 2) % 4;
            for (int turn = 0; turn < 4; ++turn) {
                if (turn != back && has_crack(p, turn)) {
                    direction = turn;
                    break;
                }
            }
        }
    }

    const std::vector<int>& labels_;
    int width_;
    int height_;
    std::vector<char> walked_;
};

double height_over_chord(Point p, Point a, Point b) {
    const double dx = b.x - a.x, dy = b.y - a.y;
    const double size = std::hypot(dx, dy);
    if (size == 0.0) return std::hypot(p.x - a.x, p.y - a.y);
    return std::abs(dx * (p.y - a.y) - dy * (p.x - a.x)) / size;
}

// The point of a chain that lies farthest from the chord between two of its points.
int farthest_between(const std::vector<Point>& points, int first, int last, double* distance) {
    int at = first;
    *distance = -1.0;
    for (int k = first + 1; k < last; ++k) {
        const double d = height_over_chord(points[k], points[first], points[last]);
        if (d > *distance) {
            *distance = d;
            at = k;
        }
    }
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
    std::vector<Match> matches;
    for (std::size_t i = 0; i < old.size(); ++i)
        for (std::size_t j = 0; j < fresh.size(); ++j) {
            if (std::abs(old[i].p.x - fresh[j].p.x) > kSameVertex) continue;
            const double d = length(old[i].p - fresh[j].p);
            if (d <= kSameVertex) matches.push_back({d, static_cast<int>(i), static_cast<int>(j)});
        }
    std::stable_sort(matches.begin(), matches.end(),
                     [](const Match& a, const Match& b) { return a.distance < b.distance; });
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
    mesh.compact();
    crossings.build(mesh);
}

}  // namespace rbdn
