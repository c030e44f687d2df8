// Finite fields with an odd prime below 2^62 to a power of elements, and polynomials at points there.
//
// Residues are kept in Montgomery's form (Montgomery, "Modular multiplication without trial
// division", 1985): a stands for a * 2^64. An element of a field of p^k elements is k residues, the
// coefficients of a polynomial in a root of the field's modulus, lowest first.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <utility>
#include <vector>

namespace pinsing {

using Residue = std::uint64_t;

// Residues modulo one prime.
class PrimeField {
  public:
    explicit PrimeField(std::uint64_t prime) : p(prime) {
        std::uint64_t x = prime;  // Newton's iteration for the inverse modulo 2^64: 3 bits, then 6, ...
        for (int i = 0; i < 6; i++) x *= 2 - prime * x;
        minus_inverse_ = 0 - x;
        const std::uint64_t turn = static_cast<std::uint64_t>((Wide{1} << 64) % prime);
        square_ = static_cast<std::uint64_t>(Wide{turn} * turn % prime);
        one_ = turn;
    }

    Residue add(Residue a, Residue b) const {
        const Residue sum = a + b;
        return sum >= p ? sum - p : sum;
    }
    Residue subtract(Residue a, Residue b) const { return a >= b ? a - b : a + p - b; }
    Residue multiply(Residue a, Residue b) const { return reduced(Wide{a} * b); }
    Residue entered(std::uint64_t a) const { return multiply(a % p, square_); }
    std::uint64_t left(Residue a) const { return reduced(a); }
    Residue one() const { return one_; }

    const std::uint64_t p;

  private:
    using Wide = unsigned __int128;

    Residue reduced(Wide t) const {
        const std::uint64_t m = static_cast<std::uint64_t>(t) * minus_inverse_;
        const std::uint64_t r = static_cast<std::uint64_t>((t + Wide{m} * p) >> 64);
        return r >= p ? r - p : r;
    }

    std::uint64_t minus_inverse_, square_, one_;
};

// A polynomial modulo a prime: coefficients, and variables with exponents of each term.
struct ModularPolynomial {
    std::vector<Residue> coefficients;
    std::vector<std::size_t> ends;  // of each term in `powers`
    std::vector<std::pair<int, int>> powers;
};

// A point whose coordinates are residues, or elements of an extension, given by its modulus.
class FieldPoint {
  public:
    // Variables that are free have coordinates in the extension, in the order of `free`.
    FieldPoint(std::uint64_t prime, std::vector<std::uint64_t> const& modulus, int variables)
        : field(prime), degree_(static_cast<int>(modulus.size()) - 1), kinds_(variables, 0),
          scalars_(variables), places_(variables, -1) {
        for (int i = 0; i < degree_; i++)
            modulus_.push_back(field.subtract(0, field.entered(modulus[i])));
        product_.resize(static_cast<std::size_t>(2 * degree_));
    }

    void fix(int variable, std::uint64_t value) {
        kinds_[variable] = 1;
        scalars_[variable] = {field.one(), field.entered(value)};
    }

    void free(int variable, std::vector<std::uint64_t> const& value) {
        kinds_[variable] = 2;
        places_[variable] = static_cast<int>(coordinates_.size());
        std::vector<Residue> x(static_cast<std::size_t>(degree_), 0);
        for (std::size_t i = 0; i < value.size(); i++) x[i] = field.entered(value[i]);
        coordinates_.push_back({unit(), std::move(x)});
    }

    int degree() const { return degree_; }
    int variables() const { return static_cast<int>(kinds_.size()); }
    int kind(int variable) const { return kinds_[variable]; }
    int places() const { return static_cast<int>(coordinates_.size()); }

