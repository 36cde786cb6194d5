// The frames of a run: where odometry says each was taken, what was solved on top of it, and how well
// the way from one to another is known.
#pragma once

#include <algorithm>
#include <cstddef>
#include <map>
#include <set>
#include <vector>

#include "space.hpp"

namespace depth {

// From the camera of one frame to that of another: X_there = turn X_here + shift_cm.
struct Move {
    Mat3 turn;
    Vec3 shift_cm;
    double travel_sigma_cm = 0.0;  // standard error of the length of the shift
    double turn_sigma_rad = 0.0;   // of the rotation, about any one axis
    double heading_sigma_rad = 0.0;  // of the direction of the shift
};

// How far odometry is to be trusted, per reading.
struct OdometryNoise {
    double travel_cm = 0.02;     // of one reading of the travelled distance
    double turn_rad = 1e-4;      // of the rotation from one frame to the next
    double turn_share = 0.01;    // of a rotation itself: calibration of lens and odometry
    double timing_s = 0.004;     // between a frame and its pose
    double tracked_cm = 1.0;     // of a reading of the place where the camera does not move as on wheels
};

// A frame's place on the path.
struct Station {
    Mat3 rotation;       // camera to world, as odometry has it
    Vec3 read_cm;        // position as odometry has it
    Vec3 position_cm;    // the same steps, each turned by what was known of the heading's error then
    double heading_rad = 0.0;  // of the robot, by which odometry is off: the way goes there, and not only the camera
    double heading_variance_rad2 = 0.0;  // of that
    double t_s = 0.0;
    double path_cm = 0.0;              // length of the path up to here
    double travel_variance_cm2 = 0.0;  // of the distance driven so far, grows along the path
    double reading_variance_cm2 = 0.0; // of this one reading, independent of the others
    double turn_variance_rad2 = 0.0;   // accumulated from frame to frame
    double told_variance_rad2 = 0.0;   // of the rotation since the last frame, as the pose says
    double timing_variance_rad2 = 0.0; // of this rotation, because the frame's time is not exactly the pose's
    Vec3 ahead;                        // unit direction of travel here, in the world
    // solved from the images
    double pitch_rad = 0.0, yaw_rad = 0.0, travel_cm = 0.0;
    // against the newest frame of that time; negative where nothing was solved
    double solved_turn_sigma_rad = -1.0, solved_travel_sigma_cm = -1.0;
};

class Path {
  public:
    explicit Path(const OdometryNoise& noise) : noise_(noise) {}

    // Takes in a frame's pose; frames count up. `travel_sigma_cm` of the distance since the run began,
    // `turn_sigma_rad` of the rotation since the last frame; both 0 where the pose does not say.
    void add(int frame, const Mat3& rotation, Vec3 position_cm, double t_s, double travel_sigma_cm,
             double turn_sigma_rad);

    // The way between two frames of the path, corrections included.
    Move move(int here, int there) const;

    Vec3 position_cm(int frame) const;  // corrections included
    Mat3 rotation(int frame) const;     // likewise
    double distance_cm(int a, int b) const;

    bool has(int frame) const { return stations_.contains(frame); }
    const Station& at(int frame) const { return stations_.at(frame); }
    Station& at(int frame) { return stations_.at(frame); }

    // The camera rolls or rises: it is carried, and its poses come from a tracker.
    bool tracked() const { return tracked_; }

    // Of one reading of the place beyond what is solved: what a tracker of a carried camera is worth.
    double place_sigma_cm() const { return tracked_ ? noise_.tracked_cm : 0.0; }

    // Of the direction of the way between two frames.
    double heading_variance(int a, int b) const {
        return std::max(at(a).heading_variance_rad2, at(b).heading_variance_rad2);
    }

    // Of all lengths at once, relative: where odometry comes in steps.
    void set_scale_sigma(double relative) { scale_sigma_ = relative; }

    // Of one rotation, whatever else is known.
    double least_turn_variance() const { return noise_.turn_rad * noise_.turn_rad; }

    // Drops every frame but these and the newest.
    void keep(const std::set<int>& frames);

  private:
    bool as_on_wheels(const Station& last, const Station& now) const;

    OdometryNoise noise_;
    bool tracked_ = false;
    double scale_sigma_ = 0.0;
    std::map<int, Station> stations_;
};

// Which of the kept frames, oldest first and at least three, is missed least. Gaps are judged against
// their distance from the present, so that what remains is spread evenly in the logarithm of the
// baseline: near frames for near things, far frames for far ones.
std::size_t most_redundant(const Path& path, const std::vector<int>& frames, int present);

}  // namespace depth
