#include "daemon/wire/expression.h"

#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace {

using gpu::implicit::Graph;
using gpu::implicit::ParsedShape;
using Tree = v1::Expression::Tree;
using Node = Graph::Node;

Fault FromParser(const FieldPath& path, const absl::Status& status) {
  const bool limit = status.code() == absl::StatusCode::kResourceExhausted;
  return {FieldPath(path, "text").ToString(),
          limit ? Reason::kQuotaExceeded : Reason::kInvalidValue,
          absl::StrCat(status.message(),
                       limit ? ", the most of max_expression_depth or max_expression_nodes" : "")};
}

// Returns: the number of operands of an operation.
size_t TakenBy(Tree::Op op) {
  if (op <= Tree::VOXEL) return 0;
  if (op < Tree::ADD) return 1;
  return op >= Tree::SMOOTH_MIN ? 3 : 2;
}

// Creates a node for an operation with one or more operands.
Node Make(Tree::Op op, std::span<const Node> a, Graph& g) {
  switch (op) {
    case Tree::NEGATE:
      return g.Neg(a[0]);
    case Tree::ABS:
      return g.Abs(a[0]);
    case Tree::SQUARE:
      return g.Square(a[0]);
    case Tree::SQRT:
      return g.Sqrt(a[0]);
    case Tree::CBRT:
      return g.Cbrt(a[0]);
    case Tree::SIN:
      return g.Sin(a[0]);
    case Tree::COS:
      return g.Cos(a[0]);
    case Tree::TAN:
      return g.Tan(a[0]);
    case Tree::ASIN:
      return g.Asin(a[0]);
    case Tree::ACOS:
      return g.Acos(a[0]);
    case Tree::ATAN:
      return g.Atan2(a[0], g.Constant(1));
    case Tree::EXP:
      return g.Exp(a[0]);
    case Tree::LOG:
      return g.Log(a[0]);
    case Tree::FLOOR:
      return g.Floor(a[0]);
    case Tree::ADD:
      return g.Add(a[0], a[1]);
    case Tree::SUBTRACT:
      return g.Sub(a[0], a[1]);
    case Tree::MULTIPLY:
      return g.Mul(a[0], a[1]);
    case Tree::DIVIDE:
      return g.Div(a[0], a[1]);
    case Tree::POWER:
      return g.Pow(a[0], a[1]);
    case Tree::ATAN2:
      return g.Atan2(a[0], a[1]);
    case Tree::MODULO:
      return g.Mod(a[0], a[1]);
    case Tree::MIN:
      return g.Min(a[0], a[1]);
    case Tree::MAX:
      return g.Max(a[0], a[1]);
    case Tree::DIFFERENCE:
      return g.Max(a[0], g.Neg(a[1]));
    case Tree::SMOOTH_MIN:
      return g.SmoothMin(a[0], a[1], a[2]);
    case Tree::SMOOTH_MAX:
      return g.SmoothMax(a[0], a[1], a[2]);
    default:
      return -1;
  }
}

// Consumes a tree's values and names as its operations need them.
class TreeReader {
 public:
  TreeReader(const FieldPath& path, const Tree& tree, const ExpressionContext& context)
      : path_(path),
        tree_(tree),
        context_(context),
        names_(SplitNames(tree.names(), context.limits.nodes)) {}

  MaybeFault Read(Node* out) {
    std::vector<Node> left;
    for (int i = 0; i < tree_.ops_size(); ++i) {
      const Tree::Op op = tree_.ops(i);
      const FieldPath at(path_, "ops", i);
      if (op == Tree::OP_UNSPECIFIED || !Tree::Op_IsValid(op)) {
        return UnknownEnum(at, op, "CONSTANT to SMOOTH_MAX");
      }
      const size_t taken = TakenBy(op);
      if (left.size() < taken) {
        return Fault{at.ToString(), Reason::kSizeMismatch,
                     absl::StrCat("is ", Tree::Op_Name(op), ", which takes ", taken, "; there are ",
                                  left.size())};
      }
      Node node = -1;
      if (taken == 0) {
        if (auto fault = ReadLeaf(op, at, &node)) return fault;
      } else {
        node = Make(op, std::span(left).last(taken), context_.graph);
        left.resize(left.size() - taken);
      }
      left.push_back(node);
      if (context_.graph.size() > context_.limits.nodes) {
        return Fault{FieldPath(path_, "ops").ToString(), Reason::kQuotaExceeded,
                     absl::StrCat("has more than ", context_.limits.nodes,
                                  " operations, max_expression_nodes")};
      }
    }
    if (left.size() != 1) {
      return Fault{
          FieldPath(path_, "ops").ToString(), Reason::kSizeMismatch,
          absl::StrCat("leaves ", left.size(), " numbers; give operations that leave one")};
    }
    if (next_value_ != tree_.values_size() || next_name_ != names_.size()) {
      return Fault{
          path_.ToString(), Reason::kSizeMismatch,
          absl::StrCat("has ", tree_.values_size(), " values and ", names_.size(), " names for ",
                       next_value_, " constants and ", next_name_, " parameters")};
    }
    *out = left.front();
    return {};
  }

