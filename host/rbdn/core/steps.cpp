// The net's operations one at a time, so that tests can string them together in any order.
#include "steps.hpp"

#include <random>
#include <set>

#include "vectorise.hpp"

namespace rbdn {

namespace {

// Numbers that are the same everywhere, which the standard's distributions are not.
class Chance {
public:
    explicit Chance(std::uint32_t seed) : engine_(seed) {}
    int below(int count) { return static_cast<int>(engine_() % static_cast<std::uint32_t>(count)); }
    double between(double low, double high) { return low + (high - low) * (engine_() / 4294967296.0); }

private:
    std::mt19937 engine_;
};

}  // namespace

void Steps::apply(Step step, std::uint32_t seed, const std::uint8_t* bgr, int width, int height) {
    if (step == Step::kTrack) {
        t_.track(bgr, width, height, {});
        return;
    }
    look_at(bgr, width, height);
    switch (step) {
        case Step::kMove: move(seed); break;
        case Step::kDeform: t_.deform(2 + static_cast<int>(seed % 12), 1 + static_cast<int>(seed / 12 % 4), false); break;
        case Step::kInsert: {
            const std::vector<Disparity> d = t_.disparity(t_.config_.start_reach_px, Which::kAllEdges);
            transact([&](Mesh& mesh, const Spared& spared) { return insert_vertices(mesh, d, spared); });
            break;
        }
        case Step::kDelete: transact(delete_vertices); break;
        case Step::kZip: transact(zip_thorns); break;
        case Step::kSnap: transact(snap_contacts); break;
        case Step::kSnapToBorder: transact(snap_to_border); break;
        case Step::kMerge: t_.merge(); break;
        case Step::kVectorise: vectorise(t_.mesh_, t_.crossings_, t_.labels_); break;
        case Step::kFragment: fragment(seed); break;
        case Step::kTurn: turn(seed); break;
        case Step::kDisplace: displace(seed); break;
        case Step::kTrack: break;
    }
    tidy();
}

const std::vector<Disparity>& Steps::measure(const std::uint8_t* bgr, int width, int height, int reach_px) {
    look_at(bgr, width, height);
    return t_.disparity(reach_px, Which::kAllEdges);
}

void Steps::look_at(const std::uint8_t* bgr, int width, int height) {
    t_.see(bgr, width, height, true);
    if (t_.mesh_.vertices.empty()) {
        t_.mesh_.make_grid(width, height, t_.config_.square_px);
        t_.crossings_.build(t_.mesh_);
        t_.crossings_.face_of_pixels(t_.mesh_, t_.labels_);
    }
    t_.update_means();
}

void Steps::tidy() {
    t_.split();
    if (t_.mesh_.compact_faces()) t_.crossings_.build(t_.mesh_);
    t_.update_means();
    t_.crossings_.face_of_pixels(t_.mesh_, t_.labels_);
}

void Steps::move(std::uint32_t seed) {
    Chance chance(seed);
    const double longest = chance.between(0.2, 1.0) * (chance.below(4) == 0 ? 20.0 : 2.0);
    const int one_in = 1 + chance.below(4);
    std::vector<Vec2> moves(t_.mesh_.vertices.size());
    for (Vec2& m : moves)
        if (chance.below(one_in) == 0) m = {chance.between(-longest, longest), chance.between(-longest, longest)};
    displace_vertices(t_.mesh_, moves);
    settle_moves(t_.mesh_, t_.crossings_);
}

void Steps::fragment(std::uint32_t seed) {
    Chance chance(seed);
    const Mesh& mesh = t_.mesh_;
    const double x0 = chance.between(0, mesh.width), y0 = chance.between(0, mesh.height);
    const double radius = chance.between(1.0, 16.0);
    std::vector<int> pixels;
    for (int y = 0; y < mesh.height; ++y)
        for (int x = 0; x < mesh.width; ++x)
            if ((x - x0) * (x - x0) + (y - y0) * (y - y0) < radius * radius) pixels.push_back(y * mesh.width + x);
    fragment_faces(t_.mesh_, t_.labels_, pixels, 4 + chance.below(12));
    vectorise(t_.mesh_, t_.crossings_, t_.labels_);
}

void Steps::turn(std::uint32_t seed) {
    Chance chance(seed);
    const int width = t_.mesh_.width, height = t_.mesh_.height;
    const int dx = chance.below(width) - width / 2, dy = chance.below(height) - height / 2;
    std::vector<int> source(t_.labels_.size(), -1);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            if (x + dx >= 0 && x + dx < width && y + dy >= 0 && y + dy < height)
                source[static_cast<std::size_t>(y) * width + x] = (y + dy) * width + x + dx;
    t_.labels_ = turn_labels(t_.mesh_, t_.labels_, source, t_.config_.square_px);
    vectorise(t_.mesh_, t_.crossings_, t_.labels_);
}

void Steps::displace(std::uint32_t seed) {
    Chance chance(seed);
    const double longest = chance.between(1.0, 12.0);
    std::vector<Displacement> displacements;
    std::set<std::int64_t> regions;
    for (const Face& face : t_.mesh_.faces)
        if (face.region >= 0 && chance.below(2) == 0 && regions.insert(face.region).second)
            displacements.push_back(
                {face.region, {chance.between(-longest, longest), chance.between(-longest, longest)}});
    t_.displace(displacements);
}

void Steps::transact(const Operation& operation) {
    t_.saved_ = t_.mesh_;
    rbdn::transact(t_.mesh_, t_.crossings_, t_.saved_, operation);
}

}  // namespace rbdn
