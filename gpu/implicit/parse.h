// Expressions as text.
//
//   shape      = relation [ "where" condition ]
//   relation   = sum [ ("=" | "<=" | "<" | ">=" | ">") sum ]
//   condition  = conjunction { "or" conjunction }
//   conjunction = negation { "and" negation }
//   negation   = "not" negation | "(" condition ")" | sum ("<=" | "<" | ">=" | ">") sum { … }
//   sum        = product { ("+" | "-") product }
//   product    = signed { ("*" | "/") signed }
//   signed     = { "+" | "-" } power
//   power      = atom [ "^" signed ]
//   atom       = number | name | name "(" sum { "," sum } ")" | "(" sum ")"
//
// Names are x, y, z, the constants pi, tau and e, `voxel` (the edge of a voxel in the shape's
// units) and the caller's parameters. Functions: sqrt cbrt abs floor square sin cos tan asin acos
// atan atan2 sinh cosh tanh exp log (ln) pow root mod min max (of two or more) clamp length smin
// smax (smooth, within k) union intersection difference. × · ÷ − ≤ ≥ ** have their usual meaning.
// "<" means "<=": sides are distinguished by P ≤ 0. A condition is true if it is ≤ 0: "and" is the
// maximum, "or" the minimum, "not" the negative.
#pragma once

#include <map>
#include <string>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "gpu/implicit/graph.h"

namespace voxeld::gpu::implicit {

using Parameters = std::map<std::string, double, std::less<>>;

struct ParsedShape {
  Graph::Node surface = -1;
  Graph::Node bound = -1;  // −1: none
  bool is_region = false;  // an inequality or a condition: means ≤ 0, not = 0
};

struct ParseLimits {
  size_t nodes = 1024;
  int depth = 64;  // of nested parentheses, signs and exponents
};

// Errors: InvalidArgument says what was found at which character (from 1), and what would be valid;
// ResourceExhausted names the limit.
absl::StatusOr<ParsedShape> ParseShape(absl::string_view text, const Parameters& parameters,
                                       const ParseLimits& limits, Graph& graph);
// Parses a condition alone: true where the node is ≤ 0.
absl::StatusOr<Graph::Node> ParseCondition(absl::string_view text, const Parameters& parameters,
                                           const ParseLimits& limits, Graph& graph);
// Parses a number.
absl::StatusOr<Graph::Node> ParseValue(absl::string_view text, const Parameters& parameters,
                                       const ParseLimits& limits, Graph& graph);

}  // namespace voxeld::gpu::implicit
