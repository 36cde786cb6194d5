// The image along the rows or columns that cross an edge: what sub-pixel measurement looks at.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "mesh.hpp"
#include "step.hpp"

namespace rbdn {

// What is measured: a net, the image it was fitted to, and what both say of every pixel, face and region.
struct View {
    const Mesh& mesh;
    const std::uint8_t* bgr;             // (height, width, 3)
    const std::vector<int>& labels;      // face of every pixel
    const std::vector<int>& region_of;   // region of every face
    const std::vector<Bgr>& region_bgr;  // mean colour of every region

    int region(int face) const { return face < 0 ? kOutside : region_of[face]; }
    bool is_outline(const Edge& e) const {
        return !e.dead && !e.on_border() && region(e.left) != region(e.right);
    }
    const std::uint8_t* pixel(int x, int y) const { return bgr + 3 * (static_cast<std::size_t>(y) * mesh.width + x); }
};

// Mean colours of the regions, from some rows of the image.
std::vector<Bgr> mean_colours(const Mesh& mesh, const std::uint8_t* bgr, const std::vector<int>& labels,
                              const std::vector<int>& region_of, int region_count);

struct Profile {
    const std::uint8_t* first;  // pixel
    int stride;                 // bytes from pixel to pixel
    int count;
    int levels;                 // index of its pixels' levels
    float distance;             // of the first pixel from the edge, towards the left, px
    float distance_step;        // from pixel to pixel
    float along;                // of the first pixel, from the edge's middle, px
    float along_step;
    float crossing;             // the same of the place where edge and line cross
    float length;               // of the edge between neighbouring lines
    float offset = 0;           // of the step from the edge, px
    float weight = 0;           // 1 / its variance, for levels of variance 1
    bool usable = true;
};

// Colours beside an edge, summed.
struct SideSum {
    std::array<int, 3> sum{};
    int count = 0;

    void add(const std::uint8_t* pixel) {
        for (int c = 0; c < 3; ++c) sum[c] += pixel[c];
        ++count;
    }
    Bgr mean() const {
        Bgr out;
        for (int c = 0; c < 3; ++c) out[c] = static_cast<float>(sum[c]) / static_cast<float>(count);
        return out;
    }
};
struct SideColours {
    SideSum near, far;
};

constexpr float kBand = 4.0F;  // half width of the band in which the step is looked for, px

// Appends the profiles of one edge, in order along it. They end before whatever else lies beside the edge; the
// sides' colours are not taken within `clear_a` and `clear_b` px of the ends.
void take_profiles(const View& view, const Edge& edge, double clear_a, double clear_b,
                   std::vector<Profile>& profiles, SideColours& left, SideColours& right);

}  // namespace rbdn
