// The net's operations one at a time, so that tests can string them together in any order.
#pragma once

#include <cstdint>

#include "tracker.hpp"

namespace rbdn {

enum class Step {
    kMove,          // random moves of the vertices, taken back where they fold the net
    kDeform,        // a few deformation cycles
    kInsert,
    kDelete,
    kZip,
    kSnap,
    kSnapToBorder,
    kMerge,
    kVectorise,
    kFragment,      // a random disc cut into squares
    kTurn,          // the labels of a camera that turned
    kDisplace,      // regions put where they are expected
    kTrack,         // a whole frame
};
constexpr int kStepCount = 13;

class Steps {
public:
    // Works on the net of `tracker`, on a grid of squares where it has none yet.
    explicit Steps(Tracker& tracker) : t_(tracker) {}

    // Does one step on an image (8-bit blue, green, red). As at the end of a frame, faces that fell apart are
    // separate ones then, faces that vanished are gone, and the tracker's labels are those of the net.
    void apply(Step step, std::uint32_t seed, const std::uint8_t* bgr, int width, int height);

    // The disparity of every edge, from means over all pixels of the faces.
    const std::vector<Disparity>& measure(const std::uint8_t* bgr, int width, int height, int reach_px);

private:
    void look_at(const std::uint8_t* bgr, int width, int height);
    void tidy();
    void move(std::uint32_t seed);
    void fragment(std::uint32_t seed);
    void turn(std::uint32_t seed);
    void displace(std::uint32_t seed);
    void transact(const Operation& operation);

    Tracker& t_;
};

}  // namespace rbdn
