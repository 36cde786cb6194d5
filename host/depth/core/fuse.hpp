// One depth from several methods, and from the frames before.
//
// Methods look at the same outline, so their errors are correlated: the combined sigma is computed with
// that correlation and never pretends to independent evidence. Over time a region's last answer, moved
// along with the camera, is averaged with the new one as if both shared all their errors: weights by
// sigma, sigma the weighted mean. Every method already uses all frames of the run, so nothing is lost, and
// no number of frames taken at rest can sharpen an answer.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "answer.hpp"
#include "path.hpp"

namespace depth {

enum class Method { area, vertex, outline };
inline constexpr std::array<const char*, 3> METHOD_NAMES{"area", "vertex", "outline"};

struct Fused {
    double depth_cm = 0.0, sigma_cm = 0.0;
    Method method = Method::outline;  // with the greatest weight
    std::string note;                 // what speaks against it; empty where nothing does
};

// Mean of least variance of the methods' answers, in the order of `Method`; one that contradicts the outline is left
// out and named. The outline forgives what the others do not see: an edge that vanished, a corner that
// slid, an area that took in a shadow. Without it the vertices are the measure; an area alone is none.
std::optional<Fused> combine(const std::array<const Answer*, 3>& answers);

struct FuseConfig {
    double memory_share_per_cm = 0.002;  // how quickly old answers are forgotten
    double max_relative_sigma = 0.3;
    double min_step_cm = 0.3;  // nearer than this to where it was measured nothing new is learnt
};

// The last answer of every region, carried along with the camera.
class Memory {
  public:
    explicit Memory(const FuseConfig& config) : config_(config) {}

    void forget(std::int64_t id) { last_.erase(id); }
    void forget_unseen(int present);

    // What the last answer is worth from here, if there is one.
    std::optional<Fused> predict(std::int64_t id, const Path& path, int present) const;

    // Averages the new answer with the remembered one, or carries that on with a larger sigma if it was confirmed.
    //
    // ray: towards the region's middle, third component 1
    std::optional<Fused> update(std::int64_t id, const std::optional<Fused>& measured, Vec3 ray, const Path& path,
                                int present);

    std::set<int> frames() const;

  private:
    struct Remembered {
        Fused fused;
        Vec3 ray;
        int frame;
        int measured = 1;  // so many times, one after the other in agreement
    };
    FuseConfig config_;
    std::map<std::int64_t, Remembered> last_;
};

}  // namespace depth
