// Converts expressions (voxeld.v1.Expression) to nodes of a graph.
#pragma once

#include <string>
#include <vector>

#include "daemon/wire/check.h"
#include "gpu/implicit/parse.h"

namespace voxeld::v1 {
class Expression;
}

namespace voxeld::daemon::wire {

// Returns: the names between spaces, at most `most` plus one that shows that there are more.
std::vector<std::string> SplitNames(const std::string& names, size_t most);

struct ExpressionContext {
  const gpu::implicit::Parameters& parameters;
  gpu::implicit::ParseLimits limits;
  gpu::implicit::Graph& graph;
};

// Reads a surface, with the bounds that its text states; a tree states none.
MaybeFault ToShape(const FieldPath& path, const v1::Expression& in,
                   const ExpressionContext& context, gpu::implicit::ParsedShape* out);
// Reads a condition, which is true where the node is ≤ 0; as text it is a comparison.
MaybeFault ToCondition(const FieldPath& path, const v1::Expression& in,
                       const ExpressionContext& context, gpu::implicit::Graph::Node* out);
MaybeFault ToValue(const FieldPath& path, const v1::Expression& in,
                   const ExpressionContext& context, gpu::implicit::Graph::Node* out);

}  // namespace voxeld::daemon::wire
