// The settings of the net, as host/rbdn/config.py documents them.
#pragma once

namespace rbdn {

// Ours, or the paper's rules to the letter (paper.hpp).
enum class Mode { kOurs, kPaper };

struct Config {
    Mode mode = Mode::kOurs;
    int square_px = 16;
    double merge_distance = 7.5;
    double rgb_distance = 30.0;
    double lightness_weight = 0.3;
    double min_area_px = 200.0;
    double min_width_px = 2.5;
    int start_reach_px = 8;
    int track_reach_px = 12;
    int start_cycles = 60;
    int track_cycles = 16;
    double group_step = 8.0;
    double keep_step = 12.0;
    int refresh_frames = 5;
    int max_polygons = 0;
    double max_ms = 0.0;
};

}  // namespace rbdn
