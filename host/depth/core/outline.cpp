#include "outline.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <unordered_map>

#include "ownership.hpp"
#include "polygon.hpp"
#include "relief.hpp"
#include "robust.hpp"

namespace depth {

namespace {

constexpr int REMEMBERED_FRAMES = 60;   // that a region may be away
constexpr double GATES_PX[] = {5.0, 3.5, 2.5, 2.5, 2.0, 1.5};  // residuals beyond are not used; shrinks as the fit settles
// Every second round solves the cameras too, the last one among them.
constexpr std::size_t SETTLED_FROM = 2;  // the round where depths known from before begin
constexpr std::size_t OWNERS_FROM = 3;   // from which on outlines count for their owners only
constexpr double MIN_OWN_PX = 20.0;    // of outline that is the region's own
constexpr double MIN_OUTLINE_SHARE = 0.25; // of its outline within the image
constexpr double MIN_FOUND = 0.2;      // of its own outline over all kept frames
constexpr double NOTHING_FOUND = 0.05; // of the outline, in a keyframe that shows another part of the world
constexpr double MIN_CONTRAST = 0.15;  // of a wrong depth's cost above the best
constexpr double MIN_RIVAL = 0.05;     // of another dip's cost above the best
constexpr double MIN_SHIFT_PX = 0.3;   // by which the outline must have moved over the image
constexpr double WHOLE_SHARE = 0.9;    // of its outline that must be its own for the shape to say something
constexpr double CUT_CHI2 = 12.0;      // a slope of a cut region is believed when so far from zero
constexpr double FACE_CHI2 = 20.0;     // and of a whole face, which a box with a side face may look like
constexpr double FACE_SLANT = 0.45;    // tangent of the slant from which a whole face is slanted
constexpr double PLANE_TILT = 0.25;     // prior: relative change of depth over half a width, in widths over depth
constexpr double COHERENT = 0.3;        // share of the residuals' scale by which a whole outline errs alike
constexpr double COHERENT_HIDDEN = 3.0; // times what shows of it after the fit, which takes up the rest as depth and motion
constexpr double COHERENT_GAIN = 0.1;   // of what one frame says of what shows
constexpr double LOST_SHARE = 0.06;     // relative error of a depth whose outline is hardly found again
constexpr double BEYOND_SLANT = 1.2;    // tangent of the slant that what is cut may have beyond its outline
constexpr double CORNER_PX = 25.0;       // of outline either way that shows the depth of a corner
constexpr double UNEVEN_SHARE = 0.04;    // where the region is no single face, whose outline is in one plane
constexpr double CORNER_SHARE = 0.08;    // by which a corner lies before or behind the rest of the outline
constexpr double JERK_BETTER = 0.03;  // mean cost by which a jerk must explain the outlines better
constexpr int LOOK_AGAIN_FRAMES = 5;     // after which a region's depth is looked for anew among all depths,
constexpr double LOOK_AGAIN_REACH = 1.2; // or when the longest way has grown so much: a wrong one would keep itself

std::string percent(const char* text, double share) {
    char out[64];
    std::snprintf(out, sizeof out, "%s (%.0f %%)", text, 100 * share);
    return out;
}

}  // namespace

// What the region looks like and how much of its outline is its own.
struct OutlineMethod::Shape {
    double length_px = 0.0;  // outline between regions
    double own = 0.0;        // share of it that is the region's own
    Vec2 middle;
    double baseline_cm = 0.0;   // rms way from the frames its depth comes from
    double travel_sigma = 0.0;  // relative error of the ways its depth comes from, beyond what is solved
};

OutlineMethod::OutlineMethod(const Camera& camera, const OutlineConfig& config) : camera_(camera), config_(config) {}

std::vector<OutlineAnswer> OutlineMethod::update(const FrameView& frame, Path& path, int present, EgoMotion& ego,
                                                 const std::optional<EgoMotion::Jerk>& jerk,
                                                 const std::vector<double>& expected) {
    corners_.assign(frame.vertex_ids.size(), {});
    std::vector<OutlineAnswer> out = answers(frame, path, present, ego, jerk, expected);
    if (keyframes_.empty() || path.distance_cm(keyframes_.back().frame, present) >= config_.min_step_cm) {
        Keyframe now;
        if (keyframes_.size() == config_.keyframes) {
            std::vector<int> kept;
            for (const Keyframe& k : keyframes_) kept.push_back(k.frame);
            // one that shows nothing of what is seen now is missed least of all
            std::size_t least = 0;
            for (std::size_t k = 1; k + 1 < keyframes_.size(); ++k)
                if (keyframes_[k].found < keyframes_[least].found) least = k;
            const auto gone = static_cast<std::ptrdiff_t>(
                keyframes_[least].found < NOTHING_FOUND ? least : most_redundant(path, kept, present));
            now = std::move(keyframes_[static_cast<std::size_t>(gone)]);  // its memory is used again
            keyframes_.erase(keyframes_.begin() + gone);
        }
        now.frame = present;
        now.map.file(frame, camera_, config_.border_px);
        now.faces = faces_of(frame);
        now.found = 1.0;
        keyframes_.push_back(std::move(now));
    }
    return out;
}

std::set<int> OutlineMethod::frames() const {
    std::set<int> out;
    for (const Keyframe& k : keyframes_) out.insert(k.frame);
    return out;
}

std::vector<OutlineAnswer> OutlineMethod::answers(const FrameView& frame, Path& path, int present, EgoMotion& ego,
                                                  const std::optional<EgoMotion::Jerk>& jerk,
                                                  const std::vector<double>& expected) {
    const std::size_t n = frame.regions.size();
    const auto none = [&](const char* why) {
        OutlineAnswer all;
        all.surface = decline(why);
        return std::vector<OutlineAnswer>(n, all);
    };
    double reach_cm = 0;  // the longest way to an earlier frame
    std::vector<const Keyframe*> then;
    std::vector<int> frames{present};
    for (const Keyframe& k : keyframes_) {
        reach_cm = std::max(reach_cm, path.distance_cm(k.frame, present));
        then.push_back(&k), frames.push_back(k.frame);
    }
    corrections_ = ego.corrections(path, frames, {}, 0.0);
    if (reach_cm < config_.min_step_cm) return none("no motion yet");
    std::vector<Vec2> middle;
    std::vector<Extent> extents;
    for (const RegionView& r : frame.regions) {
        middle.push_back(polygon_moments(r.loops).centre);
        extents.push_back({outline_length(r.loops), r.touches_border});
    }
    const Samples samples = pick_samples(frame, camera_, middle, config_.border_px, config_.spacing_px, config_.most_points);
    if (samples.rows.empty()) return none("no outline to measure");
    Comparison comparison(camera_, then, faces_of(frame), samples);

    // where to begin
    std::vector<char> wanted(n, 0);
    for (std::size_t r = 0; r < n; ++r) {
        const auto it = clarity_.find(frame.regions[r].id);
        wanted[r] = jerk || !(expected[r] > 0) || it == clarity_.end() ||
                    present - it->second.frame >= LOOK_AGAIN_FRAMES || reach_cm > LOOK_AGAIN_REACH * it->second.reach_cm;
    }
    const auto look_for = [&] {
        comparison.place(path, present);
        return best_trials(comparison, samples, n, wanted, config_.nearest_cm, config_.farthest_cm);
    };
    std::vector<Start> start = look_for();
    if (jerk) {
        const Station before = path.at(present);
        path.at(present).pitch_rad += jerk->pitch_rad, path.at(present).yaw_rad += jerk->yaw_rad;
        std::vector<Start> jerked = look_for();
        path.at(present) = before;
        if (mean_cost(jerked, samples) < mean_cost(start, samples) - JERK_BETTER) {
            ego.believe(*jerk, path, present);
            start = std::move(jerked);
        }
        comparison.place(path, present);
    }
    std::vector<RegionState> state(n);
    std::vector<char> clear(n), sought(n);  // some depth fits its outline better than others; and that is to be found
    for (std::size_t r = 0; r < n; ++r) {
        const std::int64_t id = frame.regions[r].id;
        if (wanted[r]) {
            clarity_[id] = {present, reach_cm, start[r].contrast, start[r].rival};
        } else {
            start[r] = {expected[r], 0.0, clarity_[id].contrast, clarity_[id].rival};
        }
        state[r].rho = std::max(start[r].rho, 1e-6);
        clear[r] = start[r].contrast >= MIN_CONTRAST, sought[r] = clear[r] && wanted[r];
    }
    for (const std::int64_t id : frame.changed) whole_.erase(id);  // it is no longer the thing it was
    std::erase_if(whole_, [&](const auto& w) { return present - w.second.frame > REMEMBERED_FRAMES; });
    if (clarity_.size() > 4 * n + 64) std::erase_if(clarity_, [&](const auto& c) { return present - c.second.frame > 60; });

    // depths and cameras together
    const MotionPrior prior = ego.prior(path, frames);
    std::vector<std::array<double, 3>> cameras;
    for (const int f : frames) {
        const Station& s = path.at(f);
        cameras.push_back({s.pitch_rad, s.yaw_rad, s.travel_cm});
    }
    const auto place = [&] {
        for (std::size_t c = 0; c < frames.size(); ++c) {
            Station& s = path.at(frames[c]);
            s.pitch_rad = cameras[c][0], s.yaw_rad = cameras[c][1], s.travel_cm = cameras[c][2];
        }
        comparison.place(path, present);
    };
    std::vector<double> own(samples.rows.size(), 1.0);
    for (std::size_t i = 0; i < own.size(); ++i)
        if (!clear[static_cast<std::size_t>(samples.rows[i].region)]) own[i] = 0.0;
    const std::vector<double> told = own;
    const double tilt = PLANE_TILT * 2 / camera_.focal();  // over rho, per px: the width cancels
    JointFit fit(samples, n, then.size());
    fit.attend(clear);
    FitSettings settings;
    settings.noise_px = config_.noise_px;
    settings.correlation = std::max(1.0, config_.correlation_px / samples.spacing_px);
    settings.coherent = COHERENT_HIDDEN * coherent_;
    // what is known from the last frame need not be caught from afar
    const bool fresh = std::any_of(sought.begin(), sought.end(), [](char s) { return s != 0; });
    for (std::size_t round = fresh ? 0 : SETTLED_FROM; round < std::size(GATES_PX); ++round) {
        if (round == 0) fit.attend(sought);
        if (round == 1) fit.attend(clear);
        settings.gate_px = GATES_PX[round];
        if (round >= OWNERS_FROM) {
            own = own_rows(samples, fit.costs(settings), state, extents);
            for (std::size_t i = 0; i < own.size(); ++i) own[i] *= told[i];
        }
        const bool cameras_too = round % 2 == 1;
        fit.look(comparison, state, own, cameras_too);
        fit.step(own, tilt, settings, prior, state, cameras_too ? &cameras : nullptr);
        if (cameras_too) place();
    }
    coherent_ += COHERENT_GAIN * (fit.coherent(settings) - coherent_);
    const std::vector<double> found = fit.found();
    for (std::size_t k = 0; k < found.size(); ++k) keyframes_[k].found = found[k];
    // at rest nothing new is learnt
    if (path.distance_cm(keyframes_.back().frame, present) >= config_.min_step_cm)
        ego.learn(path, frames, cameras, fit.camera_covariance());
    std::vector<double> rhos;
    for (const RegionState& s : state) rhos.push_back(s.rho);
    std::nth_element(rhos.begin(), rhos.begin() + static_cast<std::ptrdiff_t>(n / 2), rhos.end());
    corrections_ = ego.corrections(path, frames, fit.camera_covariance(), rhos[n / 2]);

    std::vector<Shape> shapes(n);
    for (std::size_t i = 0; i < samples.rows.size(); ++i) {
        Shape& s = shapes[static_cast<std::size_t>(samples.rows[i].region)];
        s.length_px += samples.rows[i].length_px, s.own += own[i] * samples.rows[i].length_px;
    }
    const std::vector<RegionFit> fits = fit.regions(own, state);
    std::vector<OutlineAnswer> out;
    for (std::size_t r = 0; r < n; ++r) {
        shapes[r].own /= std::max(shapes[r].length_px, 1e-9);
        shapes[r].middle = middle[r];
        double unsolved = square(ego.scale_sigma()), baseline = 0;
        for (std::size_t k = 0; k < then.size(); ++k) {
            const double way_cm = std::max(length(comparison.move(k).shift_cm), 1e-9);
            unsolved += fits[r].share[k] * 2 * square(path.place_sigma_cm() / way_cm);
            baseline += fits[r].share[k] * square(way_cm);
        }
        shapes[r].baseline_cm = std::sqrt(std::max(baseline, 1e-18));
        shapes[r].travel_sigma = std::sqrt(unsolved);
        out.push_back(answer(frame.regions[r], fits[r], start[r], shapes[r], present));
    }
    find_corners(frame, fit, settings, fits, out, middle);
    return out;
}

// A region's surface is expected to pass through its corners; the outline next to a corner may know better.
void OutlineMethod::find_corners(const FrameView& frame, const JointFit& fit, const FitSettings& settings,
                                 const std::vector<RegionFit>& fits, const std::vector<OutlineAnswer>& answers,
                                 const std::vector<Vec2>& middle) {
    std::unordered_map<std::int64_t, std::size_t> row;
    for (std::size_t i = 0; i < frame.vertex_ids.size(); ++i) row[frame.vertex_ids[i]] = i;
    std::vector<double> surest(frame.vertex_ids.size(), 0.0);
    for (std::size_t r = 0; r < frame.regions.size(); ++r) {
        if (!answers[r].surface.known()) continue;
        const bool flat = may_be_one_face(frame.regions[r].loops.front());
        for (const std::int64_t id : frame.regions[r].corners) {
            const auto it = row.find(id);
            if (it == row.end()) continue;
            const Vec2 place = frame.vertex_px[it->second] - middle[r];
            const JointFit::Nearby near = fit.nearby(r, place, CORNER_PX, settings);
            if (!(near.precision > surest[it->second])) continue;  // of the regions round it the one that knows most
            surest[it->second] = near.precision;
            const double here = std::max(fits[r].tilted.at(place), 0.5 * fits[r].tilted.rho);
            const double expected = answers[r].slanted ? here : fits[r].level.rho;
            const double hold = 1 / square(CORNER_SHARE * expected);
            Corner& corner = corners_[it->second];
            corner.rho = (near.precision * (here + near.difference) + hold * expected) / (near.precision + hold);
            const double coherent = COHERENT * fits[r].scale_px / fits[r].shift_px * corner.rho;
            const double uneven = flat ? 0.0 : UNEVEN_SHARE * corner.rho;
            corner.sigma_rho = std::sqrt(1 / (near.precision + hold) + fits[r].level_variance + square(coherent) +
                                         square(uneven) + square(answers[r].way_sigma * corner.rho));
        }
    }
}

OutlineAnswer OutlineMethod::answer(const RegionView& region, const RegionFit& fit, const Start& start,
                                    const Shape& shape, int present) {
    OutlineAnswer out;
    const auto no = [&](std::string why) {
        out.surface = decline(std::move(why));
        return out;
    };
    if (!(shape.length_px > 0)) return no("no outline to measure");
    out.own_share = shape.own;
    out.misfit_px = fit.scale_px;
    out.way_sigma = shape.travel_sigma;
    if (start.contrast < MIN_CONTRAST) {
        out.own_share = 1.0;
        return no("many depths fit its outline alike");
    }
    if (!(shape.own > 0)) return no("its outline belongs to nearer regions");
    if (fit.found_px < std::max(MIN_OWN_PX, MIN_OUTLINE_SHARE * shape.length_px) || fit.found < MIN_FOUND)
        return no("too little of its outline was found again");
    if (start.rival < MIN_RIVAL) return no("two depths fit its outline");
    if (fit.shift_px < MIN_SHIFT_PX) return no("too little motion for its distance");
    const bool cut = region.touches_border || shape.own < WHOLE_SHARE;
    const Vec2 slope = fit.tilted.slope;
    const std::array<double, 9>& v = fit.tilted_covariance;
    const double coherent = COHERENT * fit.scale_px / fit.shift_px;
    // a whole side that errs looks like a slant
    const double doubt = 1 + square(coherent * fit.level.rho) / fit.level_variance;
    const double det = (v[4] * v[8] - v[5] * v[5]) * doubt;
    const double chi2 = det > 0 ? (square(slope.x) * v[8] - 2 * slope.x * slope.y * v[5] + square(slope.y) * v[4]) / det : 0;
    const double slant = length(slope) * camera_.focal() / fit.tilted.rho;
    // what was seen whole and level does not slant because the border cuts it
    out.slanted = cut ? chi2 > CUT_CHI2 && !whole_.contains(region.id)
                      : chi2 > FACE_CHI2 && slant > FACE_SLANT && may_be_one_face(region.loops.front());
    const double width = std::sqrt(std::max(region.area_px, 1.0)) / camera_.focal();  // w / Z
    double noise, model = square(config_.model_share);
    Whole whole{};
    bool known_whole = false;
    if (out.slanted) {
        const double rho = fit.tilted.rho;
        out.slope = slope;
        out.silhouette_cm = mean_of_inverse(region.loops, rho - dot(slope, shape.middle), slope.x, slope.y);
        if (!(out.silhouette_cm > 0)) out.silhouette_cm = 1 / rho;
        out.surface.depth_cm = out.silhouette_cm;
        noise = v[0] / square(rho);
        // it might be no plane after all
        model += square(0.5 * (1 - fit.level.rho / rho)) + square(0.03 * width);
    } else {
        out.silhouette_cm = 1 / fit.level.rho;
        const Relief relief = relief_of(region.loops.front(), cut);
        whole = {present, relief.k * width * out.silhouette_cm, relief.sigma_k * width * out.silhouette_cm};
        if (const auto it = whole_.find(region.id); cut && it != whole_.end()) {
            whole = it->second;
            whole.frame = present;
            known_whole = true;
        }
        out.surface.depth_cm = out.silhouette_cm - whole.offset_cm;
        noise = fit.level_variance / square(fit.level.rho);
        model += square(whole.sigma_cm / out.silhouette_cm);
    }
    const double lost = LOST_SHARE * (1 - fit.found);
    // what is cut goes on beyond the outline that shows its depth
    const double beyond = cut ? BEYOND_SLANT * length(fit.centre) / camera_.focal() : 0.0;
    const double relative = std::sqrt(noise + model + square(beyond) + square(coherent) + square(lost) + square(shape.travel_sigma));
    if (!(relative < config_.max_relative_sigma) || !(out.surface.depth_cm > 0)) {
        out.silhouette_cm = 0.0, out.slanted = false;
        return no(percent("too uncertain", relative));
    }
    if (out.slanted && !cut) whole_.erase(region.id);
    if (!out.slanted && (!cut || known_whole)) whole_[region.id] = whole;
    out.surface.sigma_cm = relative * out.surface.depth_cm;
    out.surface.sensitivity = fit.shift_px / shape.baseline_cm;
    return out;
}

}  // namespace depth
