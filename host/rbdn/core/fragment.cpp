// Fragmentation: pixels that fit their polygon no longer are cut out of it, locally (section 3 of the paper).
#include "fragment.hpp"

#include <algorithm>
#include <map>
#include <tuple>

namespace rbdn {

namespace {

constexpr int kSampleArea = OffMap::kStep * OffMap::kStep;
constexpr int kSmallestBlob = 60 / kSampleArea;  // samples; below this, off-pixels are noise
constexpr int kSmallestPiece = 20;  // px; smaller cuttings stay with their face
constexpr int kSpread = 2;          // samples by which known off-pixels may have moved

struct Blob {
    int first;  // range of BlobList::samples
    int last;
};

struct BlobList {
    std::vector<int> samples;
    std::vector<Blob> blobs;
};

// Connected sets of off-samples, four neighbours each.
BlobList find_blobs(const OffMap& map) {
    BlobList list;
    std::vector<char> left = map.off;
    const auto begin = left.begin();
    for (auto next = std::find(begin, left.end(), 1); next != left.end(); next = std::find(next, left.end(), 1)) {
        const int first = static_cast<int>(list.samples.size());
        const auto visit = [&](bool inside, int k) {
            if (!inside || !left[k]) return;
            left[k] = 0;
            list.samples.push_back(k);
        };
        visit(true, static_cast<int>(next - begin));
        for (int n = first; n < static_cast<int>(list.samples.size()); ++n) {
            const int k = list.samples[n], x = k % map.width, y = k / map.width;
            visit(x > 0, k - 1);
            visit(x + 1 < map.width, k + 1);
            visit(y > 0, k - map.width);
            visit(y + 1 < map.height, k + map.width);
        }
        list.blobs.push_back({first, static_cast<int>(list.samples.size())});
    }
    return list;
}

bool is_near_off(const OffMap& map, int sample) {
    const int x = sample % map.width, y = sample / map.width;
    for (int j = std::max(0, y - kSpread); j <= std::min(map.height - 1, y + kSpread); ++j)
        for (int i = std::max(0, x - kSpread); i <= std::min(map.width - 1, x + kSpread); ++i)
            if (map.off[static_cast<std::size_t>(j) * map.width + i]) return true;
    return false;
}

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

OffMap off_pixels(const Mesh& mesh, const Crossings& crossings, const Image& image, double gate) {
    constexpr int kStep = OffMap::kStep;
    const auto gate2 = static_cast<float>(gate * gate);
    OffMap map;
    map.width = (mesh.width + kStep - 1) / kStep;
    map.height = (mesh.height + kStep - 1) / kStep;
    std::vector<char> far(static_cast<std::size_t>(map.width) * map.height, 0);
    for (int j = 0; j < map.height; ++j) {
        const auto line = crossings.rows().line(j * kStep);
        const std::uint8_t* row = image.row(j * kStep);
        char* marks = far.data() + static_cast<std::size_t>(j) * map.width;
        for (std::size_t n = 0; n + 1 < line.size(); ++n) {
            const Colour mean = mesh.faces[line[n].after].mean;
            const int last = (line[n + 1].pixel + kStep - 1) / kStep;
            for (int i = (line[n].pixel + kStep - 1) / kStep; i < last; ++i)
                marks[i] = distance2(image.colour_of(row + 3 * kStep * i), mean) > gate2;
        }
    }
    map.off.assign(far.size(), 0);
    for (int j = 1; j + 1 < map.height; ++j) {
        const auto begin = far.begin() + static_cast<std::ptrdiff_t>(j) * map.width, last = begin + map.width - 1;
        for (auto next = std::find(begin + 1, last, 1); next != last; next = std::find(next + 1, last, 1)) {
            int votes = 0;
            for (int dy = -1; dy <= 1; ++dy)
                for (int dx = -1; dx <= 1; ++dx) votes += *(next + dy * map.width + dx);
            map.off[next - far.begin()] = votes >= 5;
        }
    }
    return map;
}

std::vector<int> new_off_pixels(const Mesh& mesh, const OffMap& off, const OffMap& known) {
    constexpr int kStep = OffMap::kStep;
    const BlobList list = find_blobs(off);
    std::vector<int> pixels;
    for (const Blob& blob : list.blobs) {
        const int size = blob.last - blob.first;
        if (size < kSmallestBlob) continue;
        const auto begin = list.samples.begin() + blob.first, end = list.samples.begin() + blob.last;
        const auto covered =
            known.off.empty() ? 0 : std::count_if(begin, end, [&](int k) { return is_near_off(known, k); });
        if (2 * covered >= size) continue;
        for (auto k = begin; k != end; ++k) {
            const int x0 = *k % off.width * kStep, y0 = *k / off.width * kStep;
            for (int y = y0; y < std::min(y0 + kStep, mesh.height); ++y)
                for (int x = x0; x < std::min(x0 + kStep, mesh.width); ++x) pixels.push_back(y * mesh.width + x);
        }
    }
    return pixels;
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
