// Runs programs of net operations under sanitizers and checks the net after every one of them.
//
// usage: fuzz_core SCALE, of the images; 1 for the smallest
//
// A program is a line of hexadecimal bytes on standard input: three that choose a scene and settings, then two for
// each operation. Every line is answered: "sound N" after N operations, or what broke and where.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "refine.hpp"
#include "steps.hpp"

namespace {

using rbdn::Edge;
using rbdn::kOutside;
using rbdn::Mesh;
using rbdn::Vec2;

constexpr std::array<std::array<int, 2>, 4> kSizes{{{32, 24}, {27, 31}, {40, 20}, {24, 25}}};
constexpr int kNextFrame = rbdn::kStepCount;  // operations of the driver's own
constexpr int kRefine = rbdn::kStepCount + 1;
constexpr int kOperations = rbdn::kStepCount + 2;

struct Disc {
    double x, y, radius, vx, vy;
    std::array<std::uint8_t, 3> colour;
};

// Noisy discs that move before one colour.
class Scene {
public:
    Scene(unsigned seed, int width, int height) : random_(seed), width_(width), height_(height) {
        const auto pick = [&](double low, double high) { return low + (high - low) * (random_() / 4294967296.0); };
        const auto any_colour = [&] {
            std::array<std::uint8_t, 3> c{};
            for (auto& v : c) v = static_cast<std::uint8_t>(random_() % 256);
            return c;
        };
        ground_ = any_colour();
        noise_ = random_() % 2 ? static_cast<int>(random_() % 40) : 0;
        for (unsigned k = 0, n = random_() % 7; k < n; ++k) {
            const double x = pick(0, width), y = pick(0, height), radius = pick(1, 20);
            const double vx = pick(-6, 6), vy = pick(-6, 6);
            discs_.push_back({x, y, radius, vx, vy, any_colour()});
        }
        draw();
    }

    const std::vector<std::uint8_t>& image() const { return image_; }

    void move() {
        for (Disc& d : discs_) {
            d.x += d.vx;
            d.y += d.vy;
        }
        draw();
    }

private:
    void draw() {
        image_.resize(static_cast<std::size_t>(3) * width_ * height_);
        for (int y = 0; y < height_; ++y)
            for (int x = 0; x < width_; ++x) {
                const std::array<std::uint8_t, 3>* c = &ground_;
                for (const Disc& d : discs_)
                    if ((x - d.x) * (x - d.x) + (y - d.y) * (y - d.y) < d.radius * d.radius) c = &d.colour;
                for (int k = 0; k < 3; ++k) {
                    const int jitter = noise_ ? static_cast<int>(random_() % (2 * noise_ + 1)) - noise_ : 0;
                    image_[3 * (static_cast<std::size_t>(y) * width_ + x) + k] =
                        static_cast<std::uint8_t>(std::clamp((*c)[k] + jitter, 0, 255));
                }
            }
    }

