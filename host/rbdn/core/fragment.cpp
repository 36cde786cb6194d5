// Fragmentation: pixels that fit their polygon no longer are cut out of it, locally (section 3 of the paper).
#include "fragment.hpp"

#include <algorithm>
#include <cstring>
#include <map>
#include <tuple>
#include <utility>

namespace rbdn {

namespace {

constexpr int kSmallestPiece = 20;  // px; smaller cuttings stay with their face
constexpr int kSpread = 4;          // px by which known off-pixels may have moved
constexpr double kGrowth = 1.25;    // of a blob, after which it is tried again
constexpr int kRememberedFrames = 5;  // in which a blob was not off: near the gate, noise lets blobs come and go
constexpr int kTogether = 16;       // px that are passed over in one go
constexpr int kCoarse = 2;          // px, at least, between the samples that are looked at first

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

// Finds the pixels far from their face's mean: on the lattice first, then beside what was found there.
class FarSearch {
public:
    FarSearch(const Mesh& mesh, const Crossings& crossings, const Image& image, double gate)
        : mesh_(mesh), crossings_(crossings), image_(image), gate2_(static_cast<int>(gate * gate)),
          row_step_(std::max(kCoarse, image.row_step())), column_step_(std::max(kCoarse, image.column_step())),
          marks_(mesh.width), far_(mesh.width, mesh.height) {}

    PixelSet run() {
        std::vector<int> above, here, both;
        for (int y = 0; y < mesh_.height; y += row_step_) {
            look_on_lattice(y, here);
            both.clear();
            std::set_union(above.begin(), above.end(), here.begin(), here.end(), std::back_inserter(both));
            for (int between = std::max(0, y - row_step_ + 1); between < y; ++between) look_closely(between, both);
            look_closely(y, here);
            above.swap(here);
        }
        const int last = (mesh_.height - 1) / row_step_ * row_step_;
        for (int below = last + 1; below < mesh_.height; ++below) look_closely(below, above);
        return std::move(far_);
    }

private:
    void look_on_lattice(int y, std::vector<int>& places) {
        places.clear();
        // Of the lattice's own steps, of which ours are whole multiples.
        const int step = image_.column_step(), stride = column_step_ / step;
        const auto line = crossings_.rows().line(y);
        for (std::size_t n = 0; n + 1 < line.size(); ++n) {
            const int first = (line[n].pixel + step - 1) / step, last = (line[n + 1].pixel + step - 1) / step;
            if (first < last)
                image_.mark_far(y, first, last, to_short(mesh_.faces[line[n].after].mean), gate2_, marks_.data());
        }
        const int count = (mesh_.width + step - 1) / step;
        for (int k = 0; k < count; k += stride) {
            std::uint64_t eight = 0;  // mostly none of so many is far
            while (k + 8 <= count && (std::memcpy(&eight, &marks_[k], 8), eight == 0)) k += 8;
            if (k < count && marks_[k]) places.push_back(k * step);
        }
    }

    void look_closely(int y, const std::vector<int>& places) {
        const auto line = crossings_.rows().line(y);
        const std::uint8_t* row = image_.row(y);
        std::size_t n = 0;
        ShortColour mean{};
        std::size_t mean_of = line.size();
        int next = 0;  // the first pixel not looked at yet
        for (int place : places)
            for (int x = std::max(next, place - column_step_ + 1);
                 x <= std::min(place + column_step_ - 1, mesh_.width - 1); ++x) {
                next = x + 1;
                while (line[n + 1].pixel <= x) ++n;
                if (n != mean_of) mean = to_short(mesh_.faces[line[mean_of = n].after].mean);
                if (distance2(image_.short_colour_of(row + 3 * x), mean) > gate2_)
                    far_.add(y * mesh_.width + x);
            }
    }

