#include "columns.hpp"

#include <stdexcept>

namespace nav {

template <class T>
Columns columns_of(const T* image, std::size_t rows, std::size_t cols, std::size_t kinds) {
    Columns out;
    out.cols = cols, out.rows = rows, out.kinds = kinds;
    out.labels.resize(rows * cols);
    for (std::size_t r = 0; r < rows; ++r)
        for (std::size_t c = 0; c < cols; ++c) {
            const T kind = image[(rows - 1 - r) * cols + c];
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

template Columns columns_of(const std::uint8_t*, std::size_t, std::size_t, std::size_t);
template Columns columns_of(const std::uint16_t*, std::size_t, std::size_t, std::size_t);

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

}  // namespace nav
