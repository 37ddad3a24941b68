// Expressions (voxeld.v1.Expression) into nodes of a graph.
#pragma once

#include <string>
#include <vector>

#include "daemon/wire/check.h"
#include "gpu/implicit/parse.h"

namespace voxeld::v1 {
class Expression;
}

namespace voxeld::daemon::wire {

// What stands between spaces: the first `most` and one more, if there are more.
std::vector<std::string> SplitNames(const std::string& names, size_t most);

struct ExpressionContext {
  const gpu::implicit::Parameters& parameters;
  gpu::implicit::ParseLimits limits;
  gpu::implicit::Graph& graph;
};

// A surface, with what its text says of bounds; a tree has none.
MaybeFault ToShape(const FieldPath& path, const v1::Expression& in,
                   const ExpressionContext& context, gpu::implicit::ParsedShape* out);
// What is true where it is ≤ 0: as text a condition.
MaybeFault ToCondition(const FieldPath& path, const v1::Expression& in,
                       const ExpressionContext& context, gpu::implicit::Graph::Node* out);
MaybeFault ToValue(const FieldPath& path, const v1::Expression& in,
                   const ExpressionContext& context, gpu::implicit::Graph::Node* out);

}  // namespace voxeld::daemon::wire
