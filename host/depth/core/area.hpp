// Depth from the growth of a region's area (Eq. 14-18), with rotation taken out, over all frames of a run.
//
// Eq. 14 says that the area of a frontal surface goes with 1/Z^2, so 1/sqrt(A) is linear in Z, and with
// Z_k = Z + d_k (Eq. 9) linear in the distance d_k by which frame k was taken farther back:
//
//     1/sqrt(A_k) = s (Z + d_k)
//
// Two frames give Eq. 16; more are a regression whose intercept over slope is the depth. The sensitivity
// of Eq. 18 is dA/dZ = 2 A / Z.
//
// Areas are compared, and distances taken, as a camera that looks along the way would have them (the present
// orientation, where the way does not lead ahead), so that no turn of the camera changes the answer. Turning
// a camera changes an area element by 1/L^3 with L = r3 . p, r3 the third row of the turn and p the ray.
// Over a region
//
//     mean of 1/L^3 = (1 + 6 var(L)/L0^2) / L0^3 with L0 = L at the centroid,
//
// up to the third moments: for half a right angle of view turned by 0.1 rad that is 1e-5. So area,
// centroid and second moments are all there is to keep of a frame, and a corrected path corrects them.
//
// What Eq. 16 says of a surface that is not frontal. Under forward motion points p of the image move by
// p rho dZ, rho = 1/Z. Where rho has a gradient, the area grows by 2 rho + p . grad rho instead of 2 rho,
// and the shape is strained by half of |p| |grad rho| beside its growth. So the strain over the growth of
// the size bounds the relative error: it is 0.65 of it, rms, on boxes, their faces, boards, cylinders and
// balls at random places and angles (test_area_core.py draws them anew), and is measured, not assumed.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "answer.hpp"
#include "frame_view.hpp"
#include "path.hpp"
#include "polygon.hpp"

namespace depth {

struct AreaConfig {
    int history = 32;                // frames kept
    double shape_change = 0.35;      // strain of the shape over growth of the size beyond which it declines
    double outline_px = 0.15;        // by which all of an outline lies too far in or out, always alike
    double drift_px = 0.05;          // by which that changes along the way
    double own_share = 0.97;         // of its outline that must be the region's own
    double min_change = 0.015;       // relative change of size that the motion must cause
    double min_step_cm = 0.3;        // a frame nearer than this to the last one kept is not kept
    double max_relative_sigma = 0.3; // a depth worse than this is declined
};

class AreaMethod {
  public:
    AreaMethod(const Camera& camera, const AreaConfig& config);

    // Takes in one region of a frame, and says how far it is. The path must not change between the regions
    // of one frame.
    //
    // own_share: share of its outline that is not the outline of something nearer
    Answer update(const RegionView& region, const FrameView& frame, const Path& path, int present,
                  double own_share);

    // The region is no longer what it was.
    void forget(std::int64_t id);

    // Drops regions that have not been seen for long.
    void forget_unseen(int present);

    // Frames that the path must keep.
    std::set<int> frames() const;

  private:
    // One measurement of a region, in the camera of its own frame.
    struct Sight {
        int frame;
        Moments moments;        // of the region's rays; the area is the soft one
        double relative_sigma;  // of 1/sqrt(area)
    };
    struct History {
        std::vector<Sight> sights;  // of kept frames, oldest first
        int last_frame = 0;
        int jumps = 0;         // frames in a row, up to the last, that contradict the line of the others
        const char* why_new;   // why it begins where it does
    };
    // Sights of the region at hand as a camera looking along the way would have taken them, the present one last.
    struct Turned {
        std::vector<double> behind_cm;     // how far back it was taken
        std::vector<double> inverse_size;  // 1/sqrt(area)
        std::vector<double> sigma;         // of it
        std::array<std::vector<double>, 3> shape;  // second moments xx, yy, xy over the area

        void clear() {
            for (auto* values : {&behind_cm, &inverse_size, &sigma, &shape[0], &shape[1], &shape[2]}) values->clear();
        }
    };

    void open(const Path& path, int present);
    Sight measure(const RegionView& region) const;
    bool add_turned(const Sight& sight, const Move& move);

    Camera camera_;
    AreaConfig config_;
    std::vector<int> kept_;             // frames, oldest first; all histories draw on the same
    int present_ = -1;
    bool keep_present_ = false;
    Mat3 axis_;                         // from the present camera to one that looks along the way
    std::vector<Move> moves_;           // from each kept frame to that one
    std::map<std::int64_t, History> histories_;
    Turned sights_;
    std::vector<double> weights_;       // of them
    Move farthest_;                     // from the one taken farthest away
};

}  // namespace depth
