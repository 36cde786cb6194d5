#include "search.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <utility>

namespace nav {

std::vector<std::size_t> search(const Field& field, std::size_t first) {
    using Entry = std::pair<double, std::size_t>;
    const std::size_t count = field.rows * field.cols;
    std::vector<bool> closed(field.shut, field.shut + count);
    std::vector<double> best(count, std::numeric_limits<double>::infinity());
    std::vector<std::size_t> came(count);
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    best[first] = 0.0, came[first] = first;
    queue.push({0.0, first});
    while (!queue.empty()) {
        const std::size_t cell = queue.top().second;
        queue.pop();
        if (closed[cell] && cell != first) continue;
        if (field.there[cell]) {
            std::vector<std::size_t> way{cell};
            while (way.back() != first) way.push_back(came[way.back()]);
            std::reverse(way.begin(), way.end());
            return way;
        }
        closed[cell] = true;
        const std::size_t row = cell / field.cols, col = cell % field.cols;
        const std::size_t row1 = std::min(row + 1, field.rows - 1), col1 = std::min(col + 1, field.cols - 1);
        for (std::size_t r = row > 0 ? row - 1 : 0; r <= row1; ++r)
            for (std::size_t c = col > 0 ? col - 1 : 0; c <= col1; ++c) {
                const std::size_t other = r * field.cols + c;
                if (closed[other]) continue;
                const double length = r != row && c != col ? std::sqrt(2.0) : 1.0;
                const double cost = best[cell] + length * static_cast<double>(field.cost[other]);
                if (cost < best[other]) {
                    best[other] = cost, came[other] = cell;
                    queue.push({cost + static_cast<double>(field.ahead[other]), other});
                }
            }
    }
    return {};
}

}  // namespace nav
