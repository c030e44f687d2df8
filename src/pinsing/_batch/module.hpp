// What the parts of the Python module share.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <initializer_list>
#include <string>
#include <type_traits>
#include <vector>

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
void require_shape(const Array& array, const char* name, const std::vector<std::size_t>& shape) {
    bool good = array.ndim() == shape.size();
    std::string text;
    std::size_t axis = 0;
    for (const std::size_t size : shape) {
        good = good && array.shape(axis++) == size;
        text += (text.empty() ? "" : ", ") + std::to_string(size);
    }
    require(good, (std::string(name) + " must have shape (" + text + ")").c_str());
}

// A new array of NumPy's, which knows how to place large ones, and its numbers.
template <class Number>
struct Made {
    nanobind::object array;
    Number* data;

    explicit Made(const std::vector<std::size_t>& shape) : array(empty(shape)), data(in(array).data()) {}

private:
    static nanobind::object empty(const std::vector<std::size_t>& shape) {
        static const nanobind::handle make = nanobind::object(nanobind::module_::import_("numpy").attr("empty")).release();
        if (std::is_same_v<Number, double>) return make(shape);
        return make(shape, "i" + std::to_string(sizeof(Number)));
    }
    static auto in(const nanobind::object& array) {
        return nanobind::cast<nanobind::ndarray<Number, nanobind::c_contig>>(array);
    }
};

// A batch of as many items as there are in the first array that goes in. Each has a shape of its own.
struct Arrays : Batch {
    using Shape = std::initializer_list<std::size_t>;
    std::size_t count;

    Arrays(const char* name, const In& first, Shape each) : Batch{}, count(first.ndim() > 0 ? first.shape(0) : 0) {
        N = static_cast<std::int64_t>(count);
        add(name, first, each);
    }
    void add(const char* name, const In& array, Shape each) {
        require_shape(array, name, of_all(each));
        next(in) = {name, const_cast<double*>(array.data()), size(each)};
    }
    // None where it is not wanted.
    nanobind::object make(Shape each, bool wanted = true) {
        Rows& rows = next(out);
        rows = {"", nullptr, size(each)};
        if (!wanted) return nanobind::none();
        const Made<double> made(of_all(each));
        rows.at = made.data;
        return made.array;
    }

private:
    std::vector<std::size_t> of_all(Shape each) const {
        std::vector<std::size_t> shape{count};
        shape.insert(shape.end(), each);
        return shape;
    }
    static int size(Shape each) {
        std::size_t size = 1;
        for (const std::size_t axis : each) size *= axis;
        return static_cast<int>(size);
    }
    template <std::size_t most>
    static Rows& next(Rows (&rows)[most]) {
        return *std::find_if(rows, rows + most, [](const Rows& r) { return r.name == nullptr; });
    }
};

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
