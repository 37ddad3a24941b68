// A hoisted program (hoisted.h) as C++, so that a compiler can make of it what an interpreter cannot: the same
// operations in the same order, on the functions of number.h, row.h and dual.h.
//
// The text is of a struct in this namespace, which is to include row.h before:
//
//   struct Formula {
//     template <class N> struct Row { template <class At> explicit Row(const At& at); };
//     template <class M, class N, class At> static M Value(const Row<N>& row, const At& at);
//   };
//
// Row is what is the same all along x, in N: float, or Dual<float>. Value is P, in M: N, or Lanes<n> of N.
// Both ask `at` for what there is, in their own number:
//   Hoisted(axis, value)   a hoisted value of an axis, by its number
//   Constant(word)         the immediate at that place among the program's words
//   Coordinate(r)          x, y or z of the shape
//   Voxel()                the edge of a voxel
// Of the client's expression there is nothing in it but operations: no names, no numbers but exponents.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace voxeld::gpu::implicit {

// Programs of the same key have the same text: they differ in constants alone, and in what was hoisted.
// `hoisted`: the words.
std::vector<uint32_t> FormulaKey(std::span<const uint32_t> hoisted);
std::string FormulaText(std::span<const uint32_t> hoisted);
// About how much code it makes, in simple operations.
uint64_t FormulaWeight(std::span<const uint32_t> hoisted);

}  // namespace voxeld::gpu::implicit
