// Random runs through the parts of the depth engine, for sanitizers: odd loops, jumps, regions that come and go.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>

#include "area.hpp"
#include "lens.hpp"
#include "path.hpp"
#include "polygon.hpp"
#include "relief.hpp"
#include "vertex.hpp"

using namespace depth;

namespace {

class Fuzz {
  public:
    explicit Fuzz(unsigned seed) : random_(seed) {}

    // Many points without the lens's distortion, together as one by one.
    void straighten() {
        const double wild = chance(0.3) ? 1.0 : 0.2;  // where it turns the picture over, too
        const Lens lens(280.0, 275.0, 158.0, 121.0,
                        {wild * normal(), wild * normal(), 0.01 * normal(), 0.01 * normal(), wild * normal()});
        std::vector<Vec2> px(static_cast<std::size_t>(pick(20))), together(px.size());
        for (Vec2& p : px) p = {-50 + 420 * uniform(), -50 + 340 * uniform()};
        lens.ideal(px.data(), px.size(), together.data());
        for (std::size_t i = 0; i < px.size(); ++i) {
            const Vec2 alone = lens.ideal(px[i]);
            require(std::memcmp(&alone, &together[i], sizeof alone) == 0);
        }
    }

    // One run.
    void run() {
        const Camera camera{320, 240, 371.0, 371.0, 159.5, 119.5};
        AreaConfig areas;
        VertexConfig vertices;
        areas.history = 1 + pick(10);
        vertices.history = 1 + pick(10);
        Path path({});
        AreaMethod area(camera, areas);
        VertexMethod vertex(camera, vertices);
        Vec3 place;
        for (int frame = 0, last = 1 + pick(60); frame < last; ++frame) {
            place = place + Vec3{0.2 * normal(), 0.1 * normal(), chance(0.1) ? -3.0 : 1.0 * uniform()};
            const double wild = chance(0.05) ? 1.0 : 0.02;
            path.add(frame, rotation_by({wild * normal(), wild * normal(), wild * normal()}), place, 0.1 * frame,
                     chance(0.1) ? 0.5 : 0.0, 0.0);
            const FrameView view = see(frame);
            area.forget_unseen(frame);
            if (chance(0.05)) area.forget(pick(6));
            const VertexDepths found = vertex.update(view, path, frame);
            for (const Vec3 p : found.xyz_cm) require(std::isnan(p.z) || p.z > 0);
            for (const RegionView& region : view.regions) {
                const double own = chance(0.2) ? uniform() : 1.0;
                take(area.update(region, view, path, frame, own));
                take(vertex.region(region, view, found, own));
                for (const bool cut : {false, true}) require(std::isfinite(relief_of(region.loops.front(), cut).k));
                may_be_one_face(region.loops.front());
                mean_of_inverse(region.loops, 0.01, 1e-5 * normal(), 1e-5 * normal());
            }
            std::set<int> needed = area.frames();
            needed.merge(vertex.frames());
            path.keep(needed);
        }
    }

    int answers = 0;
    double sum = 0.0;  // of depths and sigmas

  private:
    double uniform() { return std::uniform_real_distribution<double>(0, 1)(random_); }
    double normal() { return std::normal_distribution<double>(0, 1)(random_); }
    int pick(int below) { return static_cast<int>(uniform() * below); }
    bool chance(double share) { return uniform() < share; }

    static void require(bool true_of_all) {
        if (!true_of_all) std::abort();
    }

    void take(const Answer& a) {
        if (!a.known()) return;
        require(a.depth_cm > 0 && a.sigma_cm > 0 && a.sensitivity > 0 && std::isfinite(a.depth_cm + a.sigma_cm));
        ++answers;
        sum += a.depth_cm + a.sigma_cm + a.sensitivity;
    }

    FrameView see(int frame) {
        FrameView view;
        view.seq = frame;
        for (int id = 0; id < 6; ++id) {
            if (chance(0.1)) continue;
            RegionView region;
            region.id = id;
            region.loops.push_back(loop(id, frame));
            if (chance(0.2)) region.loops.push_back(loop(id, frame));
            region.polygon_px = polygon_area(region.loops);
            region.area_px = region.polygon_px * (1 + 0.001 * normal());
            region.sigma_area_px = chance(0.1) ? 0.0 : 5 * uniform();
            region.touches_border = chance(0.1);
            for (std::size_t k = 0; k < region.loops.front().size(); ++k) {
                region.corners.push_back(100 * id + static_cast<int>(k));
                if (chance(0.1)) continue;  // a corner that the frame does not list
                view.vertex_ids.push_back(region.corners.back());
                view.vertex_px.push_back(region.loops.front()[k]);
                view.vertex_sigma_px.push_back(chance(0.1) ? NAN : 0.1 * uniform());
            }
            if (chance(0.05)) view.changed.push_back(id);
            view.regions.push_back(region);
        }
        return view;
    }

    Loop loop(int id, int frame) {
        const int shape = pick(60);
        if (shape == 0) return Loop(static_cast<std::size_t>(1 + pick(5)), Vec2{10, 10});  // no area
        if (shape == 1) return {{10, 10}, {20, 20}, {30, 30}, {20, 20}};                     // a line
        if (shape == 2) return {{0, 0}, {50, 50}, {50, 0}, {0, 50}};                         // crosses itself
        Loop out;
        const double size = 40 / (1 - 0.01 * std::min(frame, 60));
        const int corners = chance(0.9) ? 3 + 5 * id : 3 + pick(40);
        for (int k = 0; k < corners; ++k) {
            const double a = 2 * M_PI * k / corners;
            out.push_back({60.0 + 30 * id + size * std::cos(a) + 0.1 * normal(), 100 + size * std::sin(a) + 0.1 * normal()});
        }
        return out;
    }

    std::mt19937 random_;
};

}  // namespace

int main(int, char** argv) {
    int answers = 0;
    double sum = 0.0;
    for (int seed = 0; seed < std::atoi(argv[1]); ++seed) {
        Fuzz fuzz(static_cast<unsigned>(seed));
        for (int lens = 0; lens < 50; ++lens) fuzz.straighten();
        fuzz.run();
        answers += fuzz.answers;
        sum += fuzz.sum;
    }
    std::printf("%d answers %.17g\n", answers, sum);
}
