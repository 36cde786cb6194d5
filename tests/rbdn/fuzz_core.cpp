// Drives the net with random moving scenes under sanitizers and checks it after every frame.
//
// usage: fuzz_core SEQUENCES FRAMES SEED
#include <cstdio>
#include <cstdlib>
#include <random>
#include <vector>

#include "corners.hpp"
#include "loops.hpp"
#include "refine.hpp"
#include "tracker.hpp"

namespace {

constexpr int kWidth = 96;
constexpr int kHeight = 72;

struct Disc {
    double x, y, radius, vx, vy;
    std::uint8_t colour[3];
};

struct Scene {
    std::mt19937 random;
    std::vector<Disc> discs;
    std::uint8_t ground[3];
    int noise;

    explicit Scene(unsigned seed) : random(seed) {
        const auto pick = [&](double low, double high) {
            return low + (high - low) * (random() / 4294967296.0);
        };
        for (auto& c : ground) c = static_cast<std::uint8_t>(random() % 256);
        noise = static_cast<int>(random() % 24);
        for (unsigned k = 0, n = 1 + random() % 6; k < n; ++k) {
            Disc d{pick(0, kWidth), pick(0, kHeight), pick(2, 30), pick(-6, 6), pick(-6, 6), {}};
            for (auto& c : d.colour) c = static_cast<std::uint8_t>(random() % 256);
            discs.push_back(d);
        }
    }

    // Colours are used as if they were CIELAB; the net does not mind.
    std::vector<std::uint8_t> draw() {
        std::vector<std::uint8_t> image(3 * kWidth * kHeight);
        for (int y = 0; y < kHeight; ++y)
            for (int x = 0; x < kWidth; ++x) {
                const std::uint8_t* c = ground;
                for (const Disc& d : discs)
                    if ((x - d.x) * (x - d.x) + (y - d.y) * (y - d.y) < d.radius * d.radius) c = d.colour;
                for (int k = 0; k < 3; ++k) {
                    const int jitter = noise ? static_cast<int>(random() % (2 * noise + 1)) - noise : 0;
                    image[3 * (y * kWidth + x) + k] =
                        static_cast<std::uint8_t>(std::min(255, std::max(0, c[k] + jitter)));
                }
            }
        for (Disc& d : discs) {
            d.x += d.vx;
            d.y += d.vy;
        }
        return image;
    }
};

void fail(const char* what, unsigned seed, int frame) {
    std::fprintf(stderr, "%s: sequence %u, frame %d\n", what, seed, frame);
    std::exit(1);
}

void check(const rbdn::Tracker& tracker, const std::vector<std::uint8_t>& image, unsigned seed, int frame) {
    if (!tracker.faults().empty()) fail("the net is not planar", seed, frame);
    const rbdn::Mesh& mesh = tracker.mesh();
    std::vector<double> area(mesh.faces.size(), 0.0);
    std::vector<int> itself(mesh.faces.size());
    for (std::size_t k = 0; k < itself.size(); ++k) itself[k] = static_cast<int>(k);
    std::vector<int> outer(mesh.faces.size(), 0);
    double total = 0;
    for (const rbdn::Loop& loop : rbdn::trace_loops(mesh, itself)) {
        area[loop.face] += loop.area;
        outer[loop.face] += loop.area > 0;
        total += loop.area;
    }
    if (std::abs(total - kWidth * kHeight) > 1e-6) fail("the faces do not fill the image", seed, frame);
    for (std::size_t k = 0; k < area.size(); ++k) {
        if (area[k] <= 0) fail("a face has no area", seed, frame);
        if (outer[k] != 1) fail("a face is not in one piece", seed, frame);
    }
    rbdn::LinearImage linear;
    linear.load(image.data(), kWidth, kHeight);
    const auto& regions = tracker.regions();
    rbdn::refine(rbdn::with_whole_corners(mesh), linear, tracker.labels(), regions.of_face,
                 static_cast<int>(regions.id.size()));
}

std::vector<int> random_turn(std::mt19937& random) {
    const int dx = static_cast<int>(random() % 41) - 20, dy = static_cast<int>(random() % 41) - 20;
    std::vector<int> source(kWidth * kHeight, -1);
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x)
            if (x + dx >= 0 && x + dx < kWidth && y + dy >= 0 && y + dy < kHeight)
                source[y * kWidth + x] = (y + dy) * kWidth + x + dx;
    return source;
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 4) return 2;
    const int sequences = std::atoi(argv[1]), frames = std::atoi(argv[2]);
    const auto first = static_cast<unsigned>(std::atoi(argv[3]));
    for (int s = 0; s < sequences; ++s) {
        const unsigned seed = first + static_cast<unsigned>(s);
        Scene scene(seed);
        rbdn::Tracker tracker{rbdn::Config{}};
        for (int frame = 0; frame < frames; ++frame) {
            const std::vector<std::uint8_t> image = scene.draw();
            const bool turn = scene.random() % 8 == 0;
            tracker.track(image.data(), kWidth, kHeight, turn ? random_turn(scene.random) : std::vector<int>{});
            check(tracker, image, seed, frame);
        }
    }
    std::printf("%d sequences of %d frames: sound\n", sequences, frames);
}
