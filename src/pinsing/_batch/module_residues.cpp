// Polynomials modulo a prime, and points over its extensions, as Python classes.
//
// Checks what comes in (memory safety): exponents, variables, lengths and primes.
#include <nanobind/nanobind.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/vector.h>

#include <string>
#include <vector>

#include "module.hpp"
#include "residue_field.hpp"

namespace nb = nanobind;
using nb::literals::operator""_a;

namespace pinsing {

namespace {

constexpr int kMostExponent = 255;
constexpr int kMostFree = 16;
constexpr int kMostVariables = 4096;

void require_prime(std::uint64_t prime) {
    require(prime % 2 == 1 && prime > 2 && prime < (std::uint64_t{1} << 62),
            "the prime must be odd and below 2^62");
}

struct Polynomial {
    Polynomial(std::uint64_t prime, const std::vector<std::vector<int>>& monomials,
               const std::vector<std::uint64_t>& coefficients)
        : prime(prime) {
        require_prime(prime);
        require(monomials.size() == coefficients.size(), "a coefficient for each monomial");
        const PrimeField field(prime);
        for (std::size_t t = 0; t < monomials.size(); t++) {
            const std::vector<int>& m = monomials[t];
            require(m.size() <= kMostVariables, "too many variables");
            for (std::size_t v = 0; v < m.size(); v++) {
                require(m[v] >= 0 && m[v] <= kMostExponent, "exponents must be in 0..255");
                if (!m[v]) continue;
                listed.powers.emplace_back(static_cast<int>(v), m[v]);
                variables = std::max(variables, static_cast<int>(v) + 1);
            }
            listed.ends.push_back(listed.powers.size());
            listed.coefficients.push_back(field.entered(coefficients[t]));
        }
    }

    std::uint64_t prime;
    int variables = 0;
    ModularPolynomial listed;
};

class Point {
  public:
    Point(std::uint64_t prime, const std::vector<std::uint64_t>& modulus, int variables,
          const std::vector<std::pair<int, std::uint64_t>>& fixed,
          const std::vector<std::pair<int, std::vector<std::uint64_t>>>& free)
        : point_(checked(prime, modulus, variables), modulus, variables) {
        require(free.size() <= kMostFree, "too many free variables");
        for (const auto& [v, value] : fixed) {
            require(v >= 0 && v < variables, "no such variable");
            point_.fix(v, value);
        }
        for (const auto& [v, value] : free) {
            require(v >= 0 && v < variables && point_.kind(v) == 0, "no such variable, or twice");
            require(value.size() < modulus.size(), "a coordinate is longer than the field's degree");
            point_.free(v, value);
        }
    }

    std::vector<std::uint64_t> value(const Polynomial& poly) {
        std::vector<Residue> x = at(poly);
        for (Residue& r : x) r = point_.field.left(r);
        return x;
    }

    std::vector<std::vector<std::uint64_t>> line(const Polynomial& poly, int v) {
        require(v >= 0 && v < point_.variables() && point_.kind(v) == 0,
                "the variable of a line must have no value there");
        require_same(poly);
        for (const auto& power : poly.listed.powers)
            if (power.first != v) require_known(power.first);
        std::vector<std::vector<Residue>> found = point_.line(poly.listed, v);
        for (std::vector<Residue>& x : found)
            for (Residue& r : x) r = point_.field.left(r);
        return found;
    }

    bool is_zero(const Polynomial& poly) { return FieldPoint::zero(at(poly)); }

    int rank(const nb::sequence& rows) {
        std::vector<std::vector<Residue>> entries;
        std::size_t height = nb::len(rows), width = 0;
        for (std::size_t i = 0; i < height; i++) {
            const nb::object row = rows[i];
            const std::size_t length = nb::len(row);
            require(i == 0 || length == width, "all rows must be of one length");
            width = length;
            for (std::size_t j = 0; j < width; j++) {
                const nb::object entry = row[j];
                if (entry.is_none())
                    entries.emplace_back(static_cast<std::size_t>(point_.degree()), 0);
                else
                    entries.push_back(at(nb::cast<const Polynomial&>(entry)));
            }
        }
        return point_.rank(entries, static_cast<int>(height), static_cast<int>(width));
    }

    bool along(int x, int y, std::uint64_t a, std::uint64_t b) {
        require_known(x);
        require_known(y);
        return point_.along(x, y, a, b);
    }

    bool equals(int x, std::uint64_t a) {
        require_known(x);
        return point_.equals(x, a);
    }

  private:
    static std::uint64_t checked(std::uint64_t prime, const std::vector<std::uint64_t>& modulus,
                                 int variables) {
        require_prime(prime);
        require(modulus.size() >= 2 && modulus.size() <= 65536 && modulus.back() == 1,
                "the modulus must be monic, of degree 1 at least");
        require(variables >= 0 && variables <= kMostVariables, "too many variables");
        return prime;
    }

    void require_same(const Polynomial& poly) const {
        require(poly.prime == point_.field.p, "the polynomial is one modulo another prime");
    }

    void require_known(int v) const {
        require(v >= 0 && v < point_.variables() && point_.kind(v) != 0,
                "a variable has no value there");
    }

    std::vector<Residue> at(const Polynomial& poly) {
        require_same(poly);
        for (const auto& power : poly.listed.powers) require_known(power.first);
        return point_.value(poly.listed);
    }

    FieldPoint point_;
};

}  // namespace

void add_residues(nb::module_& m) {
    m.attr("MOST_EXPONENT") = kMostExponent;
    m.attr("MOST_FREE") = kMostFree;
    nb::class_<Polynomial>(m, "ModularPolynomial")
        .def(nb::init<std::uint64_t, const std::vector<std::vector<int>>&,
                      const std::vector<std::uint64_t>&>(),
             "prime"_a, "monomials"_a, "coefficients"_a);
    nb::class_<Point>(m, "FieldPoint")
        .def(nb::init<std::uint64_t, const std::vector<std::uint64_t>&, int,
                      const std::vector<std::pair<int, std::uint64_t>>&,
                      const std::vector<std::pair<int, std::vector<std::uint64_t>>>&>(),
             "prime"_a, "modulus"_a, "variables"_a, "fixed"_a, "free"_a)
        .def("value", &Point::value, "poly"_a)
        .def("line", &Point::line, "poly"_a, "v"_a)
        .def("is_zero", &Point::is_zero, "poly"_a)
        .def("rank", &Point::rank, "rows"_a)
        .def("along", &Point::along, "x"_a, "y"_a, "a"_a, "b"_a)
        .def("equals", &Point::equals, "x"_a, "a"_a);
}

}  // namespace pinsing
