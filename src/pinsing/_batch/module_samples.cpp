// What surrounds the singular values of a map: where its configurations are, and how the values
// are distributed. One pass each, with the roundings of NumPy's separate operations, so that an
// installation without this module finds the same bits (CMakeLists.txt forbids contraction here).
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <tuple>
#include <type_traits>

#include "module.hpp"

namespace nb = nanobind;

namespace pinsing {

namespace {

using InWords = nb::ndarray<const std::uint64_t, nb::c_contig, nb::device::cpu>;
// The last column of a matrix is a column of values as well.
using InColumn = nb::ndarray<const double, nb::ndim<1>, nb::device::cpu>;

constexpr std::size_t kMostCoordinates = 64;

// Points of one Sobol sequence after another: v (bits, k) are its direction numbers, w (k,) the words
// of point i, those of floats in [1, 2). Point i + 1 follows by the exclusive-or with row ctz(i + 1).
// Where `size` is a constant, words and ranges stay in registers: nothing that is written is one of
// them.
struct Sobol {
    const std::uint64_t* v;
    std::uint64_t w[kMostCoordinates];
    double low[kMostCoordinates], width[kMostCoordinates];

    // Calls put(x) N times, with x(j) = low[j] + (coordinate j) width[j].
    template <class Size, class Put>
    static void run(Sobol s, std::uint64_t i, std::size_t N, Size k, Put put) {
        while (N-- > 0) {
            put([&](std::size_t j) {
                double digits;
                std::memcpy(&digits, &s.w[j], sizeof digits);
                return (digits - 1.0) * s.width[j] + s.low[j];
            });
            const std::uint64_t* const next = s.v + __builtin_ctzll(++i) * k;
            if (N > 0)
                for (std::size_t j = 0; j < k; j++) s.w[j] ^= next[j];
        }
    }
};

template <std::size_t k>
using Constant = std::integral_constant<std::size_t, k>;

// Point i is `words` (k,) xor the direction numbers (bits, k) at the digits of its Gray code; words
// are those of floats in [1, 2). Column columns[j] of out (N, n) gets low[j] plus width[j] times
// coordinate j, for i from start on.
void sobol_points(const InWords& directions, const InWords& words, std::uint64_t start,
                  const InWhole& columns, const In& low, const In& width, Out out) {
    require(words.ndim() == 1 && words.shape(0) >= 1 && words.shape(0) <= kMostCoordinates,
            "words must have shape (k,), k at most 64");
    const std::size_t k = words.shape(0);
    require(directions.ndim() == 2 && directions.shape(1) == k, "directions must be (bits, k)");
    require(columns.ndim() == 1 && columns.shape(0) == k && low.ndim() == 1 &&
                low.shape(0) == k && width.ndim() == 1 && width.shape(0) == k,
            "columns, low and width must have shape (k,)");
    require(out.ndim() == 2, "out must have shape (N, n)");
    const std::size_t N = out.shape(0), n = out.shape(1), bits = directions.shape(0);
    require(bits >= 1 && bits < 64 && start < (std::uint64_t{1} << bits) &&
                N <= (std::uint64_t{1} << bits) - start,
            "the sequence is not as long");
    bool in_order = k == n;
    for (std::size_t j = 0; j < k; j++) {
        require(columns.data()[j] >= 0 && static_cast<std::size_t>(columns.data()[j]) < n,
                "columns must be in 0..n-1");
        in_order = in_order && columns.data()[j] == static_cast<std::int64_t>(j);
    }
    const std::int64_t* column = columns.data();
    double* row = out.data();
    Sobol sequence{};
    sequence.v = directions.data();
    std::copy_n(words.data(), k, sequence.w);
    std::copy_n(low.data(), k, sequence.low);
    std::copy_n(width.data(), k, sequence.width);
    const std::uint64_t gray = start ^ (start >> 1);
    for (std::size_t b = 0; b < bits; b++)
        if (gray >> b & 1)
            for (std::size_t j = 0; j < k; j++) sequence.w[j] ^= directions.data()[b * k + j];

    const nb::gil_scoped_release release;
    const auto put = [&](auto size) {
        if (in_order)
            Sobol::run(sequence, start, N, size, [row, size](auto x) mutable {
                for (std::size_t j = 0; j < size; j++) row[j] = x(j);
                row += size;
            });
        else
            Sobol::run(sequence, start, N, size, [row, size, column, n](auto x) mutable {
                for (std::size_t j = 0; j < size; j++) row[column[j]] = x(j);
                row += n;
            });
    };
    switch (k) {
        case 3: return put(Constant<3>{});
        case 4: return put(Constant<4>{});
        case 5: return put(Constant<5>{});
        case 6: return put(Constant<6>{});
        case 7: return put(Constant<7>{});
        default: return put(k);
    }
}

// Adds each value to its bin, the number of which is its bits less the last `shift` of them, less
// `first`, at most the last bin and at least the first. Returns how many are at most `low`, and
// `high`, and where the first least and the first greatest value are (-1 where there is no number).
std::tuple<std::int64_t, std::int64_t, std::int64_t, std::int64_t> count_values(
    const InColumn& values, int shift, std::int64_t first, OutWhole bins, double low, double high) {
    require(bins.ndim() == 1 && bins.shape(0) >= 1, "bins must have shape (B,)");
    require(shift >= 0 && shift < 64, "no such shift");
    const std::int64_t N = static_cast<std::int64_t>(values.shape(0)), stride = values.stride(0);
    const std::int64_t last = static_cast<std::int64_t>(bins.shape(0)) - 1;
    const double* x = values.data();
    std::int64_t* const bin = bins.data();
    std::int64_t below = 0, near = 0, least = -1, greatest = -1;
    double smallest = std::numeric_limits<double>::infinity(), largest = -smallest;

    const nb::gil_scoped_release release;
    for (std::int64_t i = 0; i < N; i++, x += stride) {
        std::int64_t digits;
        std::memcpy(&digits, x, sizeof digits);
        bin[std::clamp<std::int64_t>((digits >> shift) - first, 0, last)]++;
        below += *x <= low;
        near += *x <= high;
        if (*x < smallest || (least < 0 && *x == smallest)) smallest = *x, least = i;
        if (*x > largest || (greatest < 0 && *x == largest)) largest = *x, greatest = i;
    }
    return {below, near, least, greatest};
}

}  // namespace

void add_samples(nb::module_& m) {
    define(m, "sobol_points", &sobol_points);
    define(m, "count_values", &count_values);
}

}  // namespace pinsing
