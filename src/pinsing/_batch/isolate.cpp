// All zeros of sums of cosines along polynomial pieces of a motion, isolated with proof.
//
// On an interval of half-width h around s, with W a bound of |f''| there: no zero where
// |f| > |f'| h + W h^2 / 2; at most one where |f'| > W h, and the signs at the ends tell; else the
// interval is halved, until f cannot be told from zero on it.
#include <algorithm>
#include <cmath>
#include <vector>

#include "proximity.hpp"

namespace pinsing {
namespace {

constexpr int kLooks = 6000;  // at intervals of one piece, before the rest is left undecided

// Bounds of x and its derivatives on the interval, of a polynomial in s.
struct Poly {
    double value, first;                   // at the middle
    double most, most_first, most_second;  // on the interval
};

Poly bounds_of(const double* a, int stride, int degree, double s, double h) {
    Poly p{0.0, 0.0, 0.0, 0.0, 0.0};
    const double end = s + h;
    for (int i = degree; i >= 0; i--) {
        p.first = p.first * s + p.value;
        p.value = p.value * s + a[i * stride];
    }
    for (int i = degree; i >= 2; i--)
        p.most_second = p.most_second * end + i * (i - 1) * std::fabs(a[i * stride]);
    p.most_first = std::fabs(p.first) + p.most_second * h;
    p.most = std::fabs(p.value) + p.most_first * h;
    return p;
}

double value_of(const double* a, int stride, int degree, double s) {
    double v = 0.0;
    for (int i = degree; i >= 0; i--) v = v * s + a[i * stride];
    return v;
}

class Along {
public:
    // piece: (degree + 1, n) coefficients, ascending; s from 0 to 1.
    Along(const Conditions& c, std::int64_t e, const double* piece, int degree)
        : c_(c), e_(e), piece_(piece), degree_(degree) {
        const std::int64_t first = c.term_start[e], last = c.term_start[e + 1];
        angle_.assign(static_cast<std::size_t>((last - first) * (degree + 1)), 0.0);
        for (std::int64_t t = first; t < last; t++) {
            double* a = &angle_[static_cast<std::size_t>((t - first) * (degree + 1))];
            for (std::int64_t k = c.rate_start[t]; k < c.rate_start[t + 1]; k++) {
                double reach = 0.0;
                for (int i = 0; i <= degree; i++) {
                    const double x = piece[i * c.n + c.rate_joint[k]];
                    a[i] += c.rate[k] * x;
                    reach += std::fabs(x);
                }
                farthest_ = std::max(farthest_, reach);
            }
            a[0] += c.phase[t];
        }
    }

    struct At {
        double value, first, second, error;  // second: a bound on the interval
    };

    At at(double s, double h) const {
        At out{0.0, 0.0, 0.0, 0.0};
        double size = 0.0;
        const std::int64_t start = c_.term_start[e_];
        for (std::int64_t t = start; t < c_.term_start[e_ + 1]; t++) {
            const double* a = &angle_[static_cast<std::size_t>((t - start) * (degree_ + 1))];
            const Poly angle = bounds_of(a, 1, degree_, s, h);
            double m = c_.amplitude[t], m_first = 0.0;
            double most = std::fabs(m), first = 0.0, second = 0.0;
            for (std::int64_t k = c_.power_start[t]; k < c_.power_start[t + 1]; k++) {
                const Poly x = bounds_of(piece_ + c_.power_joint[k], c_.n, degree_, s, h);
                const double p = static_cast<double>(c_.power[k]), top = std::max(x.most, 1e-150);
                for (std::int64_t i = 0; i < c_.power[k]; i++) {
                    m_first = m_first * x.value + m * x.first;
                    m *= x.value;
                    most *= top;
                }
                first += p * x.most_first / top;
                second += p * x.most_second / top;
            }
            const double sine = std::sin(angle.value), cosine = std::cos(angle.value);
            out.value += m * cosine;
            out.first += m_first * cosine - m * sine * angle.first;
            const double turning = angle.most_first;
            out.second += most * (turning * turning + angle.most_second + 2.0 * first * turning +
                                  first * first + second);
            size += most;
        }
        out.second *= 1.0 + 1e-12;
        out.error = size * (c_.noise[e_] + 9e-16 * c_.reach[e_] * farthest_ * (degree_ + 1));
        return out;
    }

    double value(double s) const {
        double total = 0.0;
        const std::int64_t start = c_.term_start[e_];
        for (std::int64_t t = start; t < c_.term_start[e_ + 1]; t++) {
            const double* a = &angle_[static_cast<std::size_t>((t - start) * (degree_ + 1))];
            double m = c_.amplitude[t];
            for (std::int64_t k = c_.power_start[t]; k < c_.power_start[t + 1]; k++) {
                const double x = value_of(piece_ + c_.power_joint[k], c_.n, degree_, s);
                for (std::int64_t i = 0; i < c_.power[k]; i++) m *= x;
            }
            total += m * std::cos(value_of(a, 1, degree_, s));
        }
        return total;
    }

    // The only zero between lo and hi, at which the signs differ: Newton's method, or halving.
    double refine(double lo, double hi, bool rising) const {
        double s = 0.5 * (lo + hi);
        for (int iteration = 0; iteration < 80; iteration++) {
            const At here = at(s, 0.0);
            ((here.value < 0.0) == rising ? lo : hi) = s;
            double next = here.first != 0.0 ? s - here.value / here.first : lo;
            if (!(next > lo && next < hi)) next = 0.5 * (lo + hi);
            if (std::fabs(next - s) <= 1e-16 + 2e-16 * s) return next;
            s = next;
        }
        return s;
    }

private:
    const Conditions& c_;
    std::int64_t e_;
    const double* piece_;
    int degree_;
    std::vector<double> angle_;
    double farthest_ = 4.0;
};

struct Interval {
    double s, h;
};

}  // namespace

void zeros_of_piece(const Conditions& c, std::int64_t e, const double* piece, int degree,
                    std::int64_t segment, std::vector<Event>& events, double& first_value,
                    double& last_value) {
    const Along along(c, e, piece, degree);
    first_value = along.value(0.0);
    last_value = along.value(1.0);
    std::vector<Interval> now{{0.5, 0.5}}, next;
    int looks = 0;
    while (!now.empty()) {  // the wide ones first: what is left undecided is as narrow as it can be
        next.clear();
        for (const Interval& interval : now) {
            const double s = interval.s, h = interval.h;
            const Along::At at = along.at(s, h);
            const double swing = std::fabs(at.first) * h + 0.5 * at.second * h * h;
            const double value = std::fabs(at.value);
            looks++;
            if (value > swing + at.error) continue;
            if (std::fabs(at.first) > (at.second * h + at.error) * (1.0 + 1e-12)) {
                const double low = along.value(s - h), high = along.value(s + h);
                if ((low < 0.0) == (high < 0.0)) continue;
                const double root = along.refine(s - h, s + h, low < 0.0);
                events.push_back({segment, e, root, 0.0, 1});
                continue;
            }
            if (value + swing <= 4.0 * at.error || h < 1e-13 || looks > kLooks) {
                events.push_back({segment, e, s, h, 2});
                continue;
            }
            next.push_back({s - 0.5 * h, 0.5 * h});
            next.push_back({s + 0.5 * h, 0.5 * h});
        }
        std::swap(now, next);
    }
}

}  // namespace pinsing
