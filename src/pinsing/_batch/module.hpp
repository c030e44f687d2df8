// What the parts of the Python module share.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <string>

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
void add_conditions(nanobind::module_& m);
void add_residues(nanobind::module_& m);
void add_samples(nanobind::module_& m);
void add_poses(nanobind::module_& m);
void add_motions(nanobind::module_& m);

}  // namespace pinsing
