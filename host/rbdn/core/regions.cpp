// Regions: faces held together where the colour does not step across their common edge.
#include "regions.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace rbdn {

namespace {

constexpr double kStripNear = 2.5;  // px from the edge, past its blur
constexpr double kStripFar = 4.5;
constexpr int kFewSamples = 6;
constexpr float kExtraLightness = 1.5F;  // steps discount lightness less than merging does

struct Step {
    std::array<double, 3> left{}, right{};
    int left_count = 0, right_count = 0;
};

using FacePair = std::pair<int, int>;

// Mean colours beside the common edges of every pair of neighbours.
std::map<FacePair, Step> measure_steps(const Mesh& mesh, const Image& image, const std::vector<int>& labels) {
    std::map<FacePair, Step> steps;
    for (const Edge& e : mesh.edges) {
        if (e.on_border() || e.left == e.right) continue;
        const bool swapped = e.left > e.right;
        Step& step = steps[{std::min(e.left, e.right), std::max(e.left, e.right)}];
        const double size = mesh.edge_length(e);
        if (size < 1e-9) continue;
        const Vec2 a = mesh.vertices[e.a].p;
        const Vec2 unit = (1.0 / size) * mesh.along(e);
        const Vec2 normal = left_normal(mesh.along(e));
        const auto sample = [&](Vec2 p, int face, std::array<double, 3>& sum, int& count) {
            const int x = floor_px(p.x), y = floor_px(p.y);
            if (x < 0 || y < 0 || x >= mesh.width || y >= mesh.height) return;
            if (labels[static_cast<std::size_t>(y) * mesh.width + x] != face) return;
            const Colour colour = image.colour_of(image.row(y) + 3 * x);
            for (int k = 0; k < 3; ++k) sum[k] += colour[k];
            ++count;
        };
        for (double s = 0.5; s < size; s += 1.0) {
            const Vec2 on_edge = a + s * unit;
            for (double d = kStripNear; d <= kStripFar; d += 1.0) {
                auto& left = swapped ? step.right : step.left;
                auto& right = swapped ? step.left : step.right;
                sample(on_edge + d * normal, e.left, left, swapped ? step.right_count : step.left_count);
                sample(on_edge - d * normal, e.right, right, swapped ? step.left_count : step.right_count);
            }
        }
    }
    return steps;
}

double step_size(const Step& step, const Face& left, const Face& right) {
    double sum = 0;
    for (int k = 0; k < 3; ++k) {
        const double a = step.left_count >= kFewSamples ? step.left[k] / step.left_count : left.mean[k];
        const double b = step.right_count >= kFewSamples ? step.right[k] / step.right_count : right.mean[k];
        const double difference = (a - b) * (k == 0 ? kExtraLightness : 1.0F);
        sum += difference * difference;
    }
    return std::sqrt(sum);
}

class UnionFind {
public:
    explicit UnionFind(std::size_t count) : root_(count) {
        for (std::size_t k = 0; k < count; ++k) root_[k] = static_cast<int>(k);
    }
    int find(int k) const {
        while (root_[k] != k) k = root_[k];
        return k;
    }
    void join(int a, int b) { root_[std::max(find(a), find(b))] = std::min(find(a), find(b)); }

private:
    std::vector<int> root_;
};

}  // namespace

RegionSet RegionGrouping::update(Mesh& mesh, const Image& image, const std::vector<int>& labels,
                                 const RegionRule& rule) {
    UnionFind groups(mesh.faces.size());
    std::set<std::pair<std::int64_t, std::int64_t>> links;
    for (const auto& [pair, step] : measure_steps(mesh, image, labels)) {
        const Face& a = mesh.faces[pair.first];
        const Face& b = mesh.faces[pair.second];
        const auto key = std::minmax(a.id, b.id);
        const bool linked = links_.contains({key.first, key.second});
        if (step_size(step, a, b) < (linked ? rule.keep_step : rule.link_step)) {
            groups.join(pair.first, pair.second);
            links.insert({key.first, key.second});
        }
    }
    links_.swap(links);

    RegionSet set;
    set.of_face.assign(mesh.faces.size(), -1);
    std::map<int, int> index_of_root;
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        const auto [place, is_new] = index_of_root.try_emplace(groups.find(static_cast<int>(f)),
                                                               static_cast<int>(index_of_root.size()));
        set.of_face[f] = place->second;
    }
    const std::size_t count = index_of_root.size();

    // Every face votes with its pixels for the region it was in; a region's id goes to the group that holds
    // most of it, and each group takes the best id left to it.
    struct Vote {
        std::int64_t pixels;
        std::int64_t region;
        int group;
    };
    std::map<std::pair<int, std::int64_t>, std::int64_t> tally, parents;
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        const Face& face = mesh.faces[f];
        if (face.region >= 0)
            tally[{set.of_face[f], face.region}] += face.sum.count;
        else if (face.parent >= 0)
            parents[{set.of_face[f], face.parent}] += face.sum.count;
    }
    std::vector<Vote> votes;
    for (const auto& [key, pixels] : tally) votes.push_back({pixels, key.second, key.first});
    std::stable_sort(votes.begin(), votes.end(), [](const Vote& a, const Vote& b) { return a.pixels > b.pixels; });

    set.id.assign(count, -1);
    set.parent.assign(count, -1);
    std::set<std::int64_t> taken;
    for (const Vote& v : votes) {
        if (set.id[v.group] >= 0 || taken.contains(v.region)) continue;
        set.id[v.group] = v.region;
        taken.insert(v.region);
    }
    for (std::size_t g = 0; g < count; ++g) {
        if (set.id[g] >= 0) continue;
        std::int64_t most = -1;
        for (const auto* source : {&tally, &parents})
            for (const auto& [key, pixels] : *source)
                if (key.first == static_cast<int>(g) && pixels > most) {
                    most = pixels;
                    set.parent[g] = key.second;
                }
        set.id[g] = next_id_++;
    }
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) mesh.faces[f].region = set.id[set.of_face[f]];
    return set;
}

}  // namespace rbdn
