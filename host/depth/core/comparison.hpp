// The present outline, moved to a trial depth, against the outlines of earlier frames.
//
// With R, t the way from the present camera to an earlier one, p the ray of a sample and rho its inverse
// depth, the earlier camera sees it towards a = R p + rho t. The residual is the distance along the normal
// from there to the outline that was found; pitch and yaw of both cameras and their travel enter it as
//
//     da = R (w x p) + rho R_k' u d   for the present camera turned by w and moved by d along u,
//     da = -v x a - rho R_k' u_k d_k  for the earlier one.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "contour_map.hpp"
#include "frame_view.hpp"
#include "path.hpp"
#include "samples.hpp"

namespace depth {

// What is known of a region beside its outline.
struct Face {
    std::int64_t id;
    Vec3 rgb;
};

std::vector<Face> faces_of(const FrameView& frame);

struct Keyframe {
    int frame = 0;
    ContourMap map;
    std::vector<Face> faces;
    double found = 1.0;  // share of the outline of now that was found again in it last
};

// One sample in one earlier frame. Derivatives in px.
struct Look {
    double residual = 0.0;             // px along the normal
    double gain = 0.0;                 // by rho, px cm
    std::array<double, 3> here{};      // by pitch, yaw (rad) and travel (cm) of the present camera
    std::array<double, 3> there{};     // of the earlier one
    bool good = false;                 // whether there is a match
};

class Comparison {
  public:
    Comparison(const Camera& camera, const std::vector<const Keyframe*>& keyframes,
               const std::vector<Face>& faces, const Samples& samples);

    // Where the cameras are believed to have been; to be called before looking and after every change.
    void place(const Path& path, int present);

    std::size_t frames() const { return keyframes_.size(); }
    const Move& move(std::size_t k) const { return moves_[k]; }

    // Of a row of the samples in one earlier frame: the residual alone, or the derivatives with it, those by
    // the cameras if asked for.
    bool residual(std::size_t row, std::size_t k, double rho, double& px) const;
    Look look(std::size_t row, std::size_t k, double rho, bool cameras) const;

  private:
    struct Matched {
        Vec3 seen;          // a
        double nx, ny;      // mean normal of sample and match
        double residual;
    };
    // A sample as an earlier camera would see it, were it infinitely far away.
    struct Turned {
        Vec3 ray;
        float nx = 0, ny = 0;  // its normal
        int direction = 0;     // of that, as the keyframes file it
    };
    bool match(std::size_t row, std::size_t k, double rho, Matched& out) const;

    Camera camera_;
    const Samples* samples_;
    std::vector<const Keyframe*> keyframes_;
    std::vector<Turned> turned_;  // [point][k]; rows come in pairs of one point
    std::vector<Move> moves_;
    std::vector<Vec3> ahead_here_, ahead_there_;  // directions of travel in the earlier cameras' axes
    std::vector<std::vector<char>> alike_;  // [k][present region][earlier region]
};

}  // namespace depth
