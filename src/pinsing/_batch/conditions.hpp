// Conditions that make an arm singular, as plain arrays: joints at values, sums of cosines at zero.
//
// Coordinates are weighted: x_j = w_j q_j with the weight that a joint has in the metric, so that
// distances are plain norms. An equation is
//     f(x) = sum_t amplitude_t prod_j x_j^power cos(phase_t + sum_j rate_tj x_j),
// where the joint of a power of p stands p times.
#pragma once

#include <cstdint>

namespace pinsing {

constexpr int kMaxConditionJoints = 32;
constexpr int kMaxCombined = 12;  // equations of one branch that are combined into one bound

struct Conditions {
    int n;                         // joints
    int families;
    int branches;
    const std::int64_t* family;    // (branches,)
    const double* turn;            // (n,) a whole turn in weighted coordinates; 0 for prismatic joints
    const std::int64_t* value_start;     // (branches + 1,)
    const std::int64_t* value_joint;
    const double* value;
    const std::int64_t* equation_start;  // (branches + 1,)
    const std::int64_t* term_start;      // (equations + 1,)
    const double* noise;           // (equations,) relative error of a value, rounding included
    const double* reach;           // (equations,) largest sum of a term's rates: error by large x
    const double* curvature;       // (equations,) bound of the second derivatives; no powers
    const double* steepness;       // (equations,) sum of amplitude times norm of rates; no powers
    const bool* sliding;           // (equations,) whether powers occur
    const double* amplitude;       // (terms,)
    const double* phase;
    const double* rate_norm;       // (terms,) dual norm of the rates
    const std::int64_t* rate_start;      // (terms + 1,)
    const std::int64_t* rate_joint;
    const double* rate;
    const std::int64_t* power_start;     // (terms + 1,)
    const std::int64_t* power_joint;
    bool largest;                  // distances in the maximum norm, else the Euclidean one
};

}  // namespace pinsing
