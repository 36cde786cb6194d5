// Regions: faces held together where the colour does not step across their common edge.
//
// An object's own shading may cut it into several faces; across such a cut the colour changes little from one
// side to the other, however different the faces' means are.
#pragma once

#include <cstdint>
#include <set>
#include <utility>
#include <vector>

#include "absent.hpp"
#include "image.hpp"
#include "mesh.hpp"

namespace rbdn {

struct RegionRule {
    double link_step;    // colour steps below this, in working units, join two faces
    double keep_step;    // joined faces part only above this
    double same_colour;  // a pixel nearer than this to a mean may belong to it
    double smallest_px;  // less than this is not worth following
    double sharp_jump;   // faces with a larger jump between them are no region, unless they were one
};

constexpr std::int64_t kNoRegion = -1;

// A region of the last frame that is no more.
struct GoneRegion {
    std::int64_t id;
    std::int64_t became;  // the region that most of its pixels now belong to; kNoRegion where it left or was hidden
};

struct RegionSet {
    std::vector<int> of_face;           // region index of every face
    std::vector<std::int64_t> id;       // by region index
    std::vector<std::int64_t> parent;   // region a new one came out of, or kNoRegion
    std::vector<std::uint8_t> is_news;  // a new one shows what the last frame did not
    std::vector<std::uint8_t> is_back;  // one that was gone is seen again
    std::vector<GoneRegion> gone;       // by id
};

// Groups the faces and names the groups after the regions most of their pixels belonged to. Faces remember
// their region for the next frame.
class RegionGrouping {
public:
    // Remembers what the last frame left, before anything is fitted to the next image. `labels`, face of every
    // pixel, say where it is expected there.
    void expect(const Mesh& mesh, const std::vector<int>& labels);

    // `jumps`: of every edge (jumps.hpp); empty where they do not matter.
    RegionSet update(Mesh& mesh, const Image& image, const std::vector<int>& labels, const std::vector<float>& jumps,
                     const RegionRule& rule);

private:
    // A face as the last frame left it.
    struct Known {
        std::int64_t id;
        std::int64_t region;
        Colour mean;
    };

    std::vector<int> group_faces(const Mesh& mesh, const Image& image, const std::vector<int>& labels,
                                 const std::vector<float>& jumps, const RegionRule& rule);
    template <class Visit>
    void for_each_sample(const Mesh& mesh, Visit visit) const;
    void name_groups(Mesh& mesh, const Image& image, const std::vector<int>& labels, const RegionRule& rule,
                     RegionSet& set);
    std::vector<Sight> look_at_groups(const Mesh& mesh, const Image& image, const std::vector<int>& labels,
                                      const RegionSet& set) const;
    void remember_gone(const Mesh& mesh, const RegionSet& set);
    std::vector<GoneRegion> find_gone(const Mesh& mesh, const Image& image, const std::vector<int>& labels,
                                      const RegionRule& rule, const RegionSet& set) const;
    std::int64_t what_became_of(std::int64_t region, const Mesh& mesh, const Image& image,
                                const std::vector<int>& labels, const RegionRule& rule, const RegionSet& set) const;

    std::set<std::pair<std::int64_t, std::int64_t>> links_;  // pairs of face ids joined in the last frame
    std::int64_t next_id_ = 0;
    AbsentRegions absent_;
    int frame_ = 0;
    std::vector<Known> known_;       // faces of the last frame
    std::vector<int> expected_face_;  // index into known_, at every kSampleStep-th pixel both ways
};

}  // namespace rbdn
