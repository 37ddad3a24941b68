// Expressions as graphs. They are built node by node: equal nodes are created once, constants are
// computed, and graphs are compiled into programs (program.h).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/status/statusor.h"
#include "gpu/implicit/program.h"

namespace voxeld::gpu::implicit {

// Thread-compatible. A node is an index that is valid for this graph only.
class Graph {
 public:
  using Node = int32_t;

  // Adds any operation that a program may have; −1 stands for arguments that it does not have.
  Node Operation(Op op, uint32_t immediate, Node a, Node b) { return Make({op, immediate, a, b}); }

  // Adds the nearest value in single precision; it stays finite if `value` is finite.
  Node Constant(double value);
  Node Axis(int axis) { return Leaf(static_cast<Op>(static_cast<int>(Op::kX) + axis), 0); }
  Node Voxel() { return Leaf(Op::kVoxel, 0); }

  Node Neg(Node a) { return Unary(Op::kNeg, a); }
  Node Abs(Node a) { return Unary(Op::kAbs, a); }
  Node Square(Node a) { return Unary(Op::kSquare, a); }
  Node Sqrt(Node a) { return Unary(Op::kSqrt, a); }
  Node Cbrt(Node a) { return Unary(Op::kCbrt, a); }
  Node Sin(Node a) { return Unary(Op::kSin, a); }
  Node Cos(Node a) { return Unary(Op::kCos, a); }
  Node Exp(Node a) { return Unary(Op::kExp, a); }
  Node Log(Node a) { return Unary(Op::kLog, a); }
  Node Floor(Node a) { return Unary(Op::kFloor, a); }
  Node PowI(Node a, int32_t exponent);  // within ±kMostExponent
  Node Add(Node a, Node b) { return Binary(Op::kAdd, a, b); }
  Node Sub(Node a, Node b) { return Binary(Op::kSub, a, b); }
  Node Mul(Node a, Node b) { return Binary(Op::kMul, a, b); }
  Node Div(Node a, Node b) { return Binary(Op::kDiv, a, b); }
  Node Min(Node a, Node b) { return Binary(Op::kMin, a, b); }
  Node Max(Node a, Node b) { return Binary(Op::kMax, a, b); }
  Node Atan2(Node y, Node x) { return Binary(Op::kAtan2, y, x); }

  // Computes a^b: by squaring if b is a whole constant, as a root if it is ½ or ⅓, otherwise as
  // exp(b·log a), which is NaN for a < 0.
  Node Pow(Node a, Node b);
  Node Tan(Node a) { return Div(Sin(a), Cos(a)); }
  Node Asin(Node a);
  Node Acos(Node a);
  Node Sinh(Node a);
  Node Cosh(Node a);
  Node Tanh(Node a);
  Node Mod(Node a, Node b);  // a − b·⌊a/b⌋
  // Minimum and maximum, rounded off where the values differ by less than k: min(a, b) − max(k − |a
  // − b|, 0)²/(4k).
  Node SmoothMin(Node a, Node b, Node k);
  Node SmoothMax(Node a, Node b, Node k);
  Node Length(std::span<const Node> of);  // √ of the sum of squares

  size_t size() const { return nodes_.size(); }

 private:
  friend class Compiler;
  struct Content {
    Op op;
    uint32_t immediate = 0;
    Node a = -1, b = -1;
    bool operator==(const Content&) const = default;
    template <typename H>
    friend H AbslHashValue(H h, const Content& c) {
      return H::combine(std::move(h), c.op, c.immediate, c.a, c.b);
    }
  };

  Node Make(const Content& content);
  Node Leaf(Op op, uint32_t immediate) { return Make({op, immediate}); }
  Node Unary(Op op, Node a) { return Make({op, 0, a}); }
  Node Binary(Op op, Node a, Node b) { return Make({op, 0, a, b}); }
  bool IsConstant(Node a, float* value) const;

  std::vector<Content> nodes_;
  absl::flat_hash_map<Content, Node> made_;
};

// The input from which a program is compiled.
struct ProgramSource {
  Graph::Node surface = -1;
  Graph::Node bound = -1;                // −1: none
  Graph::Node color[3] = {-1, -1, -1};   // three of them; one, with a table; or none
  std::span<const uint32_t> table = {};  // kTableColors, or none
  std::span<const uint32_t> ring_ends = {};
  uint32_t ring_axis = 2;
};

// Appends instructions that leave `roots` in `root_slots`, and returns how many. Errors: as
// Compile's.
absl::StatusOr<uint32_t> CompilePart(const Graph& graph, std::span<const Graph::Node> roots,
                                     std::span<uint32_t> root_slots, std::vector<uint32_t>& words);

// Errors: ResourceExhausted, with the numbers, if one of the three parts takes more than
// kMostInstructions or kMostSlots.
absl::StatusOr<std::vector<uint32_t>> Compile(const Graph& graph, const ProgramSource& source);

}  // namespace voxeld::gpu::implicit
