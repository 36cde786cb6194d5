// What the robust fits share.
#pragma once

namespace depth {

constexpr double TUKEY = 4.7;  // residuals so many times their scale have no weight

inline double square(double v) { return v * v; }

}  // namespace depth
