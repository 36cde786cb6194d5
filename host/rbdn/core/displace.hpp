// Regions put where they are expected in the next image, before anything is fitted to it.
#pragma once

#include <cstdint>
#include <vector>

#include "crossings.hpp"
#include "fragment.hpp"
#include "mesh.hpp"

namespace rbdn {

struct Displacement {
    std::int64_t region;
    Vec2 by;  // px
};

// Moves the outlines of regions. A vertex of several regions goes with the one that moves most: what is nearer
// moves more, and outlines belong to what is nearer. A region that would tear the net goes only as far as it can.
void displace_regions(Mesh& mesh, Crossings& crossings, const std::vector<Displacement>& displacements);

// Moves off-pixels of the last frame with their regions. `labels`, face of every pixel, are those before the
// displacement.
void displace_pixels(OffMemory& pixels, const Mesh& mesh, const std::vector<int>& labels,
                     const std::vector<Displacement>& displacements);

}  // namespace rbdn