 private:
  MaybeFault ReadLeaf(Tree::Op op, const FieldPath& at, Node* out) {
    Graph& graph = context_.graph;
    if (op == Tree::CONSTANT) {
      if (next_value_ == tree_.values_size()) {
        return Fault{at.ToString(), Reason::kSizeMismatch,
                     absl::StrCat("is a CONSTANT beyond the ", tree_.values_size(), " values")};
      }
      const int place = next_value_++;
      if (auto fault = CheckFloat(FieldPath(path_, "values", place), tree_.values(place)))
        return fault;
      *out = graph.Constant(tree_.values(place));
    } else if (op == Tree::PARAMETER) {
      if (next_name_ == names_.size()) {
        return Fault{at.ToString(), Reason::kSizeMismatch,
                     absl::StrCat("is a PARAMETER beyond the ", names_.size(), " names")};
      }
      const std::string& name = names_[next_name_++];
      const auto it = context_.parameters.find(name);
      if (it == context_.parameters.end()) {
        return Fault{FieldPath(path_, "names").ToString(), Reason::kNotFound,
                     absl::StrCat("has ", Quote(name), ", which is none of the parameters")};
      }
      *out = graph.Constant(it->second);
    } else {
      *out = op == Tree::VOXEL ? graph.Voxel() : graph.Axis(op - Tree::X);
    }
    return {};
  }

  const FieldPath& path_;
  const Tree& tree_;
  const ExpressionContext& context_;
  std::vector<std::string> names_;
  int next_value_ = 0;
  size_t next_name_ = 0;
};

MaybeFault ToNode(const FieldPath& path, const Tree& in, const ExpressionContext& context,
                  Node* out) {
  return TreeReader(path, in, context).Read(out);
}

}  // namespace

std::vector<std::string> SplitNames(const std::string& names, size_t most) {
  std::vector<std::string> split;
  for (const absl::string_view name : absl::StrSplit(names, ' ', absl::SkipEmpty())) {
    split.emplace_back(name);
    if (split.size() > most) break;
  }
  return split;
}

MaybeFault ToShape(const FieldPath& path, const v1::Expression& in,
                   const ExpressionContext& context, ParsedShape* out) {
  switch (in.form_case()) {
    case v1::Expression::kText: {
      absl::StatusOr<ParsedShape> shape =
          gpu::implicit::ParseShape(in.text(), context.parameters, context.limits, context.graph);
      if (!shape.ok()) return FromParser(path, shape.status());
      *out = *shape;
      return {};
    }
    case v1::Expression::kTree:
      return ToNode(FieldPath(path, "tree"), in.tree(), context, &out->surface);
    case v1::Expression::FORM_NOT_SET:
      break;
  }
  return Fault{path.ToString(), Reason::kInvalidValue, "is not set; give text or tree"};
}

MaybeFault ToCondition(const FieldPath& path, const v1::Expression& in,
                       const ExpressionContext& context, Node* out) {
  if (in.form_case() != v1::Expression::kText) return ToValue(path, in, context, out);
  const absl::StatusOr<Node> node =
      gpu::implicit::ParseCondition(in.text(), context.parameters, context.limits, context.graph);
  if (!node.ok()) return FromParser(path, node.status());
  *out = *node;
  return {};
}

MaybeFault ToValue(const FieldPath& path, const v1::Expression& in,
                   const ExpressionContext& context, Node* out) {
  if (in.form_case() == v1::Expression::kTree) {
    return ToNode(FieldPath(path, "tree"), in.tree(), context, out);
  }
  if (in.form_case() != v1::Expression::kText) {
    return Fault{path.ToString(), Reason::kInvalidValue, "is not set; give text or tree"};
  }
  const absl::StatusOr<Node> node =
      gpu::implicit::ParseValue(in.text(), context.parameters, context.limits, context.graph);
  if (!node.ok()) return FromParser(path, node.status());
  *out = *node;
  return {};
}

}  // namespace voxeld::daemon::wire
