// Fragmentation: pixels that fit their polygon no longer are cut out of it, locally (section 3 of the paper).
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "crossings.hpp"
#include "image.hpp"
#include "mesh.hpp"

namespace rbdn {

// Some of an image's pixels.
class PixelSet {
public:
    PixelSet() = default;
    PixelSet(int width, int height)
        : width_(width), height_(height), has_(static_cast<std::size_t>(width) * height, 0) {}

    int width() const { return width_; }
    int height() const { return height_; }
    bool empty() const { return list_.empty(); }
    bool has(int pixel) const { return has_[pixel] != 0; }
    const std::vector<int>& list() const { return list_; }

    void add(int pixel) {
        if (has_[pixel]) return;
        has_[pixel] = 1;
        list_.push_back(pixel);
    }

private:
    int width_ = 0;
    int height_ = 0;
    std::vector<char> has_;
    std::vector<int> list_;
};

// Pixels farther than `gate`, in working units, from their face's mean, as most of their neighbours are. Only where
// the image's lattice finds something are the pixels around it looked at.
PixelSet off_pixels(const Mesh& mesh, const Crossings& crossings, const Image& image, double gate);

// Which off-pixels were cut out before and stayed off: shading and texture, not worth another try.
class OffMemory {
public:
    // Pixels of the blobs that are news: at least `smallest_px` of them, and not mostly tried before at about this
    // size. A thing that enters grows from nothing, so blobs are tried again once they have grown, above all to
    // `lasting_px`, which makes a polygon of its own. Remembers what it was shown.
    std::vector<int> take_news(const PixelSet& off, double smallest_px, double lasting_px);

    // Moves what is remembered: `place(k)` is where pixel k goes, negative for nowhere.
    void move(const std::function<int(int)>& place);

    // The same after a turn of the camera: `source[k]` is the old pixel seen at k, negative for none.
    void turn(std::span<const int> source);

private:
    struct Tried {
        int pixel;
        int size;
        int frames;  // since it was last off
    };

    int tried_near(int pixel) const;
    std::vector<Tried> take_all();
    void remember(const std::vector<Tried>& tried);

    int width_ = 0;
    std::vector<int> tried_px_;   // by pixel: size of its blob when that was last tried, 0 for never
    std::vector<Tried> pixels_;   // those that have one
};

// Cuts pixels out of their faces into faces of their own, in squares, so that the deformation can regroup them.
// Returns how many faces were made.
int fragment_faces(Mesh& mesh, std::vector<int>& labels, const std::vector<int>& pixels, int square_px);

// Labels of the pixels of a turned camera: `source[k]` is the old pixel seen at k, negative where nothing was
// seen; such pixels become new faces, in squares.
std::vector<int> turn_labels(Mesh& mesh, const std::vector<int>& labels, std::span<const int> source,
                             int square_px);

}  // namespace rbdn
