#include "tiles.hpp"

#include <algorithm>

namespace nav {

namespace {

std::uint8_t apart(std::uint8_t a, std::uint8_t b) { return static_cast<std::uint8_t>(std::max(a, b) - std::min(a, b)); }

// 1 where a step over a wide stretch lies mostly within a short one.
std::uint8_t is_sharp(std::uint8_t step, std::uint8_t wide, std::uint8_t levels) {
    const auto half = static_cast<std::uint8_t>(wide >> 1);
    return step >= std::max(half, levels) ? 1 : 0;
}

// Adds up tile by tile what comes row by row.
class Sums {
  public:
    Sums(std::size_t rows, std::size_t width, const Tiling& tiles)
        : rows_(rows), width_(width), tiles_(tiles), sums_(tiles.across * tiles.down, 0) {}

    // stride: from one value of the row to the next
    void add(std::size_t row, const std::uint8_t* values, std::size_t stride) {
        while (row >= (down_ + 1) * rows_ / tiles_.down) ++down_;
        for (std::size_t t = 0; t < tiles_.across; ++t) {
            std::uint32_t sum = 0;
            for (std::size_t x = t * width_ / tiles_.across; x < (t + 1) * width_ / tiles_.across; ++x)
                sum += values[x * stride];
            sums_[down_ * tiles_.across + t] += sum;
        }
    }

    std::vector<float> means() const {
        std::vector<float> out(sums_.size());
        for (std::size_t k = 0; k < out.size(); ++k) {
            const std::size_t d = k / tiles_.across, a = k % tiles_.across;
            const std::size_t high = (d + 1) * rows_ / tiles_.down - d * rows_ / tiles_.down;
            const std::size_t wide = (a + 1) * width_ / tiles_.across - a * width_ / tiles_.across;
            out[k] = static_cast<float>(sums_[k]) * (1.0f / static_cast<float>(high * wide));
        }
        return out;
    }

  private:
    std::size_t rows_, width_;
    Tiling tiles_;
    std::vector<std::uint32_t> sums_;
    std::size_t down_ = 0;
};

std::vector<std::uint8_t> green(const Pixels& picture, std::size_t first, std::size_t every, std::size_t rows) {
    std::vector<std::uint8_t> out(rows * picture.width);
    for (std::size_t r = 0; r < rows; ++r) {
        const std::uint8_t* from = picture.row(first + every * r) + 1;
        std::uint8_t* to = &out[r * picture.width];
        for (std::size_t x = 0; x < picture.width; ++x) to[x] = from[3 * x];
    }
    return out;
}

}  // namespace

std::vector<std::uint8_t> thinned(const Pixels& picture, std::size_t step) {
    std::vector<std::uint8_t> out;
    out.reserve(3 * ((picture.height + step - 1) / step) * ((picture.width + step - 1) / step));
    for (std::size_t y = 0; y < picture.height; y += step) {
        const std::uint8_t* row = picture.row(y);
        for (std::size_t x = 0; x < picture.width; x += step) out.insert(out.end(), row + 3 * x, row + 3 * x + 3);
    }
    return out;
}

std::vector<float> tile_means(const Pixels& picture, std::size_t every, std::size_t rows, const Tiling& tiles) {
    Sums sums(rows, picture.width, tiles);
    for (std::size_t r = 0; r < rows; ++r) sums.add(r, picture.row(every * r) + 1, 3);
    return sums.means();
}

Tiles sharp_tiles(const Pixels& picture, std::size_t every, const Sharp& sharp, const Tiling& tiles) {
    const std::size_t width = picture.width, step = sharp.step_px, wide = sharp.wide_px;
    const std::size_t rows = (picture.height - step + every - 1) / every, count = width - 2 * wide - step;
    const std::vector<std::uint8_t> above = green(picture, 0, every, rows), below = green(picture, step, every, rows);
    std::vector<std::uint8_t> at_edge(count);
    Sums sharp_sums(rows - 2, count, tiles), light_sums(rows, width, tiles);
    for (std::size_t r = 0; r < rows; ++r) light_sums.add(r, &above[r * width], 1);
    for (std::size_t r = 1; r + 1 < rows; ++r) {
        const std::uint8_t *line = &above[r * width], *under = &below[r * width];
        const std::uint8_t *before = &above[(r - 1) * width], *after = &below[(r + 1) * width];
        for (std::size_t k = 0; k < count; ++k) {
            const std::size_t x = k + wide;
            const std::uint8_t across =
                is_sharp(apart(line[x], line[x + step]), apart(line[k], line[x + wide + step]), sharp.levels);
            const std::uint8_t down = is_sharp(apart(line[x], under[x]), apart(before[x], after[x]), sharp.levels);
            at_edge[k] = across | down;
        }
        sharp_sums.add(r - 1, at_edge.data(), 1);
    }
    return {sharp_sums.means(), light_sums.means()};
}

Rows compare_rows(const Pixels& picture, const Pixels& other) {
    Rows out;
    for (std::size_t y = 0; y < picture.height; ++y) {
        const std::uint8_t* row = picture.row(y);
        std::uint8_t darkest = 255, brightest = 0;
        for (std::size_t x = 0; x < picture.width; ++x) {
            darkest = std::min(darkest, row[3 * x + 1]);
            brightest = std::max(brightest, row[3 * x + 1]);
        }
        out.spread.push_back(static_cast<std::uint8_t>(brightest - darkest));
        out.alike.push_back(std::equal(row, row + 3 * picture.width, other.row(y)));
    }
    return out;
}

}  // namespace nav
