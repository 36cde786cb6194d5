// The outline of one frame, filed so that the sample nearest to any image point, of like direction, is
// one look-up away.
#pragma once

#include <cstdint>
#include <vector>

#include "frame_view.hpp"
#include "space.hpp"

namespace depth {

// Which of the filed directions, every 45 degrees, is nearest to a normal; its sense does not matter.
inline int direction_of(float nx, float ny) {
    const float ax = nx < 0 ? -nx : nx, ay = ny < 0 ? -ny : ny;
    constexpr float TAN_22 = 0.41421356f;
    if (ay <= TAN_22 * ax) return 0;
    if (ax <= TAN_22 * ay) return 2;
    return (nx < 0) == (ny < 0) ? 1 : 3;
}

class ContourMap {
  public:
    struct Point {
        float x, y, nx, ny;   // ideal pixels; normal from left to right
        std::int32_t left, right;  // rows of the frame's regions
    };

    // Files the outline samples of `frame` that lie at least `border_px` inside the image, 65535 at most.
    void file(const FrameView& frame, const Camera& camera, double border_px);

    // The nearest point of like direction, within about REACH_PX; null where there is none.
    const Point* nearest(float x, float y, int direction) const {
        const float column = x * (1.0f / CELL_PX) + (MARGIN + 0.5f), row = y * (1.0f / CELL_PX) + (MARGIN + 0.5f);
        if (!(column > 0 && row > 0 && column < static_cast<float>(columns_) && row < static_cast<float>(rows_)))
            return nullptr;
        const int at = (direction * rows_ + static_cast<int>(row)) * columns_ + static_cast<int>(column);
        const std::uint16_t index = cells_[static_cast<std::size_t>(at)];
        return index == NONE ? nullptr : &points_[index];
    }

    static constexpr int CELL_PX = 2;
    static constexpr int REACH_CELLS = 4;

  private:
    static constexpr int MARGIN = REACH_CELLS;
    static constexpr std::uint16_t NONE = 0xFFFF;

    int rows_ = 0, columns_ = 0;
    std::vector<Point> points_;
    std::vector<std::uint16_t> cells_;  // [direction][row][column]; small, for the look-ups wait for memory
};

}  // namespace depth
