// Numbers with the operations of simd.hpp's blocks, for what is included for both.
#pragma once

#include <algorithm>
#include <cmath>

namespace pinsing {

inline double broadcast(double x) { return x; }
inline double vmax(double x, double y) { return std::max(x, y); }
inline double vabs(double x) { return std::fabs(x); }
inline void sincos(double x, double& sine, double& cosine) { sine = std::sin(x), cosine = std::cos(x); }

}  // namespace pinsing
