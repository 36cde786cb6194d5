// Sub-pixel outlines: where the blurred step between two regions really lies, without touching the net.
//
// All profiles of an edge are fitted together with a straight or, where the outline bends, a parabolic course; the
// blur is one unknown for the whole frame. From the course, one linear step gives every profile its own place:
// being linear, it is not biased by noise, and together the places make the soft area of any shape.
#pragma once

#include <cstdint>
#include <vector>

#include "mesh.hpp"
#include "profiles.hpp"
#include "step.hpp"

namespace rbdn {

// One measured point of an outline.
struct OutlinePoint {
    Vec2 p;
    Vec2 normal;  // unit, from the left region into the right one
    int left;     // region indices
    int right;
    double length_px;  // stretch of outline it stands for
    double sigma_px;   // along the normal
};

struct Refinement {
    Mesh mesh;                         // the net with whole corners, where it was
    std::vector<Bgr> region_bgr;       // mean colours
    std::vector<OutlinePoint> outline;
    std::vector<Vec2> vertices;        // refined positions, by vertex of `mesh`
    std::vector<double> vertex_sigma;  // px; NaN where the edges do not make a corner
    std::vector<double> area;          // by region
    std::vector<double> area_sigma;
};

// Whether the images mix light on their edges, as cameras do, or numbers, as drawing and resizing do. Taken for
// light until all edges agree, to within their noise, that numbers mix, and the noise is not a camera's.
class MixingEvidence {
public:
    // An edge's colours left the straight way by this share of what mixed light would.
    void add(double aside, double variance);
    // Errors, in grey levels, of two neighbouring pixels that see one side only.
    void add_neighbours(double a, double b);
    void fade();
    bool numbers_mix() const;

private:
    double count_ = 0, against_numbers_ = 0, against_light_ = 0;
    double noise_ = 0, common_ = 0, pairs_ = 0;
};

class Refiner {
public:
    // Measures every edge between two regions. `bgr` is (height, width, 3); `labels` give the face of every pixel,
    // `region_of` the region of every face.
    Refinement refine(const Mesh& mesh, const std::uint8_t* bgr, const std::vector<int>& labels,
                      const std::vector<int>& region_of, int region_count);

private:
    // Offset of the outline from an edge towards the left, as a function of the way along it from its middle.
    struct Course {
        double c0 = 0, c1 = 0, c2 = 0;
        double at(double t) const { return c0 + t * (c1 + t * c2); }
    };
    struct EdgeFit {
        int edge = 0;
        int left = 0, right = 0;  // regions
        Vec2 unit, normal;
        double size = 0;
        int begin = 0, end = 0;        // its profiles
        Bgr high{}, low{};             // colours of the left and the right side
        float contrast2 = 0;
        Bgr weights{};                 // project colours above `low` onto the way to `high`
        double side_share = 0;         // variance of the sides' levels over that of a pixel's
        bool measured = false;
        double clear_a = 0, clear_b = 0;  // length at the ends where profiles see another edge
        bool bent = false;             // takes a parabolic course
        Course course, line;
        double gate = 0;               // px beyond which a profile is left out
        // Of the profiles that made the line: weight, centre and second moment along the edge.
        double weight = 0, centre = 0, spread = 0;
        double noise = 0;              // variance of levels, with what the course leaves unexplained
        double level_noise = 0;
    };

    void collect_edges();
    void sample(EdgeFit& fit);
    void start(EdgeFit& fit, const MixCurve& curve);
    void weigh_mixing();
    void compare(EdgeFit& fit, const MixCurve& curve);
    void fit_course(EdgeFit& fit);
    bool is_clear(const EdgeFit& fit, const Profile& p) const {
        return p.usable && p.crossing > fit.clear_a - 0.5 * fit.size && p.crossing < 0.5 * fit.size - fit.clear_b;
    }
    void meet();
    void judge_bends();
    void place_vertices(Refinement& out);
    void measure_areas(Refinement& out);
    double end_variance(const EdgeFit& fit, double t) const;
    double side_error(const EdgeFit& fit) const;

    const View* view_ = nullptr;
    std::vector<EdgeFit> fits_;
    std::vector<int> fit_of_edge_;
    std::vector<Profile> profiles_;
    std::vector<float> levels_;
    std::vector<float> offsets_;
    std::vector<Vec2> on_outline_;
    std::vector<MixCurve> curves_;
    std::vector<char> smooth_;   // by vertex: two outlines that go on into each other
    std::vector<char> doubtful_; // may be a corner or an arc
    MixingEvidence mixing_;      // of all frames
    double width_ = 0.75;        // of the blur, lens and pixel together, px
    bool width_is_known_ = false;
    double width_pull_ = 0, width_weight_ = 0;
};

}  // namespace rbdn
