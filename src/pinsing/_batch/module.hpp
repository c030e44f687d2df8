// What the parts of the Python module share.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <initializer_list>
#include <string>
#include <type_traits>

#include "kernel.hpp"

namespace pinsing {

using In = nanobind::ndarray<const double, nanobind::c_contig, nanobind::device::cpu>;
using InFlags = nanobind::ndarray<const bool, nanobind::c_contig, nanobind::device::cpu>;
using InWhole = nanobind::ndarray<const std::int64_t, nanobind::c_contig, nanobind::device::cpu>;
using Out = nanobind::ndarray<double, nanobind::c_contig, nanobind::device::cpu>;
using OutWhole = nanobind::ndarray<std::int64_t, nanobind::c_contig, nanobind::device::cpu>;

// As std::rint, of less than 2^51: a call where instructions are not those of the newest processors.
inline double nearest_whole(double x) { return (x + 0x1.8p52) - 0x1.8p52; }

const Kernel& kernel_named(const std::string& isa);
Chain chain_of(const In& R, const In& t, const InFlags& prismatic);
void require(bool condition, const char* what);

template <class Array>
void require_shape(const Array& array, const char* name, std::initializer_list<std::size_t> shape) {
    bool good = array.ndim() == shape.size();
    std::string text;
    std::size_t axis = 0;
    for (const std::size_t size : shape) {
        good = good && array.shape(axis++) == size;
        text += (text.empty() ? "" : ", ") + std::to_string(size);
    }
    require(good, (std::string(name) + " must have shape (" + text + ")").c_str());
}

// How many rows of n numbers Q has.
inline std::size_t rows_of(const In& Q, std::size_t n) {
    const std::size_t N = Q.ndim() > 0 ? Q.shape(0) : 0;
    require_shape(Q, "Q", {N, n});
    return N;
}

// An argument that Python gives by its place: an array as it is, never a copy of another type.
template <class Argument>
struct Given {
    static auto arg() { return nanobind::arg(); }
};
template <class... Kind>
struct Given<nanobind::ndarray<Kind...>> {
    static auto arg() { return nanobind::arg().noconvert(); }
};

// Functions of the module, and methods of its classes; _kernel.pyi has the names of arguments.
template <class Return, class... Arguments>
void define(nanobind::module_& m, const char* name, Return (*function)(Arguments...)) {
    m.def(name, function, Given<std::decay_t<Arguments>>::arg()...);
}
template <class Self, class Return, class... Arguments>
void define(nanobind::class_<Self>& type, const char* name, Return (*function)(Self&, Arguments...)) {
    type.def(name, function, Given<std::decay_t<Arguments>>::arg()...);
}
template <class Self, class Return, class... Arguments>
void define(nanobind::class_<Self>& type, const char* name, Return (Self::*method)(Arguments...) const) {
    type.def(name, method, Given<std::decay_t<Arguments>>::arg()...);
}

void add_conditions(nanobind::module_& m);
void add_samples(nanobind::module_& m);
void add_poses(nanobind::module_& m);
void add_motions(nanobind::module_& m);

}  // namespace pinsing
