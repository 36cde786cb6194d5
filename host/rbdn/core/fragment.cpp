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

struct Blob {
    int first;  // range of BlobList::pixels
    int last;
};

struct BlobList {
    std::vector<int> pixels;
    std::vector<Blob> blobs;
};

// Connected sets of marked pixels, four neighbours each.
BlobList find_blobs(const std::vector<char>& marked, int width, int height) {
    BlobList list;
    std::vector<char> seen(marked.size(), 0);
    for (int start = 0; start < static_cast<int>(marked.size()); ++start) {
        if (!marked[start] || seen[start]) continue;
        const int first = static_cast<int>(list.pixels.size());
        list.pixels.push_back(start);
        seen[start] = 1;
        for (int k = first; k < static_cast<int>(list.pixels.size()); ++k) {
            const int p = list.pixels[k], x = p % width, y = p / width;
            const auto visit = [&](bool inside, int q) {
                if (!inside || !marked[q] || seen[q]) return;
                seen[q] = 1;
                list.pixels.push_back(q);
            };
            visit(x > 0, p - 1);
            visit(x + 1 < width, p + 1);
            visit(y > 0, p - width);
            visit(y + 1 < height, p + width);
        }
        list.blobs.push_back({first, static_cast<int>(list.pixels.size())});
    }
    return list;
}

std::vector<char> spread(const std::vector<char>& marked, int width, int height, int radius) {
    std::vector<char> across(marked.size(), 0), out(marked.size(), 0);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            if (!marked[static_cast<std::size_t>(y) * width + x]) continue;
            for (int k = std::max(0, x - radius); k <= std::min(width - 1, x + radius); ++k)
                across[static_cast<std::size_t>(y) * width + k] = 1;
        }
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            if (!across[static_cast<std::size_t>(y) * width + x]) continue;
            for (int k = std::max(0, y - radius); k <= std::min(height - 1, y + radius); ++k)
                out[static_cast<std::size_t>(k) * width + x] = 1;
        }
    return out;
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

std::vector<char> off_pixels(const Mesh& mesh, const Crossings& crossings, const Image& image, double gate) {
    const int width = mesh.width, height = mesh.height;
    const auto gate2 = static_cast<float>(gate * gate);
    std::vector<char> far(static_cast<std::size_t>(width) * height, 0);
    for (int y = 0; y < height; ++y) {
        const auto line = crossings.rows().line(y);
        const Pixel* row = &image.at(0, y);
        char* marks = far.data() + static_cast<std::size_t>(y) * width;
        for (std::size_t i = 0; i + 1 < line.size(); ++i) {
            const Colour mean = mesh.faces[line[i].after].mean;
            for (int x = line[i].pixel; x < line[i + 1].pixel; ++x)
                marks[x] = distance2(row[x], mean) > gate2;
        }
    }
    std::vector<char> off(far.size(), 0);
    for (int y = 1; y + 1 < height; ++y)
        for (int x = 1; x + 1 < width; ++x) {
            const std::size_t k = static_cast<std::size_t>(y) * width + x;
            if (!far[k]) continue;
            int votes = 0;
            for (int dy = -1; dy <= 1; ++dy)
                for (int dx = -1; dx <= 1; ++dx) votes += far[k + dy * width + dx];
            off[k] = votes >= 5;
        }
    return off;
}

int fragment_faces(Mesh& mesh, std::vector<int>& labels, const std::vector<char>& off,
                   const std::vector<char>& known, int square_px) {
    const BlobList list = find_blobs(off, mesh.width, mesh.height);
    const std::vector<char> old = known.empty() ? std::vector<char>(off.size(), 0)
                                                : spread(known, mesh.width, mesh.height, kSpread);
    std::vector<int> chosen;
    for (const Blob& blob : list.blobs) {
        const int size = blob.last - blob.first;
        if (size < kSmallestBlob) continue;
        const auto begin = list.pixels.begin() + blob.first, end = list.pixels.begin() + blob.last;
        const auto covered = std::count_if(begin, end, [&](int p) { return old[p] != 0; });
        if (2 * covered < size) chosen.insert(chosen.end(), begin, end);
    }
    return cut_squares(mesh, labels, chosen, square_px, kSmallestPiece);
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
