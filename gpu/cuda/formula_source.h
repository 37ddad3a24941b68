// The source of a kernel for one formula, and what it includes.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "gpu/cuda/nvrtc.h"

namespace voxeld::gpu::cuda {

inline constexpr const char* kFormulaKernel = "voxeld_find_covered";

// As FindCovered (implicit_kernels.h), of shapes with that program's key (implicit/formula_text.h):
//   void voxeld_find_covered(CoveredViews views)
// `hoisted`: the program (implicit/hoisted.h).
std::string FormulaSource(std::span<const uint32_t> hoisted);
// Of covered-inl.h all that it includes, as they are in the tree, and what of the standard library that takes.
std::span<const NamedSource> FormulaSources();

}  // namespace voxeld::gpu::cuda
