#include "seam.hpp"

#include <algorithm>
#include <cmath>

namespace nav {

namespace {

constexpr float kWhole = 12582912.0f;  // 1.5 * 2^23: what is added to it is rounded to a whole number, halves to even

}  // namespace

std::vector<float> strips(const Pixels& picture, std::size_t high, std::size_t wide) {
    const std::size_t across = picture.width / wide, down = picture.height / high;
    const float share = 1.0f / static_cast<float>(high * wide);
    std::vector<float> out(across * down * 3);
    std::vector<std::uint32_t> column(3 * picture.width);
    for (std::size_t d = 0; d < down; ++d) {
        std::fill(column.begin(), column.end(), 0);
        for (std::size_t y = picture.height - high * (d + 1); y < picture.height - high * d; ++y) {
            const std::uint8_t* row = picture.row(y);
            for (std::size_t k = 0; k < column.size(); ++k) column[k] += row[k];
        }
        const std::uint32_t* at = column.data();
        for (std::size_t a = 0; a < across; ++a) {
            std::uint32_t blue = 0, green = 0, red = 0;
            for (std::size_t x = 0; x < wide; ++x, at += 3) blue += at[0], green += at[1], red += at[2];
            float* block = &out[3 * (a * down + d)];
            for (const std::uint32_t sum : {red, green, blue})
                *block++ = share * static_cast<float>(sum) + kWhole - kWhole;
        }
    }
    return out;
}

std::vector<float> colour_steps(const float* colours, std::size_t strips, std::size_t rows, std::size_t window,
                                double light) {
    const float darker = static_cast<float>(1.0 - light);
    const std::size_t steps = rows + 1 > 2 * window ? rows + 1 - 2 * window : 0;
    const float size = static_cast<float>(window);
    std::vector<float> out(strips * steps), sums(3 * (rows + 1)), means(3 * (rows + 1));
    for (std::size_t s = 0; s < strips; ++s) {
        for (std::size_t r = 0; r < rows; ++r) {
            const float* at = colours + 3 * (s * rows + r);
            const float grey = darker * ((at[0] + at[1] + at[2]) / 3.0f);
            for (std::size_t c = 0; c < 3; ++c) sums[3 * (r + 1) + c] = sums[3 * r + c] + (at[c] - grey);
        }
        for (std::size_t k = 0; k + 3 * window < 3 * (rows + 1); ++k) means[k] = (sums[k + 3 * window] - sums[k]) / size;
        for (std::size_t k = 0; k < steps; ++k) {
            float square[3];
            for (std::size_t c = 0; c < 3; ++c) {
                const float change = means[3 * (k + window) + c] - means[3 * k + c];
                square[c] = change * change;
            }
            out[s * steps + k] = std::sqrt(square[0] + square[1] + square[2]);
        }
    }
    return out;
}

std::vector<std::uint8_t> agreed(const std::vector<std::int64_t>& foot, const std::vector<std::uint8_t>& found,
                                 std::size_t search, double agree_px) {
    std::vector<std::uint8_t> out(foot.size(), 0);
    std::vector<double> slopes, ordered, away;
    for (std::size_t k = 0; k < foot.size(); ++k) {
        if (!found[k]) continue;
        slopes.clear(), away.clear();
        const std::size_t last = std::min(foot.size() - 1, k + search);
        for (std::size_t j = k > search ? k - search : 0; j <= last; ++j) {
            if (j == k || !found[j]) continue;
            away.push_back(static_cast<double>(j) - static_cast<double>(k));
            slopes.push_back(static_cast<double>(foot[j] - foot[k]) / away.back());
        }
        const std::size_t n = slopes.size();
        if (n < 2) continue;
        ordered = slopes;
        std::sort(ordered.begin(), ordered.end());
        const double rise = n % 2 ? ordered[n / 2] : (ordered[n / 2 - 1] + ordered[n / 2]) / 2;
        std::size_t fit = 0;
        for (std::size_t i = 0; i < n; ++i) fit += std::abs(slopes[i] - rise) * std::abs(away[i]) <= agree_px;
        out[k] = fit >= std::max<std::size_t>(2, n / 2 + 1);
    }
    return out;
}

}  // namespace nav
