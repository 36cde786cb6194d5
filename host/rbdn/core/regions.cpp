// Regions: faces held together where the colour does not step across their common edge.
#include "regions.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

namespace rbdn {

namespace {

constexpr double kStripNear = 2.5;  // px from the edge, past its blur
constexpr double kStripFar = 4.5;
constexpr double kStripSpacing = 1.5;
constexpr int kFewStepSamples = 6;
constexpr double kForeign = 0.75;  // of the way from a face's own mean to its neighbour's
constexpr int kSampleStep = 4;  // px between the pixels at which the last frame is remembered
constexpr double kSameAsBefore = 1.25;  // of the distance within a face: at first little is seen but its blurred rim
constexpr float kExtraLightness = 1.5F;  // steps discount lightness less than merging does
constexpr double kPartingJump = 1.5;  // of a sharp one; faces of one region part only above it

// Colours beside an edge, or beside all edges between two faces.
struct Strip {
    std::array<double, 3> sum{};
    int count = 0;

    void add(const Colour& colour) {
        for (int k = 0; k < 3; ++k) sum[k] += colour[k];
        ++count;
    }
    void add(const Strip& other) {
        for (int k = 0; k < 3; ++k) sum[k] += other.sum[k];
        count += other.count;
    }
};

struct ColourStep {
    Strip left, right;
    double jump = 0;  // times length
    double length_px = 0;
};

// Does a strip show the face beyond the edge rather than its own? Such an edge is out of place, and the colour
// steps elsewhere. At a cut through a shaded surface both strips are half way between the faces' means.
bool is_foreign(const Strip& strip, const Colour& own, const Colour& beyond) {
    double along = 0, between2 = 0;
    for (int k = 0; k < 3; ++k) {
        const double direction = beyond[k] - own[k];
        along += direction * (strip.sum[k] - strip.count * own[k]);
        between2 += direction * direction;
    }
    return along > kForeign * strip.count * between2;
}

using FacePair = std::pair<int, int>;

// Mean colours beside the common edges of every pair of neighbours.
std::map<FacePair, ColourStep> measure_steps(const Mesh& mesh, const Image& image, const std::vector<int>& labels,
                                       const std::vector<float>& jumps) {
    std::map<FacePair, ColourStep> steps;
    for (const Edge& e : mesh.edges) {
        if (e.on_border() || e.left == e.right) continue;
        const bool swapped = e.left > e.right;
        ColourStep& step = steps[{std::min(e.left, e.right), std::max(e.left, e.right)}];
        const double size = mesh.edge_length(e);
        if (size < 1e-9) continue;
        step.jump += jumps.empty() ? 0.0 : size * jumps[static_cast<std::size_t>(&e - mesh.edges.data())];
        step.length_px += size;
        const Vec2 a = mesh.vertices[e.a].p;
        const Vec2 unit = (1.0 / size) * mesh.along(e);
        const Vec2 normal = left_normal(mesh.along(e));
        const auto sample = [&](Vec2 p, int face, Strip& strip) {
            const int x = floor_px(p.x), y = floor_px(p.y);
            if (x < 0 || y < 0 || x >= mesh.width || y >= mesh.height) return;
            if (labels[static_cast<std::size_t>(y) * mesh.width + x] != face) return;
            strip.add(image.colour_of(image.row(y) + 3 * x));
        };
        Strip left, right;
        for (double s = 0.5; s < size; s += kStripSpacing) {
            const Vec2 on_edge = a + s * unit;
            for (double d = kStripNear; d <= kStripFar; d += 1.0) {
                sample(on_edge + d * normal, e.left, left);
                sample(on_edge - d * normal, e.right, right);
            }
        }
        const Colour &left_mean = mesh.faces[e.left].mean, &right_mean = mesh.faces[e.right].mean;
        if (is_foreign(left, left_mean, right_mean) || is_foreign(right, right_mean, left_mean)) continue;
        (swapped ? step.right : step.left).add(left);
        (swapped ? step.left : step.right).add(right);
    }
    return steps;
}

double step_size(const ColourStep& step, const Face& left, const Face& right) {
    double sum = 0;
    for (int k = 0; k < 3; ++k) {
        const double a = step.left.count >= kFewStepSamples ? step.left.sum[k] / step.left.count : left.mean[k];
        const double b = step.right.count >= kFewStepSamples ? step.right.sum[k] / step.right.count : right.mean[k];
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

void RegionGrouping::expect(const Mesh& mesh, const std::vector<int>& labels) {
    known_.clear();
    for (const Face& face : mesh.faces) known_.push_back({face.id, face.region, face.mean});
    expected_face_.clear();
    for (int y = 0; y < mesh.height; y += kSampleStep)
        for (int x = 0; x < mesh.width; x += kSampleStep)
            expected_face_.push_back(labels[static_cast<std::size_t>(y) * mesh.width + x]);
}

// Calls `visit` with each sampled pixel and the face of the last frame that was expected there.
template <class Visit>
void RegionGrouping::for_each_sample(const Mesh& mesh, Visit visit) const {
    if (expected_face_.empty()) return;
    const int known = static_cast<int>(known_.size());
    const int* expected = expected_face_.data();
    for (int y = 0; y < mesh.height; y += kSampleStep)
        for (int x = 0; x < mesh.width; x += kSampleStep) {
            const int face = *expected++;
            if (face >= 0 && face < known) visit(x, y, known_[face]);
        }
}

RegionSet RegionGrouping::update(Mesh& mesh, const Image& image, const std::vector<int>& labels,
                                 const std::vector<float>& jumps, const RegionRule& rule) {
    RegionSet set;
    set.of_face = group_faces(mesh, image, labels, jumps, rule);
    name_groups(mesh, image, labels, rule, set);
    set.gone = find_gone(mesh, image, labels, rule, set);
    remember_gone(mesh, set);
    ++frame_;
    return set;
}

// Group of every face, numbered from 0 in the order of the faces.
std::vector<int> RegionGrouping::group_faces(const Mesh& mesh, const Image& image, const std::vector<int>& labels,
                                             const std::vector<float>& jumps, const RegionRule& rule) {
    UnionFind joined(mesh.faces.size());
    std::set<std::pair<std::int64_t, std::int64_t>> links;
    for (const auto& [pair, step] : measure_steps(mesh, image, labels, jumps)) {
        const Face& a = mesh.faces[pair.first];
        const Face& b = mesh.faces[pair.second];
        const auto key = std::minmax(a.id, b.id);
        const bool linked = links_.contains({key.first, key.second});
        const double sharp = (linked ? kPartingJump : 1.0) * rule.sharp_jump;
        if (!jumps.empty() && step.jump > sharp * step.length_px) continue;
        if (step_size(step, a, b) < (linked ? rule.keep_step : rule.link_step)) {
            joined.join(pair.first, pair.second);
            links.insert({key.first, key.second});
        }
    }
    links_.swap(links);

    std::vector<int> group;
    std::map<int, int> index_of_root;
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        const int next = static_cast<int>(index_of_root.size());
        group.push_back(index_of_root.try_emplace(joined.find(static_cast<int>(f)), next).first->second);
    }
    return group;
}

// A face votes with its pixels for the region it was in, unless its colour is another now: then its edges have
// been caught by something else. Pixels vote too, for the region they were expected in, where they have its colour.
// A region's id goes to the group that holds most of it, and each group takes the best id left to it. New faces
// vote for the region they were cut from, but after all others: so a region that was cut up and regrouped
// altogether is still itself.
void RegionGrouping::name_groups(Mesh& mesh, const Image& image, const std::vector<int>& labels,
                                 const RegionRule& rule, RegionSet& set) {
    struct Vote {
        std::int64_t pixels;
        std::int64_t region;
        int group;
        bool late;
    };
    const std::size_t count =
        set.of_face.empty() ? 0 : 1 + *std::max_element(set.of_face.begin(), set.of_face.end());
    const double same2 = rule.same_colour * rule.same_colour;
    std::map<std::int64_t, Colour> mean_before;
    for (const Known& face : known_) mean_before[face.id] = face.mean;
    std::map<std::tuple<bool, int, std::int64_t>, std::int64_t> tally;
    std::vector<std::int64_t> news(count, 0), all(count, 0);
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
        Face& face = mesh.faces[f];
        const int group = set.of_face[f];
        const bool is_new = face.region < 0;
        const std::int64_t region = is_new ? face.parent : face.region;
        const auto before = mean_before.find(face.id);
        const bool late = is_new || before == mean_before.end() || distance2(face.mean, before->second) > same2;
        if (region >= 0) tally[{late, group, region}] += face.sum.count;
        all[group] += face.sum.count;
        if (is_new && face.is_news) news[group] += face.sum.count;
        face.is_news = false;
    }
    const int sample_weight = std::max(1, kSampleStep * kSampleStep / (image.row_step() * image.column_step()));
    const bool on_lattice = kSampleStep % image.row_step() == 0 && kSampleStep % image.column_step() == 0;
    // Neighbouring samples mostly vote alike.
    int last_group = -1;
    std::int64_t last_region = kNoRegion;
    std::int64_t* last_votes = nullptr;
    for_each_sample(mesh, [&](int x, int y, const Known& expected) {
        if (expected.region < 0) return;
        const Colour colour =
            on_lattice ? to_float(image.lattice_colour(x, y)) : image.colour_of(image.row(y) + 3 * x);
        if (distance2(colour, expected.mean) > same2) return;
        const int group = set.of_face[labels[static_cast<std::size_t>(y) * mesh.width + x]];
        if (last_votes == nullptr || group != last_group || expected.region != last_region) {
            last_group = group;
            last_region = expected.region;
            last_votes = &tally[{false, group, expected.region}];
        }
        *last_votes += sample_weight;
    });
    std::vector<Vote> votes;
    for (const auto& [key, pixels] : tally)
        votes.push_back({pixels, std::get<2>(key), std::get<1>(key), std::get<0>(key)});
    std::stable_sort(votes.begin(), votes.end(), [](const Vote& a, const Vote& b) {
        return a.late != b.late ? b.late : a.pixels > b.pixels;
    });

    set.id.assign(count, kNoRegion);
    set.parent.assign(count, kNoRegion);
    set.is_news.assign(count, 0);
    std::set<std::int64_t> taken;
    for (const Vote& v : votes) {
        if (set.id[v.group] >= 0 || taken.contains(v.region)) continue;
        set.id[v.group] = v.region;
        taken.insert(v.region);
    }
    std::vector<std::int64_t> most(count, 0);
    for (const Vote& v : votes) {
        if (set.id[v.group] >= 0 || v.pixels <= most[v.group]) continue;
        most[v.group] = v.pixels;
        set.parent[v.group] = v.region;
    }
    set.is_back.assign(count, 0);
    if (std::find(set.id.begin(), set.id.end(), kNoRegion) != set.id.end()) {
        const std::vector<Sight> sights = look_at_groups(mesh, image, labels, set);
        for (std::size_t g = 0; g < count; ++g) {
            if (set.id[g] >= 0) continue;
            const std::int64_t known = absent_.recognise(sights[g], kSameAsBefore * rule.same_colour, frame_);
            set.is_back[g] = known != kNoRegion;
            set.is_news[g] = set.is_back[g] || 2 * news[g] > all[g];
            set.id[g] = set.is_back[g] ? known : next_id_++;
        }
    }
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) mesh.faces[f].region = set.id[set.of_face[f]];
}

std::vector<Sight> RegionGrouping::look_at_groups(const Mesh& mesh, const Image& image, const std::vector<int>& labels,
                                                  const RegionSet& set) const {
    std::vector<Sight> sights(set.id.size());
    for (int y = 0; y < mesh.height; y += kSampleStep)
        for (int x = 0; x < mesh.width; x += kSampleStep) {
            const int group = set.of_face[labels[static_cast<std::size_t>(y) * mesh.width + x]];
            if (set.id[group] < 0) sights[group].add(image.colour_of(image.row(y) + 3 * x), x, y);
        }
    return sights;
}

void RegionGrouping::remember_gone(const Mesh& mesh, const RegionSet& set) {
    absent_.forget_old(frame_);
    if (set.gone.empty()) return;
    std::map<std::int64_t, Sight> last;
    for (const GoneRegion& region : set.gone) last[region.id];
    for_each_sample(mesh, [&](int x, int y, const Known& face) {
        const auto gone = last.find(face.region);
        if (gone != last.end()) gone->second.add(face.mean, x, y);
    });
    for (const auto& [id, sight] : last)
        if (sight.sum.count > 0) absent_.remember(id, sight, frame_);
}

std::vector<GoneRegion> RegionGrouping::find_gone(const Mesh& mesh, const Image& image,
                                                  const std::vector<int>& labels, const RegionRule& rule,
                                                  const RegionSet& set) const {
    std::set<std::int64_t> missing;
    for (const Known& face : known_)
        if (face.region >= 0) missing.insert(face.region);
    for (std::int64_t id : set.id) missing.erase(id);
    std::vector<GoneRegion> gone;
    for (std::int64_t id : missing) gone.push_back({id, what_became_of(id, mesh, image, labels, rule, set)});
    return gone;
}

// Most pixels of a region that was merged are still to be seen where they were expected; they only belong to
// another region now. What was hidden or left shows its neighbour's colours there instead.
std::int64_t RegionGrouping::what_became_of(std::int64_t region, const Mesh& mesh, const Image& image,
                                            const std::vector<int>& labels, const RegionRule& rule,
                                            const RegionSet& set) const {
    std::map<std::int64_t, const Known*> by_id;
    for (const Known& face : known_) by_id[face.id] = &face;
    std::map<int, int> seen_in;  // group -> samples
    int expected = 0;
    for_each_sample(mesh, [&](int x, int y, const Known& face) {
        if (face.region != region) return;
        ++expected;
        const int owner = labels[static_cast<std::size_t>(y) * mesh.width + x];
        const auto before = by_id.find(mesh.faces[owner].id);
        const Colour colour = image.colour_of(image.row(y) + 3 * x);
        const float away2 = distance2(colour, face.mean);
        const bool still_there =
            before == by_id.end()            ? away2 < rule.same_colour * rule.same_colour
            : before->second->region == region ? true
                                             : away2 < distance2(colour, before->second->mean);
        if (still_there) ++seen_in[set.of_face[owner]];
    });
    int most = 0;
    std::int64_t became = kNoRegion;
    for (const auto& [group, samples] : seen_in) {
        if (samples <= most) continue;
        most = samples;
        became = set.id[group];
    }
    const bool worth_it = most * kSampleStep * kSampleStep >= rule.smallest_px && 2 * most >= expected;
    return worth_it ? became : kNoRegion;
}

}  // namespace rbdn
