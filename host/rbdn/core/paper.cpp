// The paper's own rules to the letter, so that every experiment can show them beside ours.
#include "paper.hpp"

#include <algorithm>
#include <map>
#include <utility>

namespace rbdn {

namespace {

constexpr double kLeastFilling = 0.95;  // share of a face's pixels that must be near its mean

// Calls `visit(pixel, along, above)` for every pixel with its centre in the edge's sensitivity regions; `along` is
// measured from end a, `above` is positive on the left.
template <class Visit>
void for_each_sensitive_pixel(const Mesh& mesh, const Edge& e, double reach, Visit visit) {
    const Vec2 a = mesh.vertices[e.a].p, b = mesh.vertices[e.b].p;
    const double size = length(b - a);
    const Vec2 unit = (1.0 / size) * (b - a), normal = left_normal(b - a);
    const double wide = reach * std::abs(normal.x), high = reach * std::abs(normal.y);
    const int x0 = std::max(0, floor_px(std::min(a.x, b.x) - wide));
    const int x1 = std::min(mesh.width - 1, floor_px(std::max(a.x, b.x) + wide));
    const int y0 = std::max(0, floor_px(std::min(a.y, b.y) - high));
    const int y1 = std::min(mesh.height - 1, floor_px(std::max(a.y, b.y) + high));
    for (int y = y0; y <= y1; ++y) {
        int first = x0, last = x1;
        if (std::abs(normal.x) > 0.01) {  // not the whole bounding box of a long oblique edge
            const double middle = a.x - (y + 0.5 - a.y) * normal.y / normal.x;
            const double spread = reach / std::abs(normal.x) + 1.0;
            first = std::max(x0, floor_px(middle - spread));
            last = std::min(x1, floor_px(middle + spread));
        }
        for (int x = first; x <= last; ++x) {
            const Vec2 from_a = Vec2{x + 0.5, y + 0.5} - a;
            const double along = dot(from_a, unit), above = dot(from_a, normal);
            if (along >= 0 && along < size && above < reach && above > -reach) visit(x, y, along, above);
        }
    }
}

}  // namespace

std::vector<Disparity> measure_literal_disparity(const Mesh& mesh, const std::vector<int>& labels, const Image& image,
                                                 double eta, int reach_px) {
    const auto eta2 = static_cast<float>(eta * eta);
    std::vector<Disparity> out(mesh.edges.size());
    for (std::size_t k = 0; k < mesh.edges.size(); ++k) {
        const Edge& e = mesh.edges[k];
        const double size = mesh.edge_length(e);
        if (e.on_border() || size < 1e-9) continue;
        const Colour& left = mesh.faces[e.left].mean;
        const Colour& right = mesh.faces[e.right].mean;
        for_each_sensitive_pixel(mesh, e, reach_px, [&](int x, int y, double along, double above) {
            const bool on_left = above > 0;
            if (labels[static_cast<std::size_t>(y) * mesh.width + x] != (on_left ? e.left : e.right)) return;
            const Colour c = image.colour_of(image.row(y) + 3 * static_cast<std::size_t>(x));
            if (distance2(c, on_left ? left : right) <= eta2 || distance2(c, on_left ? right : left) > eta2) return;
            const int half = along < 0.5 * size ? 0 : 1;
            ++(on_left ? out[k].left_claimed : out[k].right_claimed)[half];
        });
    }
    return out;
}

void move_by_forces(Mesh& mesh, const std::vector<Disparity>& disparity) {
    std::vector<Vec2> total(mesh.vertices.size());
    for (std::size_t k = 0; k < mesh.edges.size(); ++k) {
        const Edge& e = mesh.edges[k];
        const double size = mesh.edge_length(e);
        if (e.on_border() || size < 1e-9) continue;
        const Vec2 normal = left_normal(mesh.along(e));
        const Disparity& d = disparity[k];
        // The face on the right inflates towards the left, and the other way round.
        for (int half : {0, 1}) {
            const double force = (d.left_claimed[half] - d.right_claimed[half]) / (2.0 * size);
            Vec2& sum = total[half == 0 ? e.a : e.b];
            sum = sum + force * normal;
        }
    }
    displace_vertices(mesh, total);
}

int fragment_ill_filled(Mesh& mesh, std::vector<int>& labels, const Image& image, double eta, double least_area_px,
                        int square_px) {
    const auto eta2 = static_cast<float>(eta * eta);
    std::vector<int> pixels(mesh.faces.size(), 0), off(mesh.faces.size(), 0);
    for (int y = 0; y < mesh.height; ++y)
        for (int x = 0; x < mesh.width; ++x) {
            const int face = labels[static_cast<std::size_t>(y) * mesh.width + x];
            ++pixels[face];
            const Colour c = image.colour_of(image.row(y) + 3 * static_cast<std::size_t>(x));
            off[face] += distance2(c, mesh.faces[face].mean) > eta2;
        }
    const auto ill_filled = [&](int face) {
        return off[face] > (1.0 - kLeastFilling) * pixels[face] && off[face] >= least_area_px;
    };
    const int faces = static_cast<int>(mesh.faces.size());
    std::map<std::pair<int, int>, int> piece_of;  // by face and square
    for (int y = 0; y < mesh.height; ++y)
        for (int x = 0; x < mesh.width; ++x) {
            int& label = labels[static_cast<std::size_t>(y) * mesh.width + x];
            if (label >= faces || !ill_filled(label)) continue;
            const int square = y / square_px * mesh.width + x / square_px;
            const auto [place, is_new] = piece_of.try_emplace({label, square}, 0);
            if (is_new) {
                place->second = mesh.add_face();
                // All pieces still belong to the region; the largest of what they regroup to keeps its id.
                mesh.faces[place->second].region = mesh.faces[label].region;
                mesh.faces[place->second].parent = mesh.faces[label].parent;
            }
            label = place->second;
        }
    return static_cast<int>(piece_of.size());
}

}  // namespace rbdn
