// Where the foot of a thing is seen, one picture after the other, and whether it moves.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>

namespace nav {

// A point of the floor, a way or a direction there.
struct FloorPoint {
    double x_cm, z_cm;
};

// Where the foot of a thing stands at one time.
struct FootSight {
    double t_s;
    std::optional<FloorPoint> left, right;  // its ends; none where they are not its own
    double depth_cm;
    double sigma_cm;  // along the view
    FloorPoint ray;        // unit vector from the camera to it
};

// The feet of all columns of a picture, and where it was taken.
struct SeenFeet {
    std::span<const std::int64_t> owners;
    const double *slopes, *depth_cm;
    const bool* cut;
    const double* across;  // x/z
    double height_cm;
    FloorPoint eye, ahead;
};

// Of a region; none where its foot does not tell where it stands.
//
// cut_part: of its feet may be below the picture; sigma_ray: of the slope of the ray to a foot.
std::optional<FootSight> sight_of(const SeenFeet& feet, std::int64_t region, double cut_part, double sigma_ray,
                                  double t_s);

// The sights of one thing of the last while.
class Track {
  public:
    void see(const FootSight& now);
    double newest_s() const { return seen_.back().t_s; }

    // Of a thing whose edges move evenly and alike, cm/s; none where nothing surely moves.
    //
    // One edge is enough of what is known to move, or goes far; of a wall that is seen in part one edge wanders.
    std::optional<FloorPoint> velocity(bool known) const;

    // Whether it has not moved for a while, as far as its foot can tell.
    bool stands() const;

  private:
    std::deque<FootSight> seen_;
};

}  // namespace nav
