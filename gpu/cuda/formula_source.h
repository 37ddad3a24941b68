// The source of a kernel for one formula, and the sources that it includes.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "gpu/cuda/nvrtc.h"

namespace voxeld::gpu::cuda {

inline constexpr const char* kFormulaKernel = "voxeld_find_covered";

// Returns the source of a kernel that does the same as FindCovered (implicit_kernels.h), for shapes
// with that program's key (implicit/formula_text.h):
//   void voxeld_find_covered(CoveredViews views)
// `hoisted`: the program (implicit/hoisted.h).
std::string FormulaSource(std::span<const uint32_t> hoisted);
// Returns all sources that covered-inl.h includes, as they are in the tree, and the required parts
// of the standard library.
std::span<const NamedSource> FormulaSources();

}  // namespace voxeld::gpu::cuda
