// Motions between the nodes of two poses of a toolpath: pinsing/postures/toolpath.py.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "module.hpp"
#include "share_out.hpp"

namespace nb = nanobind;

namespace pinsing {

namespace {

constexpr double kNever = -std::numeric_limits<double>::infinity();

template <class Number>
nb::object array_of(const std::vector<Number>& numbers) {
    const Made<Number> made({numbers.size()});
    std::copy(numbers.begin(), numbers.end(), made.data);
    return made.array;
}

// Motions to parts of nodes, from parts of the nodes `source` (D, M) where theirs began: `part`
// (W, 3), -1 is none. Returned are those at most `reach` and both `half` widths away (D', M), each
// once and in order, `none` behind; `before` (M,) are the nearest ones.
nb::object divided(
    const InWhole& source, const InWhole& part, const In& value, const In& half,
    const In& last_value, const In& last_half, double reach, bool cyclic, int none,
    nb::ndarray<std::int32_t, nb::c_contig, nb::device::cpu> before) {
    const std::size_t M = value.size(), D = M ? source.size() / M : 0, L = last_value.size();
    require(half.size() == M && source.size() == D * M && last_half.size() == L &&
                before.size() >= M,
            "nodes and values do not fit");
    std::vector<std::int32_t> found;
    std::vector<std::size_t> end(M + 1, 0);
    std::vector<std::int64_t> begin(D);
    std::size_t most = 1;
    for (std::size_t m = 0; m < M; m++) {
        for (std::size_t d = 0; d < D; d++) begin[d] = source.data()[d * M + m];
        std::sort(begin.begin(), begin.end());  // parts are numbered in the order of their nodes
        double nearest = std::numeric_limits<double>::infinity();
        before.data()[m] = none;
        std::int64_t last = -1;
        for (const std::int64_t node : begin) {
            require(3 * static_cast<std::size_t>(node) + 2 < part.size(), "no such node");
            for (int j = 0; j < 3; j++) {
                const std::int64_t x = part.data()[3 * node + j];
                if (x <= last) continue;
                require(x < static_cast<std::int64_t>(L), "no such part");
                last = x;
                double off = value.data()[m] - last_value.data()[x];
                if (cyclic) off -= 2 * M_PI * nearest_whole(off / (2 * M_PI));
                off = std::fabs(off);
                if (off > reach + half.data()[m] + last_half.data()[x]) continue;
                found.push_back(static_cast<std::int32_t>(x));
                if (off < nearest) nearest = off, before.data()[m] = found.back();
            }
        }
        end[m + 1] = found.size();
        most = std::max(most, end[m + 1] - end[m]);
    }
    std::vector<std::int32_t> out(most * M, none);
    for (std::size_t m = 0; m < M; m++)
        for (std::size_t d = end[m]; d < end[m + 1]; d++) out[(d - end[m]) * M + m] = found[d];
    return array_of(out);
}

// Nodes of two poses, `q` (W, n) and `to` (M, n), and of each `near` (2, W) and `near_to` (2, M) what
// clearance there is proven, and how far a value reaches; of `joints` (3, n) whole turns that count, scales,
// and the most that one moves. States are nodes with one of the `turns` (T, C) of the `counted` joints each.
struct Motions {
    In q, to, near, near_to, joints;
    InWhole counted, turns;
    int n, W, M, C, T;
    std::vector<std::int64_t> begin;  // (T,): the states that a motion begins at; -1 is none
    double length = 0.0, lacks = 0.0, slack = 0.0;
    bool quick = false, nearly = false;  // whether joint speeds are kept, or are at ends that moved by `slack`

    Motions(const In& q, const In& to, const In& near, const In& near_to, const In& joints,
            const InWhole& counted, const InWhole& turns)
        : q(q), to(to), near(near), near_to(near_to), joints(joints), counted(counted), turns(turns),
          n(static_cast<int>(joints.size() / 3)), W(static_cast<int>(near.size() / 2)),
          M(static_cast<int>(near_to.size() / 2)), C(static_cast<int>(counted.size())),
          T(static_cast<int>(turns.shape(0))), begin(T) {
        const std::size_t size = static_cast<std::size_t>(n);
        require(joints.size() == 3 * size && q.size() == W * size && to.size() == M * size &&
                    near.size() == 2 * static_cast<std::size_t>(W) &&
                    near_to.size() == 2 * static_cast<std::size_t>(M) &&
                    turns.size() == static_cast<std::size_t>(T) * C,
                "nodes and joints do not fit");
    }

