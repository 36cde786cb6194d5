// The net's life: made on the first frame, carried to each next one (sections 2 and 3 of the paper).
#include "tracker.hpp"

#include <algorithm>
#include <limits>

#include "jumps.hpp"
#include "loops.hpp"
#include "merge.hpp"
#include "paper.hpp"
#include "vectorise.hpp"

namespace rbdn {

namespace {

constexpr double kQuiet = 0.7;        // px; the paper's stop by displacement
constexpr double kLiteralQuiet = 0.25;  // the same for its own forces, which go half of the way or less
constexpr int kPatience = 4;          // cycles without progress before giving up: hard counts jitter for ever
constexpr double kProgress = 0.97;
constexpr int kMaintenancePeriod = 3;
constexpr int kCoarseStep = 2;        // of the lines looked at until the first maintenance
constexpr int kFullScans = 2;         // cycles after which edges at rest are not looked at again
constexpr int kFullGainCycles = 6;
constexpr double kLateGain = 0.5;
constexpr double kOffGate = 1.6;      // eta; farther than this from its face, a pixel is off
constexpr int kTrackMeanRows = 4;     // means are taken over every so many rows and columns; the first squares'
constexpr int kTrackMeanColumns = 2;  // need all of their pixels
constexpr double kNewsShare = 0.3;    // of the smallest polygon's area: a part may fit
constexpr double kAnyDistance = std::numeric_limits<double>::infinity();
constexpr double kSharpJump = 6.0;    // CIELAB units; more is an outline rather than shading
constexpr double kRoughness = 4.0;    // the same as a multiple of what neighbouring squares mostly differ by
constexpr double kRoughest = 12.0;    // CIELAB units; on rougher surfaces lightness tells nothing
constexpr int kLightnessCycles = 6;   // in which lightness counts in full
constexpr int kFragmentations = 2;    // per frame
constexpr int kRegroupCycles = 8;     // after each

}  // namespace

void Tracker::track(const std::uint8_t* bgr, int width, int height, std::span<const int> source) {
    see(bgr, width, height, frames_ == 0 || literal());
    cycles_ = 0;
    begin_ = std::chrono::steady_clock::now();
    polygons_limited_ = time_limited_ = false;
    for (Vertex& v : mesh_.vertices) v.fresh = false;
    for (Edge& e : mesh_.edges) e.settled = false;
    if (frames_ == 0)
        start();
    else
        follow(source);
    finish();
    ++frames_;
}

void Tracker::displace(const std::vector<Displacement>& displacements) {
    displace_pixels(known_off_, mesh_, labels_, displacements);
    displace_regions(mesh_, crossings_, displacements);
    crossings_.face_of_pixels(mesh_, labels_);
}

void Tracker::see(const std::uint8_t* bgr, int width, int height, bool every_pixel) {
    image_.load(bgr, width, height, every_pixel ? 1 : kTrackMeanRows, every_pixel ? 1 : kTrackMeanColumns);
    means_version_ = disparity_version_ = kNone;
}

void Tracker::start() {
    mesh_.make_grid(image_.width(), image_.height(), config_.square_px);
    crossings_.build(mesh_);
    update_means();
    if (!literal()) find_outlines_in_lightness();
    merge();
    deform(config_.start_reach_px, config_.start_cycles, false);
    if (literal()) return;
    for (int k = 0; k < kFragmentations; ++k) {
        const int before = cycles_;
        cut_out_news();
        if (cycles_ == before) break;
    }
}

// Squares of one hue would merge across an outline in lightness before there is an edge on it. So lightness counts
// in full at first; then what only shading keeps apart merges after all.
void Tracker::find_outlines_in_lightness() {
    const double rough = kRoughness * typical_difference(mesh_, lightness_gain());
    if (rough > kRoughest * Image::kUnitsPerLab) return;
    sharp_jump_ = std::max(kSharpJump * Image::kUnitsPerLab, rough);
    lightness_in_full_ = true;
    merge();
    deform(config_.start_reach_px, kLightnessCycles, false);
    lightness_in_full_ = false;
}

void Tracker::follow(std::span<const int> source) {
    if (!source.empty()) labels_ = turn_labels(mesh_, labels_, source, config_.square_px);
    grouping_.expect(mesh_, labels_);
    if (!source.empty()) {
        known_off_.turn(source);
        vectorise(mesh_, crossings_, labels_);
        split();
        update_means();
        merge();
    } else if (!literal() && config_.refresh_frames > 0 && frames_ % config_.refresh_frames == 0) {
        // Deletion wears corners off small outlines; their own raster brings the vertices back.
        vectorise(mesh_, crossings_, labels_);
    }
    // In the first cycle faces keep the last frame's means: under the old net, the new ones are mixtures.
    deform(config_.track_reach_px, config_.track_cycles, !literal());
    if (literal())
        fragment();
    else
        cut_out_news();
}

void Tracker::finish() {
    merge();
    if (split() > 0) merge();
    update_means();
    if (mesh_.compact_faces()) crossings_.build(mesh_);
    crossings_.face_of_pixels(mesh_, labels_);
    const double units = Image::kUnitsPerLab;
    // In the paper every polygon is a region.
    const RegionRule rule{literal() ? 0.0 : config_.group_step * units, literal() ? 0.0 : config_.keep_step * units,
                          kOffGate * eta(), config_.min_area_px, sharp_jump_};
    const std::vector<float> jumps =
        sharp_jump_ > 0 ? measure_jumps(mesh_, crossings_, image_, kAnyDistance, lightness_gain()) : std::vector<float>{};
    regions_ = grouping_.update(mesh_, image_, labels_, jumps, rule);
}

void Tracker::deform(int reach_px, int most_cycles, bool keep_means) {
    double best = 1e300;
    int waiting = 0;
    int steady_cycles = 0;  // with the same edges and hardly changing means
    bool coarse = !literal();
    sure_ = mesh_;
    if (coarse) crossings_.build(mesh_, kCoarseStep);
    for (int cycle = 0; cycle < most_cycles; ++cycle) {
        ++cycles_;
        if (cycle > 0 || !keep_means) update_means();
        const Which which = steady_cycles++ < kFullScans ? Which::kAllEdges : Which::kMovedEdges;
        const std::vector<Disparity>& d = disparity(reach_px, which);
        const double total = total_disparity(d);
        waiting = total < kProgress * best ? 0 : waiting + 1;
        best = std::min(best, total);

        if (literal())
            move_by_forces(mesh_, d);
        else
            move_vertices(mesh_, d, reach_px, cycle < kFullGainCycles ? 1.0 : kLateGain);
        settle_moves(mesh_, crossings_);
        double longest = 0;
        for (const Vertex& v : mesh_.vertices) longest = std::max(longest, v.moved);

        const bool quiet = longest < (literal() ? kLiteralQuiet : kQuiet);
        const bool stuck = waiting >= kPatience || (!quiet && out_of_time());
        if (quiet || stuck || cycle % kMaintenancePeriod == kMaintenancePeriod - 1) {
            if (coarse) list_all_lines();
            coarse = false;
            const int changes = maintain(reach_px);
            steady_cycles = 0;
            if (stuck || (quiet && changes == 0)) break;
        }
    }
    if (coarse) list_all_lines();
}

// Fewer lines may miss a polygon that slipped whole between two of them; then the net goes back to where all of
// them were looked at.
void Tracker::list_all_lines() {
    crossings_.build(mesh_);
    if (find_faults(mesh_, crossings_).empty()) return;
    mesh_ = sure_;
    crossings_.build(mesh_);
}

int Tracker::maintain(int reach_px) {
    update_means();
    int changes = merge();
    saved_ = mesh_;
    const auto apply = [&](const Operation& operation) { return transact(mesh_, crossings_, saved_, operation); };
    const std::vector<Disparity>& d = disparity(reach_px, Which::kAllEdges);
    const std::int64_t first_new = mesh_.next_vertex_id;
    apply([&](Mesh& mesh, const Spared& spared) { return insert_vertices(mesh, d, spared); });
    // A flat vertex more or less asks for no further cycle: insertion and deletion undo each other for ever.
    apply(delete_vertices);
    changes += static_cast<int>(std::count_if(mesh_.vertices.begin(), mesh_.vertices.end(),
                                              [&](const Vertex& v) { return v.id >= first_new; }));
    changes += apply(zip_thorns);
    if (!literal()) {
        changes += apply(snap_contacts);
        changes += apply(snap_to_border);
    }
    const int pieces = split();
    if (pieces > 0) changes += pieces + merge();
    return changes;
}

int Tracker::split() {
    const int pieces = split_faces(mesh_);
    if (pieces > 0) {
        crossings_.build(mesh_, crossings_.step());
        update_means();
    }
    return pieces;
}

int Tracker::merge() {
    MergeRule rule{eta(), config_.min_area_px, literal() ? 0.0 : config_.min_width_px, 1.0, sharp_jump_};
    std::vector<float> jumps;
    if (lightness_in_full_) {
        rule.eta = sharp_jump_;
        rule.lightness_gain = lightness_gain();
    } else if (sharp_jump_ > 0) {
        jumps = measure_jumps(mesh_, crossings_, image_, eta(), lightness_gain());
    }
    const int merged = merge_faces(mesh_, rule, jumps);
    if (merged > 0) {
        crossings_.build(mesh_, crossings_.step());
        update_means();
    }
    const int to_fit = config_.max_polygons > 0 ? merge_to_fit(mesh_, config_.max_polygons) : 0;
    if (to_fit > 0) {
        polygons_limited_ = true;
        crossings_.build(mesh_, crossings_.step());
        update_means();
    }
    return merged + to_fit;
}

bool Tracker::out_of_time() {
    if (config_.max_ms <= 0) return false;
    const std::chrono::duration<double, std::milli> spent = std::chrono::steady_clock::now() - begin_;
    time_limited_ = time_limited_ || spent.count() >= config_.max_ms;
    return time_limited_;
}

void Tracker::update_means() {
    if (means_version_ == crossings_.version()) return;
    means_version_ = crossings_.version();
    disparity_version_ = kNone;
    const std::vector<ColourSum> sums = crossings_.face_sums(mesh_, image_);
    for (std::size_t k = 0; k < mesh_.faces.size(); ++k) {
        mesh_.faces[k].sum = sums[k];
        if (sums[k].count > 0) mesh_.faces[k].mean = sums[k].mean();
    }
}

// Fragmentation (section 3): what does not fit its polygon becomes small squares, and the deformation regroups them.
void Tracker::cut_out_news() {
    if (out_of_time()) return;
    update_means();
    const PixelSet off = off_pixels(mesh_, crossings_, image_, kOffGate * eta());
    const std::vector<int> news = known_off_.take_news(off, kNewsShare * config_.min_area_px, config_.min_area_px);
    if (news.empty()) return;
    crossings_.face_of_pixels(mesh_, labels_);
    if (fragment_faces(mesh_, labels_, news, config_.square_px) > 0) regroup();
}

void Tracker::fragment() {
    if (out_of_time()) return;
    update_means();
    crossings_.face_of_pixels(mesh_, labels_);
    if (fragment_ill_filled(mesh_, labels_, image_, eta(), config_.min_area_px, config_.square_px) > 0) regroup();
}

// The net anew from labels that have just been cut into pieces.
void Tracker::regroup() {
    vectorise(mesh_, crossings_, labels_);
    split();
    update_means();
    merge();
    deform(config_.start_reach_px, kRegroupCycles, false);
}

const std::vector<Disparity>& Tracker::disparity(int reach_px, Which which) {
    if (disparity_version_ != crossings_.version() || disparity_reach_px_ != reach_px) {
        if (literal()) {
            crossings_.face_of_pixels(mesh_, labels_);
            disparity_ = measure_literal_disparity(mesh_, labels_, image_, eta(), reach_px);
        } else {
            const auto eta_units = static_cast<float>(eta());
            measure_disparity(mesh_, crossings_, image_, {eta_units * eta_units}, reach_px, which, disparity_);
        }
        disparity_version_ = crossings_.version();
        disparity_reach_px_ = reach_px;
    }
    return disparity_;
}

}  // namespace rbdn
