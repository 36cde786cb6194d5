// Fragmentation: pixels that fit their polygon no longer are cut out of it, locally (section 3 of the paper).
#include "fragment.hpp"

#include <algorithm>
#include <map>
#include <tuple>

namespace rbdn {

namespace {

constexpr int kSmallestBlob = 60;   // px; below this, off-pixels are noise
constexpr int kSmallestPiece = 20;  // px; smaller cuttings stay with their face
constexpr int kSpread = 3;          // px by which known off-pixels may have moved
constexpr int kCoarse = 2;          // px between the samples that are looked at first

struct Blob {
    int first;  // range of BlobList::pixels
    int last;
};

struct BlobList {
    std::vector<int> pixels;
    std::vector<Blob> blobs;
};

// Connected sets of pixels, four neighbours each.
BlobList find_blobs(const PixelSet& set) {
    BlobList list;
    PixelSet seen(set.width(), set.height());
    const auto visit = [&](bool inside, int k) {
        if (inside && set.has(k)) seen.add(k);
    };
    for (int start : set.list()) {
        const int first = static_cast<int>(seen.list().size());
        visit(true, start);
        for (int n = first; n < static_cast<int>(seen.list().size()); ++n) {
            const int k = seen.list()[n], x = k % set.width(), y = k / set.width();
            visit(x > 0, k - 1);
            visit(x + 1 < set.width(), k + 1);
            visit(y > 0, k - set.width());
            visit(y + 1 < set.height(), k + set.width());
        }
        const int last = static_cast<int>(seen.list().size());
        if (last > first) list.blobs.push_back({first, last});
    }
    list.pixels = seen.list();
    return list;
}

bool is_near(const PixelSet& set, int pixel) {
    if (set.empty()) return false;
    const int x = pixel % set.width(), y = pixel / set.width();
    for (int j = std::max(0, y - kSpread); j <= std::min(set.height() - 1, y + kSpread); ++j)
        for (int i = std::max(0, x - kSpread); i <= std::min(set.width() - 1, x + kSpread); ++i)
            if (set.has(j * set.width() + i)) return true;
    return false;
}

// Finds the pixels far from their face's mean, by a coarse look first and a close one where that found something.
class FarSearch {
public:
    FarSearch(const Mesh& mesh, const Crossings& crossings, const Image& image, double gate)
        : mesh_(mesh), crossings_(crossings), image_(image), gate2_(static_cast<float>(gate * gate)),
          far_(mesh.width, mesh.height) {}

    PixelSet run() {
        std::vector<int> above, here;  // places found on the coarse rows
        for (int y = 0; y < mesh_.height; y += kCoarse) {
            look_coarsely(y, here);
            if (y > 0) {
                look_closely(y - 1, above);
                look_closely(y - 1, here);
            }
            look_closely(y, here);
            if (y + 2 == mesh_.height) look_closely(y + 1, here);
            above.swap(here);
        }
        return std::move(far_);
    }

private:
    void look_coarsely(int y, std::vector<int>& places) const {
        places.clear();
        const auto line = crossings_.rows().line(y);
        const std::uint8_t* row = image_.row(y);
        for (std::size_t n = 0; n + 1 < line.size(); ++n) {
            const Colour mean = mesh_.faces[line[n].after].mean;
            for (int x = (line[n].pixel + kCoarse - 1) / kCoarse * kCoarse; x < line[n + 1].pixel; x += kCoarse)
                if (distance2(image_.colour_of(row + 3 * x), mean) > gate2_) places.push_back(x);
        }
    }

    void look_closely(int y, const std::vector<int>& places) {
        const auto line = crossings_.rows().line(y);
        const std::uint8_t* row = image_.row(y);
        std::size_t n = 0;
        for (int place : places)
            for (int x = std::max(0, place - 1); x <= std::min(place + 1, mesh_.width - 1); ++x) {
                while (line[n + 1].pixel <= x) ++n;
                if (distance2(image_.colour_of(row + 3 * x), mesh_.faces[line[n].after].mean) > gate2_)
                    far_.add(y * mesh_.width + x);
            }
    }

    const Mesh& mesh_;
    const Crossings& crossings_;
    const Image& image_;
    float gate2_;
    PixelSet far_;
};

// Gives the chosen pixels new faces, one for each host face and square of the image.
int cut_squares(Mesh& mesh, std::vector<int>& labels, const std::vector<int>& pixels, int square_px,
                int smallest_piece) {
    const int width = mesh.width;
    std::map<std::tuple<int, int, int>, std::vector<int>> pieces;
    for (int p : pixels) pieces[{labels[p], p / width / square_px, p % width / square_px}].push_back(p);
    int made = 0;
    for (const auto& [key, piece] : pieces) {
        if (static_cast<int>(piece.size()) < smallest_piece) continue;
        const int host = std::get<0>(key);
        const int face = mesh.add_face();
        mesh.faces[face].is_news = true;
        if (host >= 0) {
            mesh.faces[face].mean = mesh.faces[host].mean;
            mesh.faces[face].parent =
                mesh.faces[host].region >= 0 ? mesh.faces[host].region : mesh.faces[host].parent;
        }
        for (int p : piece) labels[p] = face;
        ++made;
    }
    return made;
}

}  // namespace

PixelSet off_pixels(const Mesh& mesh, const Crossings& crossings, const Image& image, double gate) {
    const PixelSet far = FarSearch(mesh, crossings, image, gate).run();
    const int width = mesh.width, height = mesh.height;
    PixelSet off(width, height);
    for (int k : far.list()) {
        const int x = k % width, y = k / width;
        if (x == 0 || y == 0 || x + 1 == width || y + 1 == height) continue;
        int votes = 0;
        for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx) votes += far.has(k + dy * width + dx);
        if (votes >= 5) off.add(k);
    }
    return off;
}

std::vector<int> new_off_pixels(const PixelSet& off, const PixelSet& known) {
    const BlobList list = find_blobs(off);
    std::vector<int> chosen;
    for (const Blob& blob : list.blobs) {
        const int size = blob.last - blob.first;
        if (size < kSmallestBlob) continue;
        const auto begin = list.pixels.begin() + blob.first, end = list.pixels.begin() + blob.last;
        const auto covered = std::count_if(begin, end, [&](int k) { return is_near(known, k); });
        if (2 * covered < size) chosen.insert(chosen.end(), begin, end);
    }
    return chosen;
}

int fragment_faces(Mesh& mesh, std::vector<int>& labels, const std::vector<int>& pixels, int square_px) {
    return cut_squares(mesh, labels, pixels, square_px, kSmallestPiece);
}

std::vector<int> turn_labels(Mesh& mesh, const std::vector<int>& labels, const std::vector<int>& source,
                             int square_px) {
    std::vector<int> turned(labels.size(), kOutside);
    std::vector<int> unseen;
    for (int k = 0; k < static_cast<int>(labels.size()); ++k) {
        if (source[k] >= 0)
            turned[k] = labels[source[k]];
        else
            unseen.push_back(k);
    }
    cut_squares(mesh, turned, unseen, square_px, 1);
    return turned;
}

}  // namespace rbdn