    void states(std::int64_t from, int m) {
        require(from >= 0 && from < W, "no such node");
        const double *a = q.data() + from * n, *b = to.data() + m * n;
        for (int t = 0; t < T; t++) {
            std::int64_t number = 0;
            for (int c = 0; c < C && number >= 0; c++) {
                const std::int64_t j = counted.data()[c], end = -turns.data()[c];  // the least is first
                const double off = nearest_whole((b[j] - a[j]) / (2 * M_PI));
                const double turned = static_cast<double>(turns.data()[t * C + c]) + off;
                if (!(std::fabs(turned) <= static_cast<double>(end))) number = -1;
                else number = number * (2 * end + 1) + static_cast<std::int64_t>(turned) + end;
            }
            begin[t] = number < 0 ? -1 : from * T + number;
        }
    }

    void measure(std::int64_t from, int m) {
        const double *a = q.data() + from * n, *b = to.data() + m * n;
        const double *turn = joints.data(), *scale = turn + n, *most = scale + n;
        double square = 0.0;
        slack = std::max(near_to.data()[M + m], near.data()[W + from]);
        quick = nearly = true;
        for (int j = 0; j < n; j++) {
            double gap = b[j] - a[j];
            gap = (gap - turn[j] * nearest_whole(gap * (0.5 / M_PI))) * scale[j];
            square += gap * gap;
            quick &= std::fabs(gap) <= most[j];
            nearly &= std::fabs(gap) <= most[j] + 2 * slack;
        }
        length = std::sqrt(square);
        lacks = length - (near_to.data()[m] + near.data()[from]);
    }
};

// The best states of the pose before for each state of nodes `to`, and bounds of all others. `best`
// (2, W, T) is what paths have there, the second one relaxed; `value` and `room` (M,) what nodes
// have, within limits (2, M, T) or not; `source` (D, M) where motions begin, and whether that is `far`.
// `found` (M, T) is what short motions surely leave, `from` the state, `relaxed` (M, T) what all do
// that are clear or short. Returned are motions to be proved: state, value, state before, and what
// long ones lack (else -inf); and motions whose clearance is to be bounded: node, node before, slack
// and relaxed values (T,).
nb::tuple onward(Motions& motion, const InWhole& source, const InFlags& far, const In& best,
                 const In& value, const In& room, const InFlags& within, double floor, double margin,
                 Out found, OutWhole from, Out relaxed) {
    const int M = motion.M, T = motion.T;
    const std::size_t states = static_cast<std::size_t>(M) * T;
    const int D = M ? static_cast<int>(source.size() / M) : 0;
    const std::size_t all = static_cast<std::size_t>(motion.W) * T;
    require(far.size() == source.size() && best.size() == 2 * all && value.size() == room.size() &&
                static_cast<int>(room.size()) == M && within.size() == 2 * states &&
                found.size() == states && from.size() == states && relaxed.size() == states,
            "nodes and motions do not fit");
    std::vector<std::int64_t> cell, before, node, last;
    std::vector<double> held, lack, slack, may;
    struct Edge {
        std::int64_t from;
        double lacks, slack;
        bool usable, open;
    };
    struct Way {
        std::int64_t state;
        double value, relaxed;
        bool near;
    };
    std::vector<Edge> edges(D);
    std::vector<Way> ways(static_cast<std::size_t>(D) * T);
    for (int m = 0; m < M; m++) {
        double* sure = found.data() + m * T;
        double* loose = relaxed.data() + m * T;
        std::fill(sure, sure + T, kNever);
        std::fill(loose, loose + T, kNever);
        std::fill(from.data() + m * T, from.data() + (m + 1) * T, 0);
        for (int d = 0; d < D; d++) {
            const std::int64_t x = source.data()[static_cast<std::size_t>(d) * M + m];
            motion.states(x, m);
            bool any = false;
            for (int t = 0; t < T; t++) {
                const std::int64_t state = motion.begin[t];
                Way& way = ways[d * T + t] = {state, kNever, kNever, false};
                if (state < 0) continue;
                if (within.data()[m * T + t])
                    way.value = std::min(best.data()[state], value.data()[m]);
                if (within.data()[states + m * T + t])
                    way.relaxed = std::min(best.data()[all + state], room.data()[m]);
                any |= way.value > sure[t] || way.relaxed > loose[t];
            }
            Edge& edge = edges[d] = {x, 0.0, 0.0, false, false};
            if (!any) continue;
            motion.measure(x, m);
            const bool is_short = motion.length < 2 * room.data()[m];
            const bool passes = motion.lacks < 0 || is_short;
            edge = {x, motion.lacks >= 0 && !is_short ? motion.lacks : kNever, motion.slack,
                    motion.quick && !far.data()[static_cast<std::size_t>(d) * M + m],
                    motion.nearly && !passes && std::isfinite(motion.lacks)};
            for (int t = 0; t < T; t++) {
                Way& way = ways[d * T + t];
                // On a line distance falls by no more than length^2 / 8 over itself.
                way.near = edge.usable && motion.lacks < 0 &&
                           motion.length * motion.length < 4 * margin * way.value;
                if (way.near && way.value > sure[t])
                    sure[t] = way.value, from.data()[m * T + t] = way.state;
                if (motion.nearly && passes) loose[t] = std::max(loose[t], way.relaxed);
            }
        }
        for (int d = 0; d < D; d++) {
            bool more = false;
            for (int t = 0; t < T; t++) {
                const Way& way = ways[d * T + t];
                more |= way.relaxed > std::max({loose[t], sure[t], floor});
                if (!edges[d].usable || way.near || !(way.value > std::max(sure[t], floor))) continue;
                cell.push_back(m * T + t), before.push_back(way.state);
                held.push_back(way.value), lack.push_back(edges[d].lacks);
            }
            if (!edges[d].open || !more) continue;
            node.push_back(m), last.push_back(edges[d].from), slack.push_back(edges[d].slack);
            for (int t = 0; t < T; t++) may.push_back(ways[d * T + t].relaxed);
        }
    }
    const nb::tuple proofs = nb::make_tuple(array_of(cell), array_of(held), array_of(before), array_of(lack));
    const nb::tuple bounds = nb::make_tuple(array_of(node), array_of(last), array_of(slack), array_of(may));
    return nb::make_tuple(proofs, bounds);
}

// As `onward`, toward the pose before: `through` (W,) and `passing` (M,) are what paths to and on
// from nodes have. `back` (W,) is raised to what motions that are clear or short leave; returned are
// the others that may leave more than `least`.
nb::tuple onward_back(Motions& motion, const InWhole& source, const In& through,
                      const In& passing, const In& room, double least, Out back) {
    const int M = motion.M, D = M ? static_cast<int>(source.size() / M) : 0;
    require(static_cast<int>(through.size()) == motion.W && back.size() == through.size() &&
                static_cast<int>(passing.size()) == M && static_cast<int>(room.size()) == M,
            "nodes and motions do not fit");
    std::vector<std::int64_t> node, last;
    std::vector<double> slack, may;
    for (int d = 0; d < D; d++)
        for (int m = 0; m < M; m++) {
            const std::int64_t x = source.data()[static_cast<std::size_t>(d) * M + m];
            require(x >= 0 && x < static_cast<std::int64_t>(back.size()), "no such node");
            const double value = std::min(through.data()[x], passing.data()[m]);
            if (!(value > std::max(least, back.data()[x]))) continue;
            motion.measure(x, m);
            if (!motion.nearly) continue;
            if (motion.lacks < 0 || motion.length < 2 * room.data()[m]) back.data()[x] = value;
            else if (std::isfinite(motion.lacks))
                node.push_back(m), last.push_back(x), slack.push_back(motion.slack),
                    may.push_back(value);
        }
    return nb::make_tuple(array_of(node), array_of(last), array_of(slack), array_of(may));
}

}  // namespace

void add_motions(nb::module_& m) {
    define(m, "divided", &divided);
    nb::class_<Motions> motions(m, "Motions");
    motions.def(nb::init<const In&, const In&, const In&, const In&, const In&, const InWhole&, const InWhole&>());
    define(motions, "onward", &onward);
    define(motions, "onward_back", &onward_back);
}

}  // namespace pinsing
