// Writes a hoisted program (hoisted.h) as C++, so that a compiler can optimise it better than an
// interpreter can: the same operations in the same order, on the functions of number.h, row.h and
// dual.h.
//
// The text defines a struct in this namespace; row.h must be included before it:
//
//   struct Formula {
//     template <class N> struct Row { template <class At> explicit Row(const At& at); };
//     template <class M, class N, class At> static M Value(const Row<N>& row, const At& at);
//   };
//
// Row holds the values that are the same all along x, in N: float, or Dual<float>. Value returns P,
// in M: N, or Lanes<n> of N. Both get their inputs from `at`, in their own number type:
//   Hoisted(axis, value)   a hoisted value of an axis, by its number
//   Constant(word)         the immediate at that place among the program's words
//   Coordinate(r)          x, y or z of the shape
//   Voxel()                the edge of a voxel
// From the client's expression the text contains only operations: no names, and no numbers except
// exponents.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace voxeld::gpu::implicit {

// Returns a key. Programs with the same key have the same text: they differ only in constants, and
// in the values that were hoisted. `hoisted`: the program's words.
std::vector<uint32_t> FormulaKey(std::span<const uint32_t> hoisted);
std::string FormulaText(std::span<const uint32_t> hoisted);
// Returns the approximate size of the code, in simple operations.
uint64_t FormulaWeight(std::span<const uint32_t> hoisted);

}  // namespace voxeld::gpu::implicit
