#include "columns.hpp"

#include <algorithm>
#include <stdexcept>

namespace nav {

Columns columns_of(const std::uint16_t* image, std::size_t rows, std::size_t cols, std::size_t kinds) {
    Columns out;
    out.cols = cols, out.rows = rows, out.kinds = kinds;
    out.labels.resize(rows * cols);
    for (std::size_t r = 0; r < rows; ++r)
        for (std::size_t c = 0; c < cols; ++c) {
            const std::uint16_t kind = image[(rows - 1 - r) * cols + c];
            if (kind >= kinds) throw std::out_of_range("a pixel of a kind that there is not");
            out.labels[c * rows + r] = kind;
        }
    out.lowest.assign(kinds * cols, -1);
    out.pixels.assign(kinds, 0), out.at_border.assign(kinds, 0);
    for (std::size_t c = 0; c < cols; ++c) {
        const std::uint16_t* column = &out.labels[c * rows];
        ++out.at_border[column[0]];
        for (std::size_t r = 0; r < rows;) {
            const std::uint16_t kind = column[r];
            const std::size_t first = r;
            while (r < rows && column[r] == kind) ++r;
            out.starts.push_back(static_cast<std::int64_t>(c * rows + first));
            out.ends.push_back(static_cast<std::int64_t>(c * rows + r));
            out.owner.push_back(kind);
            out.pixels[kind] += static_cast<std::int64_t>(r - first);
            std::int64_t& low = out.lowest[kind * cols + c];
            if (low < 0) low = static_cast<std::int64_t>(first);
        }
    }
    return out;
}

FirstOther first_other(const std::uint16_t* labels, std::size_t cols, std::size_t rows, const std::uint8_t* ground,
                       const std::int64_t* foot) {
    FirstOther out;
    out.row.resize(cols), out.open_ended.resize(cols), out.sure_row.resize(cols);
    for (std::size_t c = 0; c < cols; ++c) {
        const std::uint16_t* column = labels + c * rows;
        const bool footless = foot[c] < 0;
        std::size_t sure = rows, row = rows;
        for (std::size_t r = 0; r < rows; ++r) {
            const Ground kind{ground[column[r]]};
            if (kind == Ground::floor) continue;
            const bool mixed = kind == Ground::mixed;
            if (mixed && static_cast<std::int64_t>(r) < foot[c]) continue;
            if (sure == rows) sure = r;
            if (mixed && footless) continue;
            row = r;
            break;
        }
        out.open_ended[c] = row == rows;
        out.row[c] = static_cast<std::int64_t>(row == rows ? rows - 1 : row);
        out.sure_row[c] = static_cast<std::int64_t>(sure == rows ? rows - 1 : sure);
    }
    return out;
}

Feet feet_of(const FirstOther& first, const std::uint16_t* labels, const double* slopes, std::size_t rows,
             const std::int64_t* ids, std::int64_t nothing, const Plane& plane) {
    constexpr double kFlattest = 1e-6;
    const std::size_t cols = first.row.size();
    Feet out;
    out.kind.resize(cols), out.cut.resize(cols), out.sure.resize(cols);
    for (auto* values : {&out.slope, &out.depth_cm, &out.floor_cm, &out.free_cm}) values->resize(cols);
    const auto reach = [&](double slope) {
        return std::min(plane.height_cm / std::max(slope, kFlattest), plane.farthest_cm);
    };
    for (std::size_t c = 0; c < cols; ++c) {
        const double* ray = slopes + c * rows;
        const auto row = static_cast<std::size_t>(first.row[c]), sure = static_cast<std::size_t>(first.sure_row[c]);
        const bool open_ended = first.open_ended[c] != 0;
        out.cut[c] = row == 0 && !open_ended;
        out.kind[c] = open_ended ? nothing : ids[labels[c * rows + row]];
        // the foot's ray passes between the foot's pixel and the floor's pixel below it
        out.depth_cm[c] = reach(0.5 * (ray[row] + ray[row > 0 ? row - 1 : 0]));
        out.slope[c] = plane.height_cm / out.depth_cm[c];
        out.sure[c] = sure == row;
        const double floor_cm = reach(ray[sure > 0 ? sure - 1 : 0]);
        out.floor_cm[c] = floor_cm;
        out.free_cm[c] = floor_cm - 2 * (floor_cm * floor_cm) / plane.height_cm * plane.sigma_slope;
    }
    return out;
}

}  // namespace nav
