// Regions put where they are expected in the next image, before anything is fitted to it.
#include "displace.hpp"

#include <algorithm>
#include <map>

#include "forces.hpp"
#include "planarity.hpp"

namespace rbdn {

namespace {

constexpr double kSmallestShare = 1.0 / 16;  // of its way, below which a region stays where it was

// The displacement, as an index, of every face; -1 for none.
std::vector<int> displacements_of_faces(const Mesh& mesh, const std::vector<Displacement>& displacements) {
    std::map<std::int64_t, int> of_region;
    for (int k = 0; k < static_cast<int>(displacements.size()); ++k) of_region[displacements[k].region] = k;
    std::vector<int> of_face;
    for (const Face& face : mesh.faces) {
        const auto found = of_region.find(face.region);
        of_face.push_back(found == of_region.end() ? -1 : found->second);
    }
    return of_face;
}

// The displacement, as an index, that each vertex follows; -1 for none.
std::vector<int> leaders_of_vertices(const Mesh& mesh, const std::vector<Displacement>& displacements) {
    const std::vector<int> of_face = displacements_of_faces(mesh, displacements);
    std::vector<int> leader(mesh.vertices.size(), -1);
    for (const Edge& e : mesh.edges)
        for (int face : {e.left, e.right}) {
            if (face < 0 || of_face[face] < 0) continue;
            for (int v : {e.a, e.b})
                if (leader[v] < 0 || length(displacements[of_face[face]].by) > length(displacements[leader[v]].by))
                    leader[v] = of_face[face];
        }
    return leader;
}

}  // namespace

void displace_regions(Mesh& mesh, Crossings& crossings, const std::vector<Displacement>& displacements) {
    const std::vector<int> leader = leaders_of_vertices(mesh, displacements);
    std::vector<double> share(displacements.size(), 1.0);
    for (;;) {
        for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
            if (leader[v] >= 0)
                mesh.place(static_cast<int>(v),
                           mesh.vertices[v].held + share[leader[v]] * displacements[leader[v]].by);
        crossings.build(mesh);
        std::vector<char> at_fault(displacements.size(), 0);
        for (int e : find_faults(mesh, crossings))
            for (int v : {mesh.edges[e].a, mesh.edges[e].b})
                if (leader[v] >= 0 && share[leader[v]] > 0) at_fault[leader[v]] = 1;
        if (std::find(at_fault.begin(), at_fault.end(), 1) == at_fault.end()) break;
        // As a whole, so that it keeps its shape.
        for (std::size_t k = 0; k < share.size(); ++k)
            if (at_fault[k]) share[k] = share[k] > kSmallestShare ? share[k] / 2 : 0.0;
    }
    settle_moves(mesh, crossings);
}

void displace_pixels(OffMemory& pixels, const Mesh& mesh, const std::vector<int>& labels,
                     const std::vector<Displacement>& displacements) {
    const std::vector<int> of_face = displacements_of_faces(mesh, displacements);
    pixels.move([&](int k) {
        const int which = of_face[labels[k]];
        const Vec2 by = which < 0 ? Vec2{} : displacements[which].by;
        const int x = k % mesh.width + floor_px(by.x + 0.5), y = k / mesh.width + floor_px(by.y + 0.5);
        return x >= 0 && y >= 0 && x < mesh.width && y < mesh.height ? y * mesh.width + x : -1;
    });
}

}  // namespace rbdn