    // Value of a polynomial, all of whose variables are known: k residues.
    std::vector<Residue> value(ModularPolynomial const& poly) {
        std::vector<Residue> total(static_cast<std::size_t>(degree_), 0);
        std::size_t at = 0;
        for (std::size_t t = 0; t < poly.coefficients.size(); t++) {
            Residue scale = poly.coefficients[t];
            Key key{0, 0};
            for (; at < poly.ends[t]; at++) {
                const auto [v, e] = poly.powers[at];
                if (kinds_[v] == 1)
                    scale = field.multiply(scale, power(v, e));
                else
                    key.put(places_[v], e);
            }
            const Residue* x = &monomials_[monomial(key)];
            for (int i = 0; i < degree_; i++)
                total[i] = field.add(total[i], field.multiply(scale, x[i]));
        }
        return total;
    }

    // A polynomial at the point, as one in the variable v that is not known: k residues for each
    // power of it, up to the highest.
    std::vector<std::vector<Residue>> line(ModularPolynomial const& poly, int v) {
        std::vector<std::vector<Residue>> out;
        std::size_t at = 0;
        for (std::size_t t = 0; t < poly.coefficients.size(); t++) {
            Residue scale = poly.coefficients[t];
            Key key{0, 0};
            std::size_t exponent = 0;
            for (; at < poly.ends[t]; at++) {
                const auto [u, e] = poly.powers[at];
                if (u == v)
                    exponent = static_cast<std::size_t>(e);
                else if (kinds_[u] == 1)
                    scale = field.multiply(scale, power(u, e));
                else
                    key.put(places_[u], e);
            }
            while (out.size() <= exponent)
                out.emplace_back(static_cast<std::size_t>(degree_), 0);
            const Residue* x = &monomials_[monomial(key)];
            for (int i = 0; i < degree_; i++)
                out[exponent][i] = field.add(out[exponent][i], field.multiply(scale, x[i]));
        }
        return out;
    }

    // Whether x b - y a = 0, of variables x and y and numbers a and b.
    bool along(int x, int y, std::uint64_t a, std::uint64_t b) {
        const std::vector<Residue> left = coordinate(x), right = coordinate(y);
        const Residue s = field.entered(b), t = field.entered(a);
        for (int i = 0; i < degree_; i++)
            if (field.multiply(left[i], s) != field.multiply(right[i], t)) return false;
        return true;
    }

    // Whether a variable has a value.
    bool equals(int x, std::uint64_t a) {
        const std::vector<Residue> value = coordinate(x);
        for (int i = 1; i < degree_; i++)
            if (value[i]) return false;
        return value[0] == field.entered(a);
    }

    // Rank of a matrix of elements, by rows, which is destroyed: no element is divided by another.
    int rank(std::vector<std::vector<Residue>>& entries, int rows, int columns) {
        int rank = 0;
        std::vector<Residue> one(static_cast<std::size_t>(degree_)), other(one);
        for (int j = 0; j < columns && rank < rows; j++) {
            int pivot = rank;
            while (pivot < rows && zero(entries[pivot * columns + j])) pivot++;
            if (pivot == rows) continue;
            if (pivot != rank)
                std::swap_ranges(entries.begin() + pivot * columns,
                                 entries.begin() + (pivot + 1) * columns,
                                 entries.begin() + rank * columns);
            const std::vector<Residue>& lead = entries[rank * columns + j];
            for (int i = rank + 1; i < rows; i++) {
                const std::vector<Residue> below = entries[i * columns + j];
                if (zero(below)) continue;
                for (int c = j + 1; c < columns; c++) {
                    std::vector<Residue>& x = entries[i * columns + c];
                    multiply(x.data(), lead.data(), one.data());
                    multiply(below.data(), entries[rank * columns + c].data(), other.data());
                    for (int k = 0; k < degree_; k++) x[k] = field.subtract(one[k], other[k]);
                }
            }
            rank++;
        }
        return rank;
    }

    static bool zero(std::vector<Residue> const& x) {
        return std::all_of(x.begin(), x.end(), [](Residue r) { return r == 0; });
    }

    const PrimeField field;

