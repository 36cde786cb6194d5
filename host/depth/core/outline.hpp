// Depth from the motion of whole outlines: the main method.
//
// The present outline, carried into earlier frames by the camera's motion and a trial inverse depth, is
// compared with the outlines found there, along the normal only. Vertices (Eq. 7-13) are its case of
// single points, area (Eq. 14-18) its case of uniform growth. All regions' depths and the cameras' own
// errors are solved together; where the outline supports it, 1/Z = a + b x + c y over the image, which is
// exact for slanted planes.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <vector>

#include "answer.hpp"
#include "comparison.hpp"
#include "ego_motion.hpp"
#include "frame_view.hpp"
#include "joint_fit.hpp"
#include "path.hpp"
#include "trials.hpp"

namespace depth {

struct OutlineConfig {
    std::size_t keyframes = 6;     // earlier frames the present outline is compared with
    double spacing_px = 3.5;       // between samples of the present outline
    std::size_t most_points = 700; // of them
    double border_px = 3.0;        // samples nearer to the image border are not used
    double noise_px = 0.12;        // an outline is never taken to be better than this
    double correlation_px = 8.0;   // neighbouring samples err alike over such a length
    double model_share = 0.003;    // model error even on a flat frontal thing
    double nearest_cm = 12.0;      // depths looked for, from
    double farthest_cm = 2500.0;   // and to
    double min_step_cm = 0.3;      // a frame nearer than this to the last one kept is not kept
    double max_relative_sigma = 0.3;
};

struct OutlineAnswer {
    Answer surface;             // mean over the visible surface; sensitivity in px of outline for one cm
    double silhouette_cm = 0.0; // where the outline itself is; 0 where there is no answer
    bool slanted = false;
    Vec2 slope;                 // d(1/Z) per px, where the outline shows a slant
    double way_sigma = 0.0;     // relative error of the ways it comes from, beyond what is solved
    double misfit_px = 0.0;     // scale of what no depth explains; 0 where nothing could be compared
    double own_share = 1.0;     // of its outline that is not the outline of something nearer
};

// Depth of a vertex of the net from the outlines that meet in it.
struct Corner {
    double rho = 0.0;        // 1/cm; 0 where no outline there has a depth of its own
    double sigma_rho = 0.0;
};

class OutlineMethod {
  public:
    OutlineMethod(const Camera& camera, const OutlineConfig& config);

    // Depths of the regions of `frame`, row by row; solves the cameras' corrections on the way.
    //
    // jerk: what the vertices suspect the camera did
    // expected: inverse depths where they are known from before, else 0
    std::vector<OutlineAnswer> update(const FrameView& frame, Path& path, int present, EgoMotion& ego,
                                      const std::optional<EgoMotion::Jerk>& jerk, const std::vector<double>& expected);

    // Of the vertices of the frame that `update` was given last, row by row.
    const std::vector<Corner>& corners() const { return corners_; }

    // Against each earlier frame that the last one was compared with, oldest first.
    const std::vector<Correction>& corrections() const { return corrections_; }

    // Frames that the path must keep.
    std::set<int> frames() const;

  private:
    struct Clarity {  // how clear a region's depth was among others when last looked for
        int frame;
        double reach_cm;  // the longest way to an earlier frame then
        double contrast, rival;
    };
    struct Whole {  // by how much a region's surface stood before its outline when last seen whole
        int frame;
        double offset_cm, sigma_cm;
    };
    struct Shape;

    std::vector<OutlineAnswer> answers(const FrameView& frame, Path& path, int present, EgoMotion& ego,
                                       const std::optional<EgoMotion::Jerk>& jerk, const std::vector<double>& expected);
    void find_corners(const FrameView& frame, const JointFit& fit, const FitSettings& settings,
                      const std::vector<RegionFit>& fits, const std::vector<OutlineAnswer>& answers,
                      const std::vector<Vec2>& middle);
    OutlineAnswer answer(const RegionView& region, const RegionFit& fit, const Start& start, const Shape& shape,
                         int present);

    Camera camera_;
    OutlineConfig config_;
    std::vector<Keyframe> keyframes_;  // oldest first
    std::vector<Corner> corners_;
    std::vector<Correction> corrections_;
    double coherent_ = 0.0;  // share of the residuals' variance that whole outlines have in common
    std::map<std::int64_t, Clarity> clarity_;
    std::map<std::int64_t, Whole> whole_;
};

}  // namespace depth