    std::mt19937 random_;
    int width_, height_;
    std::vector<Disc> discs_;
    std::array<std::uint8_t, 3> ground_{};
    int noise_ = 0;
    std::vector<std::uint8_t> image_;
};

using Fault = std::optional<std::string>;

Fault broken_incidence(const Mesh& mesh) {
    const int vertices = static_cast<int>(mesh.vertices.size()), faces = static_cast<int>(mesh.faces.size());
    if (mesh.spokes.size() != mesh.vertices.size()) return "vertices without a list of edges";
    std::vector<char> used(mesh.faces.size(), 0);
    std::vector<std::pair<int, int>> pairs, ends;  // vertices of each edge; each vertex with its edges
    for (int k = 0; k < static_cast<int>(mesh.edges.size()); ++k) {
        const Edge& e = mesh.edges[k];
        if (e.dead) return "a dead edge";
        if (e.a < 0 || e.b < 0 || e.a >= vertices || e.b >= vertices || e.a == e.b) return "an edge without two ends";
        if (e.left < kOutside || e.right < kOutside || e.left >= faces || e.right >= faces || e.left == e.right)
            return "an edge without two faces";
        pairs.push_back(std::minmax(e.a, e.b));
        ends.insert(ends.end(), {{e.a, k}, {e.b, k}});
        for (int face : {e.left, e.right})
            if (face >= 0) used[face] = 1;
    }
    std::sort(pairs.begin(), pairs.end());
    if (std::adjacent_find(pairs.begin(), pairs.end()) != pairs.end()) return "two edges between the same vertices";
    std::vector<std::pair<int, int>> known;
    for (int v = 0; v < vertices; ++v) {
        if (mesh.spokes[v].count == 0) return "a vertex without edges";
        for (int e : mesh.spokes[v]) known.push_back({v, e});
    }
    std::sort(ends.begin(), ends.end());
    std::sort(known.begin(), known.end());
    if (known != ends) return "a vertex that does not know its edges";
    if (std::count(used.begin(), used.end(), 0) > 0) return "a face without edges";
    return {};
}

Fault broken_border(const Mesh& mesh) {
    const double w = mesh.width, h = mesh.height;
    int corners = 0;
    for (const rbdn::Vertex& v : mesh.vertices) {
        if (v.dead) return "a dead vertex";
        const int sides = (v.p.x == 0 ? rbdn::kLeftSide : 0) | (v.p.x == w ? rbdn::kRightSide : 0) |
                          (v.p.y == 0 ? rbdn::kTopSide : 0) | (v.p.y == h ? rbdn::kBottomSide : 0);
        if (sides != v.sides) return "a vertex off its side of the image";
        if (!(v.p.x >= 0 && v.p.y >= 0 && v.p.x <= w && v.p.y <= h)) return "a vertex outside the image";
        corners += (v.p.x == 0 || v.p.x == w) && (v.p.y == 0 || v.p.y == h);
    }
    if (corners != 4) return "not four corners";
    double length = 0;
    for (const Edge& e : mesh.edges) {
        const bool along = (mesh.vertices[e.a].sides & mesh.vertices[e.b].sides) != 0;
        if (along != (e.left == kOutside || e.right == kOutside)) return "an edge of the border off it, or another on it";
        if (along) length += rbdn::length(mesh.along(e));
    }
    if (std::abs(length - 2 * (w + h)) > 1e-6) return "a border that is not as long as the image's";
    return {};
}

// Every pair of edges, with no grid or list to err.
Fault crossing_edges(const Mesh& mesh) {
    struct Span {
        double x0, x1;
        int edge;
    };
    std::vector<Span> spans;
    for (int k = 0; k < static_cast<int>(mesh.edges.size()); ++k) {
        const double a = mesh.vertices[mesh.edges[k].a].p.x, b = mesh.vertices[mesh.edges[k].b].p.x;
        spans.push_back({std::min(a, b), std::max(a, b), k});
    }
    std::sort(spans.begin(), spans.end(), [](const Span& a, const Span& b) { return a.x0 < b.x0; });
    constexpr double kTiny = 1e-9;
    for (std::size_t i = 0; i < spans.size(); ++i)
        for (std::size_t j = i + 1; j < spans.size() && spans[j].x0 <= spans[i].x1; ++j) {
            const Edge& e = mesh.edges[spans[i].edge];
            const Edge& f = mesh.edges[spans[j].edge];
            if (e.a == f.a || e.a == f.b || e.b == f.a || e.b == f.b) continue;
            const Vec2 a = mesh.vertices[e.a].p, b = mesh.vertices[e.b].p;
            const Vec2 c = mesh.vertices[f.a].p, d = mesh.vertices[f.b].p;
            const double c_of_e = cross(b - a, c - a), d_of_e = cross(b - a, d - a);
            const double a_of_f = cross(d - c, a - c), b_of_f = cross(d - c, b - c);
            const auto apart = [](double u, double v) { return (u > kTiny && v < -kTiny) || (u < -kTiny && v > kTiny); };
            if (apart(c_of_e, d_of_e) && apart(a_of_f, b_of_f)) return "edges that cross";
        }
    return {};
}

// Round every vertex, neighbouring edges must name the same face between them.
Fault torn_wedges(const Mesh& mesh) {
    struct Ray {
        int vertex;
        double angle;
        int before, after;  // faces met just before and after it, as the angle grows
    };
    std::vector<Ray> rays;
    for (const Edge& e : mesh.edges) {
        const Vec2 d = mesh.along(e);
        // With y downwards angles grow clockwise, so the face after an edge lies on the right of who walks out on it.
        rays.push_back({e.a, std::atan2(d.y, d.x), e.left, e.right});
        rays.push_back({e.b, std::atan2(-d.y, -d.x), e.right, e.left});
    }
    std::sort(rays.begin(), rays.end(),
              [](const Ray& a, const Ray& b) { return a.vertex != b.vertex ? a.vertex < b.vertex : a.angle < b.angle; });
    for (std::size_t first = 0, k = 0; k < rays.size(); ++k) {
        const bool last = k + 1 == rays.size() || rays[k + 1].vertex != rays[k].vertex;
        if (rays[k].after != rays[last ? first : k + 1].before) return "edges that disagree about a face";
        if (last) first = k + 1;
    }
    return {};
}

Fault wrong_areas(const Mesh& mesh) {
    std::vector<double> area(mesh.faces.size(), 0.0);
    for (const Edge& e : mesh.edges) {
        const Vec2 a = mesh.vertices[e.a].p, b = mesh.vertices[e.b].p;
        const double swept = 0.5 * (b.x + a.x) * (b.y - a.y);  // to the left border
        if (e.left >= 0) area[e.left] -= swept;
        if (e.right >= 0) area[e.right] += swept;
    }
    double total = 0;
    for (double a : area) {
        if (!(a > 0)) return "a face without area";
        total += a;
    }
    if (std::abs(total - mesh.width * mesh.height) > 1e-6) return "faces that do not add up to the image";
    return {};
}

// V - E + F = 1 + C; in a plane graph, a face in two pieces breaks it.
Fault broken_euler(const Mesh& mesh) {
    std::vector<int> component(mesh.vertices.size(), -1);
    int components = 0;
    for (int start = 0; start < static_cast<int>(mesh.vertices.size()); ++start) {
        if (component[start] >= 0) continue;
        std::vector<int> todo{start};
        component[start] = components;
        while (!todo.empty()) {
            const int v = todo.back();
            todo.pop_back();
            for (int e : mesh.spokes[v]) {
                const int other = mesh.edges[e].a == v ? mesh.edges[e].b : mesh.edges[e].a;
                if (component[other] >= 0) continue;
                component[other] = components;
                todo.push_back(other);
            }
        }
        ++components;
    }
    const auto count = [](const auto& items) { return static_cast<int>(items.size()); };
    if (count(mesh.vertices) - count(mesh.edges) + count(mesh.faces) + 1 != 1 + components)
        return "a face in several pieces";
    return {};
}

Fault fault_of(const rbdn::Tracker& tracker) {
    const Mesh& mesh = tracker.mesh();
    for (const auto& look : {broken_incidence, broken_border, crossing_edges, torn_wedges, wrong_areas, broken_euler})
        if (Fault fault = look(mesh)) return fault;
    if (!tracker.faults().empty()) return "faults that only the engine sees";
    for (int face : tracker.labels())
        if (face < 0 || face >= static_cast<int>(mesh.faces.size())) return "a pixel of no face";
    return {};
}

void refine(const rbdn::Tracker& tracker, const std::vector<std::uint8_t>& image) {
    const Mesh& mesh = tracker.mesh();
    std::vector<int> itself(mesh.faces.size());
    for (std::size_t k = 0; k < itself.size(); ++k) itself[k] = static_cast<int>(k);
    rbdn::Refiner().refine(mesh, image.data(), tracker.labels(), itself, static_cast<int>(itself.size()));
}

std::string run(const std::vector<int>& program, int scale) {
    const auto byte = [&](std::size_t k) { return k < program.size() ? program[k] : 0; };
    const int width = scale * kSizes[byte(2) % 4][0], height = scale * kSizes[byte(2) % 4][1];
    rbdn::Config config;
    config.mode = byte(2) / 4 % 4 == 0 ? rbdn::Mode::kPaper : rbdn::Mode::kOurs;
    config.square_px = 4 + byte(2) / 16 % 4 * 4;
    config.min_area_px = byte(2) / 64 % 2 ? 200.0 : 20.0;
    config.max_polygons = byte(2) / 128 ? 12 : 0;
    Scene scene(static_cast<unsigned>(byte(0) + 256 * byte(1)), width, height);
    rbdn::Tracker tracker(config);
    rbdn::Steps steps(tracker);
    int done = 0;
    bool has_net = false;
    for (std::size_t k = 3; k + 1 < program.size(); k += 2, ++done) {
        const int operation = program[k] % kOperations;
        if (operation == kNextFrame) {
            scene.move();
        } else if (operation == kRefine) {
            if (has_net) refine(tracker, scene.image());
        } else {
            const auto seed = static_cast<std::uint32_t>(program[k + 1] + 256 * (program[k] / kOperations));
            steps.apply(static_cast<rbdn::Step>(operation), seed, scene.image().data(), width, height);
            has_net = true;
            if (Fault fault = fault_of(tracker))
                return *fault + " after operation " + std::to_string(done) + ", number " + std::to_string(operation);
        }
    }
    return "sound " + std::to_string(done);
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 2) return 2;
    const int scale = std::atoi(argv[1]);
    for (std::string line; std::getline(std::cin, line);) {
        std::vector<int> program;
        for (std::size_t k = 0; k + 1 < line.size(); k += 2) program.push_back(std::stoi(line.substr(k, 2), nullptr, 16));
        std::cout << run(program, scale) << std::endl;
    }
}
