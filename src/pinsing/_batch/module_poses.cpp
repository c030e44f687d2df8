// Configurations brought to poses by Newton's method, one at a time.
#include <cmath>

#include "module.hpp"
#include "share_out.hpp"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace pinsing {

namespace {

constexpr int kIterations = 8;
constexpr double kLongestStep = 0.3;
// So that a singular configuration beside the way is no end of it.
constexpr double kDamping = 1e-12;

// Axes and origins of the joints; the tip's placement R (columns), p.
struct Placed {
    double z[kMaxColumns][3], o[kMaxColumns][3], R[3][3], p[3];

    void turn(const double* C, const double* t) {
        const double old[3][3] = {{R[0][0], R[0][1], R[0][2]},
                                  {R[1][0], R[1][1], R[1][2]},
                                  {R[2][0], R[2][1], R[2][2]}};
        for (int r = 0; r < 3; r++) {
            p[r] += old[0][r] * t[0] + old[1][r] * t[1] + old[2][r] * t[2];
            for (int k = 0; k < 3; k++)
                R[k][r] = old[0][r] * C[k] + old[1][r] * C[3 + k] + old[2][r] * C[6 + k];
        }
    }

    Placed(const Chain& chain, const double* q)
        : R{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, p{} {
        for (int j = 0; j <= chain.n; j++) {
            turn(chain.R + 9 * j, chain.t + 3 * j);
            if (j == chain.n) break;
            const double s = std::sin(q[j]), c = std::cos(q[j]);
            for (int r = 0; r < 3; r++) {
                z[j][r] = R[2][r], o[j][r] = p[r];
                const double x = R[0][r], y = R[1][r];
                if (chain.prismatic[j]) p[r] += q[j] * z[j][r];
                else R[0][r] = x * c + y * s, R[1][r] = y * c - x * s;
            }
        }
    }
};

void cross(const double* a, const double* b, double* out) {
    for (int r = 0; r < 3; r++)
        out[r] = a[(r + 1) % 3] * b[(r + 2) % 3] - a[(r + 2) % 3] * b[(r + 1) % 3];
}

// q (n,) to a pose, by its `free` joints: whether what is left of each number is below `small`.
// Configurations farther away than `near` are let be, and so is what does not come nearer.
bool bring(const Chain& chain, const bool* free, const double* position, const double* rotation,
           double scale, double small, double near, double slower, double* q) {
    double J[kMaxColumns][6], A[kMaxColumns][kMaxColumns], step[kMaxColumns], e[6], turned[3];
    for (int iteration = 0; iteration < kIterations; iteration++) {
        const Placed at(chain, q);
        double off = 0.0;
        for (int r = 0; r < 3; r++) {
            e[r] = (position[r] - at.p[r]) / scale, e[3 + r] = 0.0;
            off = std::max(off, std::fabs(e[r]));
        }
        for (int k = 0; k < 3; k++) {
            const double to[3] = {rotation[k], rotation[3 + k], rotation[6 + k]};
            cross(at.R[k], to, turned);
            for (int r = 0; r < 3; r++) {
                e[3 + r] += 0.5 * turned[r];
                off = std::max(off, std::fabs(at.R[k][r] - to[r]));
            }
        }
        if (off < small) return true;
        if (!(off < near)) return false;
        near = off * slower;
        int d = 0;
        for (int j = 0; j < chain.n; j++) {
            if (!free[j]) continue;
            const bool slides = chain.prismatic[j];
            const double arm[3] = {at.p[0] - at.o[j][0], at.p[1] - at.o[j][1], at.p[2] - at.o[j][2]};
            cross(at.z[j], arm, J[d]);
            for (int r = 0; r < 3; r++) {
                J[d][r] = slides ? at.z[j][r] : J[d][r] / scale;
                J[d][3 + r] = slides ? 0.0 : at.z[j][r];
            }
            step[d] = 0.0;
            for (int r = 0; r < 6; r++) step[d] += J[d][r] * e[r];
            for (int i = 0; i <= d; i++) {  // Cholesky's factor, row by row
                double sum = i == d ? kDamping : 0.0;
                for (int r = 0; r < 6; r++) sum += J[d][r] * J[i][r];
                for (int k = 0; k < i; k++) sum -= A[d][k] * A[i][k];
                A[d][i] = i == d ? std::sqrt(std::max(sum, kDamping)) : sum / A[i][i];
            }
            for (int k = 0; k < d; k++) step[d] -= A[d][k] * step[k];
            step[d] /= A[d][d];
            d++;
        }
        double longest = kLongestStep;
        for (int i = d - 1; i >= 0; i--) {
            for (int k = i + 1; k < d; k++) step[i] -= A[k][i] * step[k];
            step[i] /= A[i][i];
            longest = std::max(longest, std::fabs(step[i]));
        }
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
    const auto work = [&](std::int64_t first, std::int64_t count, double*) {
        for (std::int64_t i = first; i < first + count; i++) {
            double* q = Q.data() + i * chain.n;
            const std::int64_t pose = i / static_cast<std::int64_t>(slots);
            if (!std::isfinite(q[0]) ||
                !bring(chain, free.data(), position.data() + 3 * pose, rotation.data() + 9 * pose,
                       scale, small, near, slower, q))
                std::fill(q, q + n, std::nan(""));
        }
        return Outcome{-1, 0};
    };
    share_out(static_cast<std::int64_t>(M * slots), threads, 1, work);
}

}  // namespace

void add_poses(nb::module_& m) {
    m.def("to_poses", &to_poses, "R"_a.noconvert(), "t"_a.noconvert(), "prismatic"_a.noconvert(),
          "free"_a.noconvert(), "position"_a.noconvert(), "rotation"_a.noconvert(), "scale"_a,
          "small"_a, "near"_a, "slower"_a, "Q"_a.noconvert(), "threads"_a);
}

}  // namespace pinsing
