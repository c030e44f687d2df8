// Configurations brought to poses by Newton's method, one at a time, and neighbours among them.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "module.hpp"
#include "conditions.hpp"
#include "numbers.hpp"
#include "share_out.hpp"

namespace nb = nanobind;

namespace pinsing {

namespace {

constexpr int kIterations = 8;
constexpr double kLongestStep = 0.3;
// So that a singular configuration beside the way is no end of it.
constexpr double kDamping = 1e-12;

#include "jacobian.hpp"
#include "least_norm.hpp"

// q (n,) to a pose, by its `free` joints: whether what is left of each number is below `small`.
// Configurations farther away than `near` are let be, and so is what does not come nearer.
bool bring(const Chain& chain, const bool* free, const double* position, const double* rotation,
           double scale, double small, double near, double slower, double* q) {
    double J[6 * kMaxColumns], column[kMaxColumns][6], step[kMaxColumns];
    double A[kMaxColumns * kMaxColumns];
    const double* C = chain.R + 9 * chain.n;
    Tip<double> tip;
    for (int iteration = 0; iteration < kIterations; iteration++) {
        jacobian_block(chain, q, J, &tip);
        double off = 0.0, e[6] = {};
        for (int r = 0; r < 3; r++) {
            e[r] = (position[r] - tip.p[r]) / scale;
            off = std::max(off, std::fabs(e[r]));
        }
        for (int k = 0; k < 3; k++) {
            double axis[3], to[3];
            for (int r = 0; r < 3; r++) {
                axis[r] = tip.R[3 * r] * C[k] + tip.R[3 * r + 1] * C[3 + k] + tip.R[3 * r + 2] * C[6 + k];
                to[r] = rotation[3 * r + k];
                off = std::max(off, std::fabs(axis[r] - to[r]));
            }
            for (int r = 0; r < 3; r++)
                e[3 + r] += 0.5 * (axis[(r + 1) % 3] * to[(r + 2) % 3] - axis[(r + 2) % 3] * to[(r + 1) % 3]);
        }
        if (off < small) return true;
        if (!(off < near)) return false;
        near = off * slower;
        int d = 0;
        for (int j = 0; j < chain.n; j++) {
            if (!free[j]) continue;
            for (int r = 0; r < 6; r++)
                column[d][r] = J[r * chain.n + j] / (r < 3 && !chain.prismatic[j] ? scale : 1.0);
            step[d] = dot(column[d], e, 6);
            d++;
        }
        for (int i = 0; i < d; i++)
            for (int k = 0; k <= i; k++) {
                const double damping = i == k ? kDamping : 0.0;
                A[i * d + k] = A[k * d + i] = dot(column[i], column[k], 6) + damping;
            }
        solve_spd(A, step, d, 0.0, 0.1 * kDamping);
        double longest = kLongestStep;
        for (int i = 0; i < d; i++) longest = std::max(longest, std::fabs(step[i]));
        for (int j = 0, i = 0; j < chain.n; j++)
            if (free[j])
                q[j] += step[i++] * (kLongestStep / longest) * (chain.prismatic[j] ? scale : 1.0);
    }
    return false;
}

// Q (M, S, n) to poses (M), in place; NaN where that fails, and where it was.
void to_poses(const In& R, const In& t, const InFlags& prismatic, const InFlags& free,
              const In& position, const In& rotation, double scale, double small, double near,
              double slower, Out Q, int threads) {
    const Chain chain = chain_of(R, t, prismatic);
    const std::size_t n = static_cast<std::size_t>(chain.n), M = position.size() / 3;
    require(n <= kMaxColumns && free.size() == n, "the number of joints is out of range");
    const std::size_t slots = M == 0 ? 0 : Q.size() / (M * n);
    require(position.size() == 3 * M && rotation.size() == 9 * M && Q.size() == M * slots * n,
            "poses and configurations do not fit");
    share_each(M * slots, threads, [&](std::int64_t i) {
        double* q = Q.data() + i * chain.n;
        const std::int64_t pose = i / static_cast<std::int64_t>(slots);
        if (!std::isfinite(q[0]) ||
            !bring(chain, free.data(), position.data() + 3 * pose, rotation.data() + 9 * pose,
                   scale, small, near, slower, q))
            std::fill(q, q + n, std::nan(""));
    });
}

// Each configuration of Q (M, S, n) once, in place: angles within half a turn of zero, moved by whole
// turns into the range from `low` to `high` (n,) or to its middle; then NaN. Those that differ by
// less than `small` in each joint, whole turns aside, are one.
void distinct(Out Q, const InFlags& prismatic, const In& low, const In& high, double rounding,
              double small, int threads) {
    require(Q.ndim() == 3 && prismatic.size() == Q.shape(2) && low.size() == Q.shape(2) &&
                high.size() == Q.shape(2),
            "Q must have shape (M, S, n), joints n numbers");
    const int S = static_cast<int>(Q.shape(1)), n = static_cast<int>(Q.shape(2));
    const bool* slides = prismatic.data();
    share_each(Q.shape(0), threads, [&](std::int64_t k) {
        double* const pose = Q.data() + k * S * n;
        int kept = 0;
        for (int s = 0; s < S; s++) {
            const double* from = pose + s * n;
            double* q = pose + kept * n;
            bool fresh = std::isfinite(from[0]);
            for (int j = 0; j < n && fresh; j++) {
                q[j] = from[j];
                if (slides[j]) continue;
                q[j] -= 2 * M_PI * std::floor((q[j] + M_PI + rounding) / (2 * M_PI));
                const double middle = (low.data()[j] + high.data()[j]) / 2;
                if (!(q[j] >= low.data()[j] && q[j] <= high.data()[j]))
                    q[j] -= 2 * M_PI * nearest_whole((q[j] - middle) / (2 * M_PI));
            }
            for (int other = 0; other < kept && fresh; other++) {
                fresh = false;
                for (int j = 0; j < n && !fresh; j++) {
                    const double off = q[j] - pose[other * n + j];
                    const double turns = slides[j] ? 0.0 : nearest_whole(off / (2 * M_PI));
                    fresh = !(std::fabs(off - 2 * M_PI * turns) < small);
                }
            }
            kept += fresh;
        }
        std::fill(pose + kept * n, pose + S * n, std::nan(""));
    });
}

// How far apart configurations are, less those turns that leave the least.
double apart(const double* a, const double* b, const double* turn, const double* scale, int n) {
    double total = 0.0;
    for (int j = 0; j < n; j++) {
        const double off = a[j] - b[j], left = (off - turn[j] * nearest_whole(off * (0.5 / M_PI))) * scale[j];
        total += left * left;
    }
    return std::sqrt(total);
}

using OutInt = nb::ndarray<std::int32_t, nb::c_contig, nb::device::cpu>;
using OutFlags = nb::ndarray<bool, nb::c_contig, nb::device::cpu>;

// The nodes of one pose as points of circles, `kSlots` by `kSlots` for each number: zero where there
// is none.
struct Circles {
    static constexpr int kSlots = 8;
    int S, blocks, width;
    std::vector<float> at;

