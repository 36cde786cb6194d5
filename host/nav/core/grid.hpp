// One frame's evidence, painted on the cells of the map that are in view.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace nav {

// The map: three layers of (side, side) cells, row = z, column = x.
struct Grid {
    float* evidence;       // log-odds
    std::int32_t* region;  // that last filled it
    bool* brief;           // by something that does not stay
    const double* centres_cm;
    std::size_t side;
};

// Where the camera is, and which column of the picture shows a direction.
struct View {
    double x_cm, z_cm, sine, cosine;        // of the heading
    double left, right;                     // X/Z beyond which nothing is in view
    double range_cm;
    std::size_t row0, row1, col0, col1;     // of the map, that hold all in view; ends included
    double fx, cx;                          // of a lens without distortion
    std::vector<double> rays, pixels;       // else X/Z of level rays, evenly spaced, and the image x of each
    double step_px;                         // from column to column
};

// What the picture shows of the floor, by column.
struct Floor {
    std::vector<double> free_cm;  // it surely is floor up to here
    std::vector<double> floor_cm; // and most likely up to here
    std::vector<bool> cut;        // none of it is seen
    double nearest_cm;            // where the view of it begins
};

// A thing's front, and what it is worth where its cells are.
struct Front {
    std::int32_t region;
    std::vector<std::int64_t> columns;
    std::vector<double> depth_cm;  // in each of them
    double sigma_cm;
    double from_cm, to_cm;         // cells between these behind the front are filled
    double sure_cm;                // and beyond this only those of which little is known
    float at_least;                // what is known of a cell before counts no less than this
    float change, most;            // what a frame is worth, and the most it can come to
    bool brief;
};

struct Rules {
    Rules(float seen_empty_, float looked_over_, float presumed_, float limit_, double cell_cm_)
        : seen_empty(seen_empty_), looked_over(looked_over_), presumed(presumed_), limit(limit_), cell_cm(cell_cm_) {}
    float seen_empty;   // what a frame of bare floor is worth
    float looked_over;  // known of a cell that something farther was seen over
    float presumed;    // of a cell with less than this, either way, little is known
    float limit;
    double cell_cm;
};

void paint(const Grid& grid, const View& view, const Floor& floor, const std::vector<Front>& fronts, const Rules& rules);

}  // namespace nav
