// Robust least squares of all regions' inverse depths and all cameras' pitch, yaw and travel at once.
//
// Over a region 1/Z = rho + slope . (x - middle). Residuals are linear in what is sought about the place
// where they were taken. A sample's own position along its normal is an unknown of its own, with the
// present frame's measurement as one more observation, and is eliminated: its weighted mean over all
// frames is taken off residuals and derivatives. Regions meet in the cameras' unknowns alone, so they are
// eliminated one by one (Schur) and the cameras' small system is solved densely. What odometry says of the
// cameras enters as a prior.
#pragma once

#include <array>
#include <vector>

#include "comparison.hpp"
#include "samples.hpp"

namespace depth {

struct RegionState {
    double rho = 0.0;  // 1/cm at the region's middle
    Vec2 slope;        // per px
    double at(Vec2 offset) const { return rho + dot(slope, offset); }
};

struct FitSettings {
    double noise_px = 0.12;   // an outline is never taken to be better than this
    double gate_px = 2.5;     // residuals beyond are not used
    double correlation = 1.0; // of neighbouring samples: their variance is so much larger
    double coherent = 0.0;    // share of their variance that whole outlines have in common
};

// What odometry says of the cameras: the present one first, then the earlier ones in their order.
struct MotionPrior {
    std::array<std::vector<double>, 2> turn_precision;  // (C, C) each, of pitch and of yaw
    std::vector<double> travel_precision;  // (C, C)
    std::vector<double> travel_mean_cm;    // (C,)
    std::array<double, 2> turn_mean{};     // pitch and yaw of the oldest: no picture shows what all share
};

struct RegionFit {
    RegionState level;       // with no slope
    RegionState tilted;
    double level_variance = 0.0;   // of rho, in 1/cm^2, all unknowns of the cameras included
    std::array<double, 9> tilted_covariance{};  // of rho and slope, likewise
    double scale_px = 0.0;   // of the residuals
    double found = 0.0;      // share of its own samples found again, over all frames
    double found_px = 0.0;   // own outline found in some frame
    double shift_px = 0.0;   // typical motion over the image
    double gain = 0.0;       // px per unit of rho, rms
    Vec2 centre;             // of the outline it comes from, px from the region's middle
    std::vector<double> share;  // of what is known that comes from each frame
};

class JointFit {
  public:
    JointFit(const Samples& samples, std::size_t regions, std::size_t frames);

    // From now on only the samples of these regions are looked at and fitted; the others stay as they are.
    void attend(const std::vector<char>& regions);

    // Looks at every sample that counts where `state` puts it, with the cameras' derivatives or without.
    void look(const Comparison& comparison, const std::vector<RegionState>& state, const std::vector<double>& own,
              bool cameras);

    // One robust step from the last look: moves `state`, and with `cameras` also the cameras' corrections
    // (pitch, yaw, travel of each).
    //
    // own: how much each row counts, 0..1
    // tilt: standard error of a region's slope over its rho before looking, per px
    void step(const std::vector<double>& own, double tilt, const FitSettings& settings,
              const MotionPrior& prior, std::vector<RegionState>& state,
              std::vector<std::array<double, 3>>* cameras);

    // Mean truncated cost of every row, 0..1, after the last step.
    std::vector<double> costs(const FitSettings& settings) const;

    std::vector<RegionFit> regions(const std::vector<double>& own, const std::vector<RegionState>& state) const;

    // Share of all samples found again in each earlier frame, by the weights of the last step.
    std::vector<double> found() const;

    // Share of the residuals' variance that all samples of one boundary have in common in one frame, after the
    // last step, beyond what neighbours have.
    double coherent(const FitSettings& settings) const;

    // What the own outline within `reach_px` of a place, px from the region's middle, says of the inverse depth
    // there beyond the region's fit: its difference, and how sure it is (1 / variance).
    struct Nearby {
        double difference = 0.0, precision = 0.0;
    };
    Nearby nearby(std::size_t region, Vec2 place, double reach_px, const FitSettings& settings) const;

    // (C, C, 3, 3) flattened: covariance of the cameras' corrections after the last step.
    const std::vector<double>& camera_covariance() const { return motion_covariance_; }

  private:
    struct Block {
        std::array<double, 9> a{};   // of rho and slope
        std::array<double, 3> level{};  // its first row before anything is expected of slopes
        std::vector<double> b;       // (3, M): with the cameras
        std::array<double, 3> g{};   // gradient
        double alike = 1.0;          // by which the variance grows because whole outlines err alike
    };
    std::size_t row_of(std::size_t n, std::size_t k) const { return n * frames_ + k; }

    const Samples* samples_;
    std::vector<std::vector<std::size_t>> rows_of_;  // by region
    std::vector<std::size_t> attended_;              // rows, in order
    std::size_t regions_, frames_;
    std::vector<Look> looks_;      // [row][frame]
    std::vector<double> weight_;   // likewise
    std::vector<double> common_, trust_, total_, rho_;
    std::vector<double> scale_;    // of each region's residuals, px
    std::vector<Block> blocks_;
    std::vector<double> motion_covariance_;
};

}  // namespace depth
