// Things that move by themselves, told by the track of their middles.
//
// What stands still at inverse depth rho is seen by an earlier camera at first two of (R p + rho t) over the
// third, with 1/third the change of its size. A steady motion across the view adds a shift that grows with
// time and that no depth explains. Both are fitted to a region's middles and sizes; where the shift is sure,
// steady and not the edge of something creeping over the region (that changes its shape too), it moves.
// Motion along the line of sight looks like another depth and cannot be told.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "frame_view.hpp"
#include "path.hpp"

namespace depth {

class Movers {
  public:
    explicit Movers(const Camera& camera) : camera_(camera) {}

    // Takes in a frame, and says which of its regions move.
    std::vector<char> update(const FrameView& frame, const Path& path, int present);

    // The region is no longer what it was.
    void forget(std::int64_t id) { tracks_.erase(id); }

    // Frames that the path must keep.
    std::set<int> frames() const;

  private:
    struct Sight {
        int frame;
        Vec2 middle;    // px
        Vec2 width;     // px, of a rectangle with the same second moments
        double size;    // square root of the area, px
    };
    struct Track {
        std::vector<Sight> sights;  // oldest first
        bool moves = false;
    };
    bool moves(const Track& track, const Path& path, const Sight& now) const;

    Camera camera_;
    std::map<std::int64_t, Track> tracks_;
};

}  // namespace depth
