// Regions: faces held together where the colour does not step across their common edge.
//
// An object's own shading may cut it into several faces; across such a cut the colour changes little from one
// side to the other, however different the faces' means are.
#pragma once

#include <cstdint>
#include <set>
#include <utility>
#include <vector>

#include "image.hpp"
#include "mesh.hpp"

namespace rbdn {

struct RegionRule {
    double link_step;  // colour steps below this, in working units, join two faces
    double keep_step;  // joined faces part only above this
};

struct RegionSet {
    std::vector<int> of_face;           // region index of every face
    std::vector<std::int64_t> id;       // by region index
    std::vector<std::int64_t> parent;   // region a new one came from, or -1
};

// Groups the faces and names the groups after the regions most of their pixels belonged to. Faces remember
// their region for the next frame.
class RegionGrouping {
public:
    RegionSet update(Mesh& mesh, const Image& image, const std::vector<int>& labels, const RegionRule& rule);

private:
    std::set<std::pair<std::int64_t, std::int64_t>> links_;  // pairs of face ids joined in the last frame
    std::int64_t next_id_ = 0;
};

}  // namespace rbdn
