#include "dense.hpp"

#include <cmath>

namespace depth {

bool invert_spd(std::vector<double>& a, std::size_t n) {
    // a = L L', then inv(L), then inv(L)' inv(L); rows and columns scaled to a unit diagonal first
    std::vector<double> size(n), l(n * n, 0.0);
    for (std::size_t i = 0; i < n; ++i) {
        if (!(a[i * n + i] > 0)) return false;
        size[i] = 1 / std::sqrt(a[i * n + i]);
    }
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = 0; j <= i; ++j) {
            double sum = a[i * n + j] * size[i] * size[j];
            for (std::size_t k = 0; k < j; ++k) sum -= l[i * n + k] * l[j * n + k];
            if (i == j) {
                if (!(sum > 1e-13)) return false;
                l[i * n + i] = std::sqrt(sum);
            } else {
                l[i * n + j] = sum / l[j * n + j];
            }
        }
    for (std::size_t j = 0; j < n; ++j) {
        l[j * n + j] = 1 / l[j * n + j];
        for (std::size_t i = j + 1; i < n; ++i) {
            double sum = 0;
            for (std::size_t k = j; k < i; ++k) sum -= l[i * n + k] * l[k * n + j];
            l[i * n + j] = sum / l[i * n + i];
        }
    }
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = 0; j <= i; ++j) {
            double sum = 0;
            for (std::size_t k = i; k < n; ++k) sum += l[k * n + i] * l[k * n + j];
            a[i * n + j] = a[j * n + i] = sum * size[i] * size[j];
        }
    return true;
}

}  // namespace depth