    Circles(const double* Q, int G, int S, int n)
        : S(S), blocks((S + kSlots - 1) / kSlots), width(2 * n),
          at(static_cast<std::size_t>(G * blocks * width * kSlots)) {
        for (int x = 0; x < G * S; x++)
            for (int j = 0; j < n && std::isfinite(Q[x * n]); j++) {
                const float q = static_cast<float>(Q[x * n + j]);
                float* here = of(x);
                here[j * kSlots] = std::cos(q), here[(n + j) * kSlots] = std::sin(q);
            }
    }

    float* of(int x) { return at.data() + (x / S * blocks + x % S / kSlots) * width * kSlots + x % S % kSlots; }

    // The slot of value i, less what `less` takes off, nearest to node x of another pose or this.
    template <class Less>
    int nearest(Circles& from, int x, int i, Less less) {
        const float* a = from.of(x);
        const float* b = of(i * S);
        int best = i * S;
        float most = -std::numeric_limits<float>::infinity();
        for (int first = 0; first < S; first += kSlots) {
            float sum[kSlots];
            for (int s = 0; s < kSlots; s++) sum[s] = first + s < S ? -less(i * S + first + s) : 0.0f;
            for (int j = 0; j < width; j++, b += kSlots)
                for (int s = 0; s < kSlots; s++) sum[s] += a[j * kSlots] * b[s];
            for (int s = 0; s < std::min(kSlots, S - first); s++)
                if (sum[s] > most) most = sum[s], best = i * S + first + s;
        }
        return best;
    }
};

// Neighbours of nodes Q (N, G, S, n), by sums of cosines: `before` (N, G S) of their value at the
// pose before, and `beside` (N, 2, G S) at the values on both sides, or where a branch `ends` and
// turns back another one of their own value; how long the `step` (N, G S) from there is, and the
// longer `way` (N, G S) to those beside, 2 pi to none. With `cyclic` values it is half as long
// where a branch turns back: there it is singular, halfway.
void link_nodes(const In& Q, const In& turn, const In& whole, const In& scale, bool cyclic,
                OutInt before, Out step, OutInt beside, OutFlags ends, Out way, int threads) {
    require(Q.ndim() == 4 && turn.size() == Q.shape(3) && whole.size() == Q.shape(3) &&
                scale.size() == Q.shape(3),
            "Q must have shape (N, G, S, n), joints n numbers");
    const int G = static_cast<int>(Q.shape(1)), S = static_cast<int>(Q.shape(2)), W = G * S;
    const int n = static_cast<int>(Q.shape(3));
    const std::size_t size = Q.shape(0) * Q.shape(1) * Q.shape(2);
    require(before.size() == size && step.size() == size && beside.size() == 2 * size &&
                ends.size() == 2 * size && way.size() == size,
            "an output has the wrong shape");
    const auto work = [&](std::int64_t first, std::int64_t count) {
        const double* q = Q.data() + first * W * n;
        Circles last(first > 0 ? q - W * n : q, G, S, n);
        std::vector<int> link(static_cast<std::size_t>(2 * W));
        const auto none = [](int) { return 0.0f; };
        for (std::int64_t k = first; k < first + count; k++, q += W * n) {
            Circles here(q, G, S, n);
            const auto there = [&](int x) { return std::isfinite(q[x * n]); };
            for (int x = 0; x < W; x++) {
                const int i = x / S, from = last.nearest(here, x, i, none);
                before.data()[k * W + x] = from;
                step.data()[k * W + x] =
                    k > 0 ? apart(q + x * n, q + (from - W) * n, turn.data(), scale.data(), n) : 0.0;
                for (int side = 0; side < 2; side++) {
                    int to = i + 2 * side - 1;
                    to = cyclic ? (to + G) % G : std::min(std::max(to, 0), G - 1);
                    link[side * W + x] = here.nearest(here, x, to, none);
                }
            }
            for (int x = 0; x < W; x++) {
                double farther = 0.0;
                for (int side = 0; side < 2; side++) {
                    int to = link[side * W + x];
                    const bool end = to / S != x / S && (link[(1 - side) * W + to] != x || !there(to));
                    if (end)
                        to = here.nearest(here, x, x / S, [&](int y) {
                            return (y == x ? 4.0f : 0.0f) * n + (there(y) ? 0.0f : 2.0f) * n;
                        });
                    double length = apart(q + to * n, q + x * n, whole.data(), scale.data(), n);
                    if (end && cyclic) length /= 2;
                    if (!(length >= 0.0) || (end && to == x)) length = 2 * M_PI;
                    farther = std::max(farther, length);
                    beside.data()[(2 * k + side) * W + x] = to;
                    ends.data()[(2 * k + side) * W + x] = end;
                }
                way.data()[k * W + x] = farther;
            }
            last = std::move(here);
        }
        return true;
    };
    share_out(static_cast<std::int64_t>(Q.shape(0)), threads, work, 50);
}

}  // namespace

void add_poses(nb::module_& m) {
    define(m, "to_poses", &to_poses);
    define(m, "distinct", &distinct);
    define(m, "link_nodes", &link_nodes);
}

}  // namespace pinsing
