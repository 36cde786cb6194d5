// The camera's own motion: what odometry is worth, learnt from how well it explains the images.
//
// Pitch, yaw and travel of every frame are solved together with the depths (joint_fit); here is what is
// expected of them before that: how far they may be from odometry, and where to begin looking.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "frame_view.hpp"
#include "joint_fit.hpp"
#include "path.hpp"
#include "vertex.hpp"

namespace depth {

// How far odometry was off between an earlier frame and the present one.
struct Correction {
    double since_s = 0.0;  // time of the earlier one
    double yaw_rad = 0.0, yaw_sigma_rad = 0.0;
    double travel_cm = 0.0, travel_sigma_cm = 0.0;
};

class EgoMotion {
  public:
    explicit EgoMotion(const Camera& camera) : camera_(camera) {}

    // A turn since the last frame that odometry did not see.
    struct Jerk {
        double pitch_rad, yaw_rad;
    };

    // Begins the present frame with the corrections of the last one, and says whether the vertices seen in
    // both moved as if the camera had jerked on top.
    std::optional<Jerk> guess(const FrameView& frame, const VertexDepths& last_depths, Path& path, int present) const;

    // The jerk is real: writes it into the path. One tells at once how much of the kind must be expected.
    void believe(const Jerk& jerk, Path& path, int present);

    // What is expected of the cameras of some frames, the present one first.
    MotionPrior prior(const Path& path, const std::vector<int>& frames) const;

    // Takes in what was solved, writes it into the path, and learns from it how good odometry is.
    //
    // covariance: (3 C, 3 C) of pitch, yaw and travel
    void learn(Path& path, const std::vector<int>& frames, const std::vector<std::array<double, 3>>& cameras,
               const std::vector<double>& covariance);

    // Corrections of the present frame, the first of `frames`, against each of the others: as they were solved,
    // or as they are without any picture of now where the covariance (as for `learn`) is empty. A way that went
    // elsewhere than the heading has it looks like a turn, the more the nearer what is seen is: `rho`, 1/cm.
    std::vector<Correction> corrections(const Path& path, const std::vector<int>& frames,
                                        const std::vector<double>& covariance, double rho) const;

    // Relative standard error of all lengths, from the readings of the travelled distance.
    double scale_sigma() const { return scale_sigma_; }

    // Remembers the frame for the next guess.
    void remember(const FrameView& frame, int present);

  private:
    // A reading of the travelled distance and what it was taken for.
    struct Reading {
        int frame;
        double read_cm, solved_cm;
    };
    void learn_travel(const Path& path, const std::vector<int>& frames,
                      const std::vector<std::array<double, 3>>& cameras, const std::vector<double>& covariance);
    void learn_heading(Path& path, int present, double sigma_rad);
    void rescale(Path& path, int present);

    Camera camera_;
    int last_ = -1;
    std::vector<std::int64_t> last_ids_;
    std::vector<Vec2> last_px_;
    // variance of odometry's errors in units of what the path takes them for, and how much is behind it
    double pitch_excess_ = 1.0, turn_excess_ = 1.0, travel_excess_ = 1.0;
    // variances, rad^2, of the heading's error that the path has and of the camera's shaking
    double heading_variance_ = 0.0, shaking_ = 0.0;
    int learnt_ = -1;  // the frame that heading was learnt from last
    double learnt_pitch_ = 0.0, learnt_variance_ = 0.0;
    std::vector<Reading> readings_;
    double quantum_cm_ = 0.0;  // odometry comes in steps of this; 0 where it does not
    double scale_sigma_ = 0.0;
};

}  // namespace depth
