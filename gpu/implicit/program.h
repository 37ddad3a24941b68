// Programs of expressions, which both engines run, on whatever number type.
//
// A program is a sequence of 32-bit words, which is stored in a geometry's indices:
//   header        ProgramHeader's fields
//   instructions  two words each: of the surface P, of the bound Φ, of the colour, in this order
//   rings         the end of each closed curve of the boundary, among the geometry's positions
//   table         256 colours 0x00RRGGBB, with kTable
// Each of the three parts runs by itself, over kMostSlots slots, and leaves its results in slots
// that the header names. Every slot is written before it is read.
#pragma once

#include <cstdint>

#include "gpu/implicit/dual.h"

namespace voxeld::gpu::implicit {

enum class Op : uint8_t {
  kConstant,  // immediate
  kX,
  kY,
  kZ,
  kVoxel,    // the edge of a voxel in the shape's own units
  kHoisted,  // a value of a row: immediate; only within engines (hoist.h)
  kNeg,
  kAbs,
  kSquare,
  kSqrt,
  kCbrt,
  kSin,
  kCos,
  kExp,
  kLog,
  kFloor,
  kPowI,  // exponent: immediate
  kAdd,
  kSub,
  kMul,
  kDiv,
  kMin,
  kMax,
  kAtan2,
};
inline constexpr uint32_t kOps = 24;
VOXELD_HD constexpr bool IsLeaf(Op op) { return op <= Op::kHoisted; }
VOXELD_HD constexpr bool IsBinary(Op op) { return op >= Op::kAdd; }

inline constexpr uint32_t kMostSlots = 24;
inline constexpr uint32_t kMostInstructions = 1024;  // of each of the three parts
inline constexpr int32_t kMostExponent = 1024;

// From the lowest byte: op, slot written, slots read; then the immediate.
struct Instruction {
  uint32_t word, immediate;

  VOXELD_HD static Instruction Of(Op op, uint32_t to, uint32_t a, uint32_t b, uint32_t immediate) {
    return {static_cast<uint32_t>(op) | to << 8 | a << 16 | b << 24, immediate};
  }
  VOXELD_HD Op op() const { return static_cast<Op>(word & 0xFF); }
  VOXELD_HD uint32_t to() const { return word >> 8 & 0xFF; }
  VOXELD_HD uint32_t a() const { return word >> 16 & 0xFF; }
  VOXELD_HD uint32_t b() const { return word >> 24; }
};

enum class ColorBy : uint32_t { kUniform = 0, kChannels = 1, kTable = 2 };
inline constexpr uint32_t kTableColors = 256;

struct ProgramHeader {
  uint32_t surface = 0, bound = 0, color = 0;  // instructions; the surface has some
  ColorBy color_by = ColorBy::kUniform;
  uint32_t surface_slot = 0, bound_slot = 0;
  uint32_t color_slots[3] = {};  // red, green, blue, 0 to 1; or the first is the place in the table
  uint32_t rings = 0, ring_axis = 0;  // the axis along which the boundary is projected: 0 to 2
  uint32_t reserved = 0;
};
inline constexpr uint32_t kHeaderWords = sizeof(ProgramHeader) / sizeof(uint32_t);

// A program, read in place.
struct ProgramView {
  const uint32_t* words = nullptr;

  VOXELD_HD uint32_t word(uint32_t i) const { return words[i]; }
  VOXELD_HD uint32_t surface() const { return words[0]; }
  VOXELD_HD uint32_t bound() const { return words[1]; }
  VOXELD_HD uint32_t color() const { return words[2]; }
  VOXELD_HD ColorBy color_by() const { return static_cast<ColorBy>(words[3]); }
  VOXELD_HD uint32_t surface_slot() const { return words[4]; }
  VOXELD_HD uint32_t bound_slot() const { return words[5]; }
  VOXELD_HD uint32_t color_slot(uint32_t i) const { return words[6 + i]; }
  VOXELD_HD uint32_t rings() const { return words[9]; }
  VOXELD_HD uint32_t ring_axis() const { return words[10]; }
  VOXELD_HD const uint32_t* surface_code() const { return words + kHeaderWords; }
  VOXELD_HD const uint32_t* bound_code() const { return surface_code() + 2 * surface(); }
  VOXELD_HD const uint32_t* color_code() const { return bound_code() + 2 * bound(); }
  VOXELD_HD const uint32_t* ring_ends() const { return color_code() + 2 * color(); }
  VOXELD_HD const uint32_t* table() const { return ring_ends() + rings(); }
};

// Runs `count` instructions over `slots`, which has room for kMostSlots. `at`: x, y and z;
// hoisted(i): the value for Op::kHoisted.
template <class N, class Hoisted>
VOXELD_HD void Run(const uint32_t* code, uint32_t count, const N at[3], float voxel, N* slots,
                   Hoisted&& hoisted) {
  for (uint32_t i = 0; i < count; ++i) {
    const Instruction in{code[2 * i], code[2 * i + 1]};
    const N& a = slots[in.a()];
    const N& b = slots[in.b()];
    N& to = slots[in.to()];
    switch (in.op()) {
      case Op::kConstant:
        to = ConstantLike(at[0], FromBits(in.immediate));
        break;
      case Op::kX:
        to = at[0];
        break;
      case Op::kY:
        to = at[1];
        break;
      case Op::kZ:
        to = at[2];
        break;
      case Op::kVoxel:
        to = ConstantLike(at[0], voxel);
        break;
      case Op::kHoisted:
        to = hoisted(in.immediate);
        break;
      case Op::kNeg:
        to = Neg(a);
        break;
      case Op::kAbs:
        to = Abs(a);
        break;
      case Op::kSquare:
        to = Square(a);
        break;
      case Op::kSqrt:
        to = Sqrt(a);
        break;
      case Op::kCbrt:
        to = Cbrt(a);
        break;
      case Op::kSin:
        to = Sin(a);
        break;
      case Op::kCos:
        to = Cos(a);
        break;
      case Op::kExp:
        to = Exp(a);
        break;
      case Op::kLog:
        to = Log(a);
        break;
      case Op::kFloor:
        to = Floor(a);
        break;
      case Op::kPowI:
        to = PowI(a, static_cast<int32_t>(in.immediate));
        break;
      case Op::kAdd:
        to = Add(a, b);
        break;
      case Op::kSub:
        to = Sub(a, b);
        break;
      case Op::kMul:
        to = Mul(a, b);
        break;
      case Op::kDiv:
        to = Div(a, b);
        break;
      case Op::kMin:
        to = Min(a, b);
        break;
      case Op::kMax:
        to = Max(a, b);
        break;
      case Op::kAtan2:
        to = Atan2(a, b);
        break;
    }
  }
}

// Runs a program without hoisted values.
template <class N>
VOXELD_HD void Run(const uint32_t* code, uint32_t count, const N at[3], float voxel, N* slots) {
  Run(code, count, at, voxel, slots, [&](uint32_t) { return at[0]; });
}

}  // namespace voxeld::gpu::implicit
