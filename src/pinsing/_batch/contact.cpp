// When a straight motion meets a condition, and whether it moves toward or away from it.
//
// Along x + s u an equation is h(s) = f(x + s u). With |h''| <= M Taylor's theorem gives
// |h(s)| >= |h(0)| - c s - M s^2 / 2, where c is how fast |h| falls: up to the root of the right side
// there is no zero. From there again, and so on: the steps shrink as those of Newton's method do, and
// each is proven. A branch is met where all its conditions hold at once, so that its step is the
// longest of theirs.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "boxes.hpp"
#include "proximity.hpp"

namespace pinsing {
namespace {

constexpr double kWindow = 1.0;  // how far ahead second derivatives are bounded where lengths occur
constexpr int kMostSteps = 64;
constexpr double kRidge = 1e-9;  // damps what more equations than directions contradict each other in

// A bound of |h''| of an equation along u, up to kWindow.
double bend_along(const Conditions& c, std::int64_t e, const double* x, const double* u) {
    double bend = 0.0;
    for (std::int64_t t = c.term_start[e]; t < c.term_start[e + 1]; t++) {
        double turning = 0.0, turns = 0.0, size = std::fabs(c.amplitude[t]);
        for (std::int64_t k = c.rate_start[t]; k < c.rate_start[t + 1]; k++) {
            turning += c.rate[k] * u[c.rate_joint[k]];
            turns += std::fabs(c.rate[k] * u[c.rate_joint[k]]);
        }
        double grows = std::fabs(turning) + 1e-14 * turns;
        for (std::int64_t k = c.power_start[t]; k < c.power_start[t + 1]; k++) {
            const std::int64_t j = c.power_joint[k];
            const double a = std::max(std::fabs(x[j]) + kWindow * std::fabs(u[j]), 1e-150);
            size *= a;
            grows += std::fabs(u[j]) / a;
        }
        bend += size * grows * grows;
    }
    return bend * (1.0 + 1e-12);
}

// How far along u there is no zero of an equation: proven.
double step_of_equation(const Conditions& c, std::int64_t e, const double* x, const double* u) {
    SumOnBox h;
    look_at_sum(c, e, all_joints(c), x, nullptr, c.n, h);
    const double left = std::max(std::fabs(h.value) - h.error, 0.0), bend = bend_along(c, e, x, u);
    if (!(left > 0.0)) return 0.0;
    if (bend == 0.0) return kInfinity;  // none of its joints moves
    const double grows = dot(h.g, u, c.n), error = h.slope_error * norm_of(u, c.n, c.largest);
    const double falls = error + (h.value > 0.0 ? -grows : grows);
    const double root = std::sqrt(falls * falls + 2.0 * (bend * left));
    const double step = (falls > 0.0 ? 2.0 * left / (falls + root) : (root - falls) / bend) * (1.0 - 1e-12);
    return c.sliding[e] ? std::min(step, kWindow) : step;
}

// How far along u a joint is not at its value.
double step_of_value(const Conditions& c, std::int64_t i, const double* x, const double* u) {
    const std::int64_t j = c.value_joint[i];
    const double turn = c.turn[j];
    double ahead = c.value[i] - x[j];
    const double slack = 1e-15 * (std::fabs(x[j]) + std::fabs(c.value[i]) + turn);
    const double off = turn > 0.0 ? ahead - turn * std::floor(ahead / turn + 0.5) : ahead;
    if (std::fabs(off) <= slack) return 0.0;
    if (u[j] == 0.0) return kInfinity;
    if (u[j] < 0.0) ahead = -ahead;
    if (turn > 0.0) ahead -= turn * std::floor(ahead / turn);
    if (ahead < 0.0) return kInfinity;
    return std::max(ahead - slack, 0.0) / std::fabs(u[j]) * (1.0 - 1e-15);
}

double step_of_branch(const Conditions& c, std::int64_t b, const double* x, const double* u,
                      std::int64_t& work) {
    double step = 0.0;
    for (std::int64_t i = c.value_start[b]; i < c.value_start[b + 1] && step < kInfinity; i++) {
        step = std::max(step, step_of_value(c, i, x, u));
        work--;
    }
    for (std::int64_t e = c.equation_start[b]; e < c.equation_start[b + 1] && step < kInfinity; e++) {
        step = std::max(step, step_of_equation(c, e, x, u));
        work -= c.term_start[e + 1] - c.term_start[e];
    }
    return step;
}

// First-order distance from a branch, and how it changes along u.
void approach(const Conditions& c, std::int64_t b, const double* x, const double* u,
              double& distance, double& rate) {
    double off[kMaxConditionJoints] = {}, across = 0.0;
    for (std::int64_t i = c.value_start[b]; i < c.value_start[b + 1]; i++) {
        const std::int64_t j = c.value_joint[i];
        const double d = x[j] - c.value[i];
        off[j] = c.turn[j] > 0.0 ? std::remainder(d, c.turn[j]) : d;
        across += u[j] * u[j];
    }
    const std::int64_t first = c.equation_start[b], all = c.equation_start[b + 1] - first;
    const int k = static_cast<int>(std::min<std::int64_t>(all, kMaxCombined));
    SumOnBox at[kMaxCombined];
    double y[kMaxCombined], z[kMaxCombined], moves[kMaxCombined];
    for (int i = 0; i < k; i++) {
        look_at_sum(c, first + i, all_joints(c), x, nullptr, c.n, at[i]);
        y[i] = at[i].value;
        z[i] = moves[i] = dot(at[i].g, u, c.n);
    }
    if (k > 0) {
        const auto g = [&](int i) { return at[i].g; };
        least_norm(g, k, c.n, y, kRidge, 0.1 * kRidge);
        least_norm(g, k, c.n, z, kRidge, 0.1 * kRidge);
        for (int i = 0; i < k; i++) {
            across += moves[i] * z[i];
            for (int j = 0; j < c.n; j++) off[j] += at[i].g[j] * y[i];
        }
    }
    distance = std::sqrt(dot(off, off, c.n));
    // On the branch itself every way across it leads away.
    rate = distance > 1e-12 ? dot(off, u, c.n) / distance : std::sqrt(std::max(across, 0.0));
}

}  // namespace

Contact contact_along(const Conditions& c, std::int64_t family, const double* x,
                      const double* velocity, double horizon) {
    double u[kMaxConditionJoints], at[kMaxConditionJoints];
    const double speed = norm_of(velocity, c.n, true);
    if (!(speed > 0.0)) return Contact{kInfinity, 0.0};
    for (int j = 0; j < c.n; j++) u[j] = velocity[j] / speed;
    Contact out{kInfinity, 0.0};
    double nearest = kInfinity, rate = 0.0;
    for (int b = 0; b < c.branches; b++) {
        if (c.family[b] != family) continue;
        double distance, change;
        approach(c, b, x, u, distance, change);
        if (distance < nearest) nearest = distance, rate = change;
    }
    out.rate = rate * speed;

    const double end = std::min(horizon * speed, 1e6);
    const std::int64_t terms = c.branches == 0 ? 0 : c.term_start[c.equation_start[c.branches]];
    std::int64_t work = std::max<std::int64_t>(2 * terms, 300);
    double best = end;
    for (int b = 0; b < c.branches; b++) {
        double s = 0.0;
        std::copy(x, x + c.n, at);
        for (int steps = 0; s < best; steps++) {
            const double step = step_of_branch(c, b, at, u, work);
            s += step;
            // The steps of Newton's method have come to an end: it is here, or hardly later.
            if (step <= 1e-9 + 1e-7 * s || steps == kMostSteps || work < 0) break;
            for (int j = 0; j < c.n && s < best; j++) at[j] = x[j] + s * u[j];
        }
        best = std::min(best, s);
    }
    if (best < end) out.time = best * (1.0 - 1e-14) / speed;
    else if (end < horizon * speed) out.time = end / speed;
    return out;
}

}  // namespace pinsing