  private:
    // Exponents of up to 16 free variables, a byte each.
    struct Key {
        std::uint64_t low, high;
        void put(int place, int exponent) {
            std::uint64_t& half = place < 8 ? low : high;
            half |= static_cast<std::uint64_t>(exponent) << (8 * (place % 8));
        }
        int at(int place) const {
            return static_cast<int>((place < 8 ? low : high) >> (8 * (place % 8)) & 255);
        }
        void clear(int place) {
            std::uint64_t& half = place < 8 ? low : high;
            half &= ~(std::uint64_t{255} << (8 * (place % 8)));
        }
        bool operator==(Key const& other) const { return low == other.low && high == other.high; }
    };
    struct Hash {
        std::size_t operator()(Key const& key) const {
            return static_cast<std::size_t>((key.low ^ key.high * 0x9e3779b97f4a7c15u) *
                                            0xff51afd7ed558ccdu >> 16);
        }
    };

    std::vector<Residue> unit() const {
        std::vector<Residue> x(static_cast<std::size_t>(degree_), 0);
        x[0] = field.one();
        return x;
    }

    std::vector<Residue> coordinate(int variable) {
        if (kinds_[variable] == 2) return coordinates_[places_[variable]][1];
        std::vector<Residue> x(static_cast<std::size_t>(degree_), 0);
        x[0] = scalars_[variable][1];
        return x;
    }

    Residue power(int variable, int exponent) {
        std::vector<Residue>& known = scalars_[variable];
        while (static_cast<int>(known.size()) <= exponent)
            known.push_back(field.multiply(known.back(), known[1]));
        return known[exponent];
    }

    // Index of a product of powers in `monomials_`: each is computed once.
    std::size_t monomial(Key key) {
        const auto found = index_.find(key);
        if (found != index_.end()) return found->second;
        std::vector<Residue> x = unit();
        int last = places() - 1;
        while (last >= 0 && !key.at(last)) last--;
        if (last >= 0) {
            const int exponent = key.at(last);
            std::vector<std::vector<Residue>>& known = coordinates_[last];
            while (static_cast<int>(known.size()) <= exponent) {
                known.push_back(unit());
                multiply(known[known.size() - 2].data(), known[1].data(), known.back().data());
            }
            Key rest = key;
            rest.clear(last);
            const std::size_t before = monomial(rest);
            multiply(&monomials_[before], known[exponent].data(), x.data());
        }
        const std::size_t place = monomials_.size();
        monomials_.insert(monomials_.end(), x.begin(), x.end());
        index_.emplace(key, place);
        return place;
    }

    // out = a b in the extension; out is neither of them.
    void multiply(const Residue* a, const Residue* b, Residue* out) {
        const int k = degree_;
        if (k == 1) {
            out[0] = field.multiply(a[0], b[0]);
            return;
        }
        std::fill(product_.begin(), product_.end(), 0);
        for (int i = 0; i < k; i++)
            for (int j = 0; j < k; j++)
                product_[i + j] = field.add(product_[i + j], field.multiply(a[i], b[j]));
        for (int d = 2 * k - 2; d >= k; d--)  // x^k is minus the rest of the modulus
            for (int i = 0; i < k; i++)
                product_[d - k + i] =
                    field.add(product_[d - k + i], field.multiply(product_[d], modulus_[i]));
        std::copy(product_.begin(), product_.begin() + k, out);
    }

    const int degree_;
    std::vector<int> kinds_;  // of each variable: 0 unknown, 1 a residue, 2 free
    std::vector<std::vector<Residue>> scalars_;  // powers of those that are residues
    std::vector<int> places_;                    // of those that are free among these
    std::vector<std::vector<std::vector<Residue>>> coordinates_;  // powers of the free ones
    std::vector<Residue> modulus_;                                // minus all but the leading one
    std::vector<Residue> product_;
    std::vector<Residue> monomials_;
    std::unordered_map<Key, std::size_t, Hash> index_;
};

}  // namespace pinsing