    const Mesh& mesh_;
    const Crossings& crossings_;
    const Image& image_;
    int gate2_;
    int row_step_;
    int column_step_;
    std::vector<std::uint8_t> marks_;  // places of the row that is looked at, that are far
    PixelSet far_;
};

// Gives the chosen pixels new faces, one for each host face and square of the image.
int cut_squares(Mesh& mesh, std::vector<int>& labels, const std::vector<int>& pixels, int square_px,
                int smallest_piece) {
    const int width = mesh.width;
    std::map<std::tuple<int, int, int>, std::vector<int>> pieces;
    // Neighbours mostly go to the same piece.
    std::vector<int>* last = nullptr;
    int last_host = 0, x0 = 0, x1 = 0, y0 = 0, y1 = 0;
    for (int p : pixels) {
        const int x = p % width, y = p / width, host = labels[p];
        if (last == nullptr || host != last_host || x < x0 || x >= x1 || y < y0 || y >= y1) {
            const int column = x / square_px, row = y / square_px;
            last = &pieces[{host, row, column}];
            last_host = host;
            x0 = column * square_px;
            x1 = x0 + square_px;
            y0 = row * square_px;
            y1 = y0 + square_px;
        }
        last->push_back(p);
    }
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

std::vector<int> OffMemory::take_news(const PixelSet& off, double smallest_px, double lasting_px) {
    std::vector<int> news;
    std::vector<Tried> shown;
    const BlobList list = find_blobs(off);
    for (const Blob& blob : list.blobs) {
        const int size = blob.last - blob.first;
        const auto begin = list.pixels.begin() + blob.first, end = list.pixels.begin() + blob.last;
        int covered = 0, tried = 0;
        for (auto pixel = begin; pixel != end && !pixels_.empty(); ++pixel)
            if (const int near = tried_near(*pixel)) {
                ++covered;
                tried = std::max(tried, near);
            }
        // One that was too small for a polygon is tried again when it is not any more, but rarely before.
        const bool grown = size >= lasting_px ? tried < lasting_px || size > kGrowth * tried : size > 2 * tried;
        const bool known = 2 * covered >= size && !grown;
        if (!known) {
            if (size < smallest_px) continue;
            news.insert(news.end(), begin, end);
            tried = size;
        }
        for (auto pixel = begin; pixel != end; ++pixel) shown.push_back({*pixel, tried, 0});
    }
    std::vector<Tried> before = take_all();
    width_ = off.width();
    tried_px_.resize(static_cast<std::size_t>(off.width()) * off.height(), 0);
    remember(shown);
    for (Tried& t : before) ++t.frames;
    std::erase_if(before, [](const Tried& t) { return t.frames > kRememberedFrames; });
    remember(before);
    return news;
}

// Size remembered for the pixel or for one a few px away.
int OffMemory::tried_near(int pixel) const {
    const int height = static_cast<int>(tried_px_.size()) / width_;
    const int x = pixel % width_, y = pixel / width_;
    int most = 0;
    for (int j = y < kSpread ? y : y - kSpread; j <= y + kSpread && j < height; j += kSpread)
        for (int i = x < kSpread ? x : x - kSpread; i <= x + kSpread && i < width_; i += kSpread)
            most = std::max(most, tried_px_[j * width_ + i]);
    return most;
}

std::vector<OffMemory::Tried> OffMemory::take_all() {
    for (const Tried& t : pixels_) tried_px_[t.pixel] = 0;
    return std::exchange(pixels_, {});
}

// Where a pixel is there already, that stays.
void OffMemory::remember(const std::vector<Tried>& tried) {
    for (const Tried& t : tried) {
        if (tried_px_[t.pixel] != 0) continue;
        tried_px_[t.pixel] = t.size;
        pixels_.push_back(t);
    }
}

void OffMemory::move(const std::function<int(int)>& place) {
    std::vector<Tried> moved = take_all();
    for (Tried& t : moved) t.pixel = place(t.pixel);
    std::erase_if(moved, [](const Tried& t) { return t.pixel < 0; });
    remember(moved);
}

void OffMemory::turn(std::span<const int> source) {
    if (pixels_.empty()) return;
    std::vector<int> frames(tried_px_.size());
    for (const Tried& t : pixels_) frames[t.pixel] = t.frames;
    std::vector<Tried> turned;
    const int count = static_cast<int>(source.size());
    for (int first = 0; first < count; first += kTogether) {
        const int last = std::min(first + kTogether, count);
        int any = 0;  // mostly there is nothing in a whole row of them
        for (int k = first; k < last; ++k) any |= tried_px_[std::max(source[k], 0)];
        if (any == 0) continue;
        for (int k = first; k < last; ++k)
            if (source[k] >= 0 && tried_px_[source[k]] != 0)
                turned.push_back({k, tried_px_[source[k]], frames[source[k]]});
    }
    take_all();
    remember(turned);
}

int fragment_faces(Mesh& mesh, std::vector<int>& labels, const std::vector<int>& pixels, int square_px) {
    // One pixel more all round: what is off ends short of its blurred outline, and what is narrow is mostly outline.
    PixelSet cut(mesh.width, mesh.height);
    for (int k : pixels) {
        const int x = k % mesh.width, y = k / mesh.width;
        for (int j = std::max(0, y - 1); j <= std::min(mesh.height - 1, y + 1); ++j)
            for (int i = std::max(0, x - 1); i <= std::min(mesh.width - 1, x + 1); ++i) cut.add(j * mesh.width + i);
    }
    return cut_squares(mesh, labels, cut.list(), square_px, kSmallestPiece);
}

std::vector<int> turn_labels(Mesh& mesh, const std::vector<int>& labels, std::span<const int> source,
                             int square_px) {
    const int count = static_cast<int>(labels.size());
    std::vector<int> turned(count);
    std::vector<int> unseen;
    for (int first = 0; first < count; first += kTogether) {
        const int last = std::min(first + kTogether, count);
        int worst = 0;
        for (int k = first; k < last; ++k) {
            worst |= source[k];
            turned[k] = labels[std::max(source[k], 0)];
        }
        if (worst >= 0) continue;
        for (int k = first; k < last; ++k)
            if (source[k] < 0) {
                turned[k] = kOutside;
                unseen.push_back(k);
            }
    }
    cut_squares(mesh, turned, unseen, square_px, 1);
    return turned;
}

}  // namespace rbdn
