// Polygon merging: by colour, by size and by thinness (section 2.3 of the paper).
#include "merge.hpp"

#include <algorithm>
#include <limits>
#include <queue>
#include <utility>
#include <vector>

namespace rbdn {

namespace {

// Size of a face by its edges; the means look at a part of its pixels only.
struct Outline {
    double area_px = 0;
    double length_px = 0;
};

std::vector<Outline> measure_outlines(const Mesh& mesh) {
    std::vector<Outline> outlines(mesh.faces.size());
    for (const Edge& e : mesh.edges) {
        const double size = mesh.edge_length(e);
        // Shoelace; a face on the left is walked anticlockwise on the screen.
        const double swept = -0.5 * cross(mesh.vertices[e.a].p, mesh.vertices[e.b].p);
        if (e.left >= 0) {
            outlines[e.left].area_px += swept;
            outlines[e.left].length_px += size;
        }
        if (e.right >= 0) {
            outlines[e.right].area_px -= swept;
            outlines[e.right].length_px += size;
        }
    }
    return outlines;
}

bool is_insignificant(const Outline& outline, const MergeRule& rule) {
    return outline.area_px < rule.min_area_px || 2.0 * outline.area_px < rule.min_width_px * outline.length_px;
}

float apart2(const Colour& a, const Colour& b, float lightness_gain) {
    const float lightness = lightness_gain * (a[0] - b[0]);
    return lightness * lightness + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]);
}

// The border between two faces.
struct Border {
    double length_px = 0;
    double jump = 0;  // of the colour across it, times length

    void add(const Border& other) {
        length_px += other.length_px;
        jump += other.jump;
    }
};

// The border that a face shares with each of its neighbours.
class Neighbours {
public:
    Border& shared_with(int face) {
        const auto place = find(face);
        if (place != items_.end() && place->first == face) return place->second;
        return items_.insert(place, {face, Border{}})->second;
    }
    void erase(int face) {
        const auto place = find(face);
        if (place != items_.end() && place->first == face) items_.erase(place);
    }
    void clear() { items_.clear(); }
    bool empty() const { return items_.empty(); }
    auto begin() const { return items_.begin(); }
    auto end() const { return items_.end(); }

private:
    using Items = std::vector<std::pair<int, Border>>;
    Items::iterator find(int face) {
        return std::lower_bound(items_.begin(), items_.end(), face,
                                [](const auto& item, int wanted) { return item.first < wanted; });
    }

    Items items_;  // ordered by face, so that ties fall the same way every time
};

// Faces as a shrinking graph: each group of merged faces is represented by one of them.
class FaceGraph {
public:
    FaceGraph(const Mesh& mesh, double lightness_gain, const std::vector<float>& jumps)
        : root_(mesh.faces.size()), sum_(mesh.faces.size()), mean_(mesh.faces.size()),
          neighbours_(mesh.faces.size()), outline_(measure_outlines(mesh)), version_(mesh.faces.size(), 0),
          alive_(mesh.faces.size(), 0), lightness_gain_(static_cast<float>(lightness_gain)) {
        for (std::size_t k = 0; k < mesh.faces.size(); ++k) {
            root_[k] = static_cast<int>(k);
            sum_[k] = mesh.faces[k].sum;
            mean_[k] = mesh.faces[k].mean;
        }
        for (std::size_t k = 0; k < mesh.edges.size(); ++k) {
            const Edge& e = mesh.edges[k];
            for (int face : {e.left, e.right})
                if (face >= 0) alive_[face] = 1;
            if (!e.on_border() && e.left != e.right) {
                const double size = mesh.edge_length(e);
                const Border border{size, jumps.empty() ? 0.0 : size * jumps[k]};
                neighbours_[e.left].shared_with(e.right).add(border);
                neighbours_[e.right].shared_with(e.left).add(border);
            }
        }
    }

    int size() const { return static_cast<int>(root_.size()); }
    bool alive(int face) const { return alive_[face] != 0; }
    int living() const { return static_cast<int>(std::count(alive_.begin(), alive_.end(), 1)); }
    int version(int face) const { return version_[face]; }
    const Neighbours& neighbours(int face) const { return neighbours_[face]; }
    const Border& border(int a, int b) { return neighbours_[a].shared_with(b); }
    const Outline& outline(int face) const { return outline_[face]; }

    double colour_distance2(int a, int b) const { return apart2(mean_[a], mean_[b], lightness_gain_); }

    int root_of(int face) const {
        while (root_[face] != face) face = root_[face];
        return face;
    }

    // The larger face survives; returns it.
    int merge(int a, int b) {
        const int kept = outline_[a].area_px >= outline_[b].area_px ? a : b;
        const int gone = kept == a ? b : a;
        outline_[kept].area_px += outline_[gone].area_px;
        outline_[kept].length_px += outline_[gone].length_px - 2.0 * neighbours_[kept].shared_with(gone).length_px;
        neighbours_[kept].erase(gone);
        for (const auto& [other, shared] : neighbours_[gone]) {
            neighbours_[other].erase(gone);
            if (other == kept) continue;
            neighbours_[kept].shared_with(other).add(shared);
            neighbours_[other].shared_with(kept).add(shared);
        }
        neighbours_[gone].clear();
        // A face too small to hold a pixel that counts has no colour to contribute.
        sum_[kept].add(sum_[gone]);
        if (sum_[kept].count > 0) mean_[kept] = sum_[kept].mean();
        root_[gone] = kept;
        alive_[gone] = 0;
        ++version_[kept];
        return kept;
    }

private:
    std::vector<int> root_;
    std::vector<ColourSum> sum_;
    std::vector<Colour> mean_;
    std::vector<Neighbours> neighbours_;
    std::vector<Outline> outline_;
    std::vector<int> version_;
    std::vector<char> alive_;
    float lightness_gain_;
};

