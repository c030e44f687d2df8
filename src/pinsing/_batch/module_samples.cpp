// What surrounds the singular values of a map: where its configurations are, and how the values
// are distributed. One pass each, with the roundings of NumPy's separate operations, so that an
// installation without this module finds the same bits (CMakeLists.txt forbids contraction here).
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

// Column columns[j] of out (N, n) gets low[j] plus width[j] times coordinate j of a sample. Its words are
// those of floats in [1, 2), one more than the coordinates: `block` (B, k), from row `place` on, xor the
// first of `heads` (H, k), then the whole of it xor the next one.
void put_words(const InWords& block, const InWords& heads, std::size_t place, const InWhole& columns,
               const In& low, const In& width, Out out) {
    require(block.ndim() == 2 && heads.ndim() == 2 && out.ndim() == 2,
            "block, heads and out must have two axes");
    const std::size_t B = block.shape(0), k = block.shape(1), N = out.shape(0), n = out.shape(1);
    require_shape(heads, "heads", {heads.shape(0), k});
    require_shape(columns, "columns", {k});
    require_shape(low, "low", {k});
    require_shape(width, "width", {k});
    require(place < B && place + N <= B * heads.shape(0), "the sample is not as long");
    for (std::size_t j = 0; j < k; j++)
        require(columns.data()[j] >= 0 && static_cast<std::size_t>(columns.data()[j]) < n,
                "columns must be in 0..n-1");
    const std::int64_t* const column = columns.data();
    const std::uint64_t *word = block.data() + place * k, *head = heads.data();
    const double *from = low.data(), *wide = width.data();
    bool in_order = true;
    for (std::size_t j = 1; j < k; j++) in_order = in_order && column[j] == column[j - 1] + 1;
    double* const out_end = out.data() + N * n;
    const nb::gil_scoped_release release;
    // Where the size is a constant and columns are neighbours, a point is a few vectors.
    const auto put = [&](auto size) {
        for (double* row = out.data(); row != out_end; row += n, word += size) {
            if (place++ == B) place = 1, word = block.data(), head += size;
            double* const at = row + column[0];
            for (std::size_t j = 0; j < size; j++) {
                const std::uint64_t digits = word[j] ^ head[j];
                double one_more;
                std::memcpy(&one_more, &digits, sizeof one_more);
                (in_order ? at[j] : row[column[j]]) = (one_more - 1.0) * wide[j] + from[j];
            }
        }
    };
    switch (in_order ? k : 0) {
        case 5: return put(std::integral_constant<std::size_t, 5>{});
        case 6: return put(std::integral_constant<std::size_t, 6>{});
        case 7: return put(std::integral_constant<std::size_t, 7>{});
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
    define(m, "put_words", &put_words);
    define(m, "count_values", &count_values);
}

}  // namespace pinsing
