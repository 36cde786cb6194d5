// Follows the frames on standard input and writes the bytes of every result to standard output.
//
// usage: trace_core WIDTH HEIGHT MODE < frames, blue, green, red, row after row
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "refine.hpp"
#include "tracker.hpp"

namespace {

template <class T>
void put(const std::vector<T>& values) {
    std::fwrite(values.data(), sizeof(T), values.size(), stdout);
}

// In the order of test_determinism.py's RESULTS.
void put_results(const rbdn::Tracker& tracker, rbdn::Refiner& refiner, const std::vector<std::uint8_t>& image) {
    const rbdn::RegionSet& regions = tracker.regions();
    const rbdn::Refinement fine = refiner.refine(tracker.mesh(), image.data(), tracker.labels(), regions.of_face,
                                                 static_cast<int>(regions.id.size()));
    const rbdn::Mesh& mesh = fine.mesh;
    std::vector<std::int64_t> ids;
    std::vector<double> vertices, outline, sigmas;
    for (const rbdn::Vertex& v : mesh.vertices) ids.push_back(v.id);
    for (const rbdn::Vec2& p : fine.vertices) vertices.insert(vertices.end(), {p.x - 0.5, p.y - 0.5});
    for (const rbdn::OutlinePoint& p : fine.outline) {
        outline.insert(outline.end(), {p.p.x - 0.5, p.p.y - 0.5});
        sigmas.push_back(p.sigma_px);
    }
    put(regions.id);
    put(ids);
    put(vertices);
    put(fine.area);
    put(fine.area_sigma);
    put(outline);
    put(sigmas);
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 4) return 2;
    const int width = std::atoi(argv[1]), height = std::atoi(argv[2]);
    rbdn::Config config;
    config.mode = std::string(argv[3]) == "paper" ? rbdn::Mode::kPaper : rbdn::Mode::kOurs;
    rbdn::Tracker tracker(config);
    rbdn::Refiner refiner;
    std::vector<std::uint8_t> image(static_cast<std::size_t>(3) * width * height);
    while (std::fread(image.data(), 1, image.size(), stdin) == image.size()) {
        tracker.track(image.data(), width, height, {});
        put_results(tracker, refiner, image);
    }
}