struct Candidate {
    double distance2;
    int a, b;
    int version_a, version_b;

    bool operator>(const Candidate& o) const {
        return distance2 != o.distance2 ? distance2 > o.distance2 : a != o.a ? a > o.a : b > o.b;
    }
};

int merge_alike(FaceGraph& graph, double eta, double sharp_jump, int most_merges) {
    std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> queue;
    const auto offer = [&](int a, int b, const Border& border) {
        if (sharp_jump > 0 && border.jump > sharp_jump * border.length_px) return;
        const double d2 = graph.colour_distance2(a, b);
        if (d2 <= eta * eta)
            queue.push({d2, std::min(a, b), std::max(a, b), graph.version(std::min(a, b)),
                        graph.version(std::max(a, b))});
    };
    for (int a = 0; a < graph.size(); ++a)
        for (const auto& [b, shared] : graph.neighbours(a))
            if (a < b) offer(a, b, shared);

    int merged = 0;
    while (!queue.empty() && merged < most_merges) {
        const Candidate c = queue.top();
        queue.pop();
        if (!graph.alive(c.a) || !graph.alive(c.b)) continue;
        if (graph.version(c.a) != c.version_a || graph.version(c.b) != c.version_b) {
            offer(c.a, c.b, graph.border(c.a, c.b));  // their colours have changed since
            continue;
        }
        const int gone = graph.outline(c.a).area_px >= graph.outline(c.b).area_px ? c.b : c.a;
        const Neighbours met = graph.neighbours(gone);
        const int kept = graph.merge(c.a, c.b);
        ++merged;
        // The survivor's older pairs are looked at again when their turn comes.
        for (const auto& [other, shared] : met)
            if (other != kept) offer(kept, other, graph.border(kept, other));
    }
    return merged;
}

// Small and thin faces join the neighbour of the nearest colour, however far that is; smallest first.
int merge_insignificant(FaceGraph& graph, const MergeRule& rule) {
    const auto insignificant = [&](int face) { return is_insignificant(graph.outline(face), rule); };
    std::vector<int> order;
    for (int k = 0; k < graph.size(); ++k)
        if (graph.alive(k) && insignificant(k)) order.push_back(k);
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return graph.outline(a).area_px < graph.outline(b).area_px; });

    int merged = 0;
    for (int face : order) {
        if (!graph.alive(face) || !insignificant(face) || graph.neighbours(face).empty()) continue;
        int nearest = -1;
        for (const auto& [other, shared] : graph.neighbours(face))
            if (nearest < 0 || graph.colour_distance2(face, other) < graph.colour_distance2(face, nearest))
                nearest = other;
        graph.merge(face, nearest);
        ++merged;
    }
    return merged;
}

// Is there a pair alike or a face insignificant? Mostly not, and then the graph need not be built.
bool may_merge(const Mesh& mesh, const MergeRule& rule, const std::vector<float>& jumps) {
    const auto gain = static_cast<float>(rule.lightness_gain);
    for (std::size_t k = 0; k < mesh.edges.size(); ++k) {
        const Edge& e = mesh.edges[k];
        if (e.on_border()) continue;
        if (e.left == e.right) return true;
        if (!jumps.empty() && jumps[k] > rule.sharp_jump) continue;
        if (apart2(mesh.faces[e.left].mean, mesh.faces[e.right].mean, gain) <= rule.eta * rule.eta) return true;
    }
    const std::vector<Outline> outlines = measure_outlines(mesh);
    return std::any_of(outlines.begin(), outlines.end(),
                       [&](const Outline& o) { return o.length_px > 0 && is_insignificant(o, rule); });
}

void apply(const FaceGraph& graph, Mesh& mesh) {
    for (Edge& e : mesh.edges) {
        if (e.left >= 0) e.left = graph.root_of(e.left);
        if (e.right >= 0) e.right = graph.root_of(e.right);
    }
    mesh.compact();
}

}  // namespace

int merge_faces(Mesh& mesh, const MergeRule& rule, const std::vector<float>& jumps) {
    if (!may_merge(mesh, rule, jumps)) return 0;
    FaceGraph graph(mesh, rule.lightness_gain, jumps);
    int merged = 0;
    for (int more = 1; more > 0; merged += more) {
        more = merge_alike(graph, rule.eta, jumps.empty() ? 0.0 : rule.sharp_jump, graph.size());
        more += merge_insignificant(graph, rule);
    }
    if (merged > 0) apply(graph, mesh);
    return merged;
}

int merge_to_fit(Mesh& mesh, int most_faces) {
    if (static_cast<int>(mesh.faces.size()) <= most_faces) return 0;
    FaceGraph graph(mesh, 1.0, {});
    const int too_many = graph.living() - most_faces;
    if (too_many <= 0) return 0;
    const int merged = merge_alike(graph, std::numeric_limits<double>::infinity(), 0.0, too_many);
    apply(graph, mesh);
    return merged;
}

}  // namespace rbdn
