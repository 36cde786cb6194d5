// The net's life: made on the first frame, carried to each next one (sections 2 and 3 of the paper).
#pragma once

#include <chrono>
#include <cstdint>
#include <span>
#include <vector>

#include "config.hpp"
#include "crossings.hpp"
#include "displace.hpp"
#include "forces.hpp"
#include "fragment.hpp"
#include "image.hpp"
#include "maintain.hpp"
#include "mesh.hpp"
#include "planarity.hpp"
#include "regions.hpp"

namespace rbdn {

class Tracker {
public:
    explicit Tracker(const Config& config) : config_(config), image_(config) {}

    // Fits the net to the next image (8-bit blue, green, red). `source` tells, for every pixel, which pixel of the last
    // frame the camera's rotation brought there (negative: none); empty where the camera did not turn much.
    void track(const std::uint8_t* bgr, int width, int height, std::span<const int> source);

    // Puts regions of the last frame where they are expected in the next image, in the last one's coordinates.
    void displace(const std::vector<Displacement>& displacements);

    const Mesh& mesh() const { return mesh_; }
    const RegionSet& regions() const { return regions_; }
    const std::vector<int>& labels() const { return labels_; }  // face of every pixel
    int cycles() const { return cycles_; }

    // Did a budget of the configuration act in the last frame?
    bool polygons_limited() const { return polygons_limited_; }
    bool time_limited() const { return time_limited_; }

    // Faults of the net as it stands; empty unless there is a bug.
    std::vector<int> faults() const { return find_faults(mesh_, crossings_); }

private:
    friend class Steps;

    void see(const std::uint8_t* bgr, int width, int height, bool every_pixel);
    void start();
    void find_outlines_in_lightness();
    void follow(std::span<const int> source);
    void finish();

    void deform(int reach_px, int most_cycles, bool keep_means);
    int maintain(int reach_px);
    int merge();
    int split();
    bool out_of_time();  // asked where work is left
    void update_means();
    void cut_out_news();
    const std::vector<Disparity>& disparity(int reach_px, Which which);
    void list_all_lines();
    void fragment();
    void regroup();
    bool literal() const { return config_.mode == Mode::kPaper; }
    double lightness_gain() const { return config_.lightness_weight > 0 ? 1.0 / config_.lightness_weight : 1.0; }
    double eta() const {
        return Image::kUnitsPerLab * (literal() ? config_.rgb_distance : config_.merge_distance);
    }

    Config config_;
    Image image_;
    Mesh mesh_;
    Mesh saved_;  // for transactions; kept for its memory
    Crossings crossings_;
    RegionGrouping grouping_;
    RegionSet regions_;
    std::vector<int> labels_;
    OffMemory known_off_;

    // Derived from image, mesh and crossings; good while the version of the crossings is the one beside them.
    static constexpr int kNone = -1;
    int means_version_ = kNone;
    std::vector<Disparity> disparity_;
    int disparity_version_ = kNone;
    int disparity_reach_px_ = 0;
    Mesh sure_;  // the net when all lines were last found consistent

    bool lightness_in_full_ = false;  // polygons merge only where lightness, too, is alike
    double sharp_jump_ = 0;           // working units; a larger jump is an outline. 0: the image is too rough to tell

    int frames_ = 0;
    int cycles_ = 0;
    std::chrono::steady_clock::time_point begin_{};  // of the frame
    bool polygons_limited_ = false;
    bool time_limited_ = false;
};

}  // namespace rbdn
