#include "gpu/implicit/graph.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::gpu::implicit {

bool Graph::IsConstant(Node a, float* value) const {
  const Content& c = nodes_[static_cast<size_t>(a)];
  if (c.op != Op::kConstant) return false;
  *value = FromBits(c.immediate);
  return true;
}

// A node over constants becomes their value, as the program would compute it.
Graph::Node Graph::Make(const Content& content) {
  float a = 0, b = 0;
  const bool constant = !IsLeaf(content.op) && IsConstant(content.a, &a) &&
                        (!IsBinary(content.op) || IsConstant(content.b, &b));
  if (constant) {
    const Instruction in =
        Instruction::Of(content.op, 2, 0, IsBinary(content.op) ? 1 : 0, content.immediate);
    const uint32_t code[2] = {in.word, in.immediate};
    const float nowhere[3] = {};
    float slots[3] = {a, b, 0};
    Run(code, 1, nowhere, 0.0f, slots);
    return Leaf(Op::kConstant, BitsOf(slots[2]));
  }
  const auto [it, fresh] = made_.try_emplace(content, static_cast<Node>(nodes_.size()));
  if (fresh) nodes_.push_back(content);
  return it->second;
}

Graph::Node Graph::Constant(double value) {
  constexpr double kMost = std::numeric_limits<float>::max();
  const double held = std::isfinite(value) ? std::clamp(value, -kMost, kMost) : value;
  return Leaf(Op::kConstant, BitsOf(static_cast<float>(held)));
}

Graph::Node Graph::PowI(Node a, int32_t exponent) {
  if (exponent == 1) return a;
  if (exponent == 2) return Square(a);
  return Make({Op::kPowI, static_cast<uint32_t>(exponent), a});
}

Graph::Node Graph::Pow(Node a, Node b) {
  float exponent;
  if (IsConstant(b, &exponent)) {
    if (exponent == std::floor(exponent) && std::fabs(exponent) <= kMostExponent) {
      return PowI(a, static_cast<int32_t>(exponent));
    }
    if (exponent == 0.5f) return Sqrt(a);
    if (exponent == 1.0f / 3.0f) return Cbrt(a);
  }
  return Exp(Mul(b, Log(a)));
}

Graph::Node Graph::Asin(Node a) { return Atan2(a, Sqrt(Sub(Constant(1), Square(a)))); }
Graph::Node Graph::Acos(Node a) { return Atan2(Sqrt(Sub(Constant(1), Square(a))), a); }
Graph::Node Graph::Sinh(Node a) { return Mul(Constant(0.5), Sub(Exp(a), Exp(Neg(a)))); }
Graph::Node Graph::Cosh(Node a) { return Mul(Constant(0.5), Add(Exp(a), Exp(Neg(a)))); }
Graph::Node Graph::Tanh(Node a) {
  return Sub(Constant(1), Div(Constant(2), Add(Exp(Add(a, a)), Constant(1))));
}
Graph::Node Graph::Mod(Node a, Node b) { return Sub(a, Mul(b, Floor(Div(a, b)))); }

Graph::Node Graph::SmoothMin(Node a, Node b, Node k) {
  const Node overlap = Max(Sub(k, Abs(Sub(a, b))), Constant(0));
  // If k is 0 nothing overlaps, and this avoids a division by 0.
  const Node share = Max(Mul(Constant(4), k), Constant(std::numeric_limits<float>::min()));
  return Sub(Min(a, b), Div(Square(overlap), share));
}
Graph::Node Graph::SmoothMax(Node a, Node b, Node k) { return Neg(SmoothMin(Neg(a), Neg(b), k)); }

Graph::Node Graph::Length(std::span<const Node> of) {
  Node sum = Square(of[0]);
  for (const Node node : of.subspan(1)) sum = Add(sum, Square(node));
  return Sqrt(sum);
}

// Orders the nodes under the roots, children first, and of two children the one that needs more
// slots first. Gives each node a slot until it has been read for the last time.
class Compiler {
 public:
  explicit Compiler(const Graph& graph) : graph_(graph) {}

  absl::StatusOr<uint32_t> Compile(const char* what, std::span<const Graph::Node> roots,
                                   std::span<uint32_t> root_slots, std::vector<uint32_t>& words) {
    order_.clear();
    place_.assign(graph_.nodes_.size(), -1);
    weight_.assign(graph_.nodes_.size(), 0);
    weighed_ = 0;
    for (const Graph::Node root : roots) Visit(root);
    std::vector<size_t> last(order_.size(), 0);
    for (size_t i = 0; i < order_.size(); ++i) {
      ForChildren(order_[i], [&](Graph::Node child) { last[PlaceOf(child)] = i; });
    }
    for (const Graph::Node root : roots) last[PlaceOf(root)] = order_.size();
    std::vector<uint32_t> slots(order_.size());
    std::vector<bool> taken;
    for (size_t i = 0; i < order_.size(); ++i) {
      const Graph::Content& c = graph_.nodes_[static_cast<size_t>(order_[i])];
      ForChildren(order_[i], [&](Graph::Node child) {
        if (last[PlaceOf(child)] == i) taken[slots[PlaceOf(child)]] = false;
      });
      const uint32_t a = c.a < 0 ? 0 : slots[PlaceOf(c.a)], b = c.b < 0 ? a : slots[PlaceOf(c.b)];
      // Do not reuse a slot that the same instruction reads: it may be written before the other
      // argument is read.
      uint32_t to = 0;
      while (to < taken.size() && (taken[to] || (c.a >= 0 && to == a) || (c.b >= 0 && to == b))) {
        ++to;
      }
      if (to >= taken.size()) taken.resize(to + 1);
      taken[to] = true;
      slots[i] = to;
      const Instruction in =
          Instruction::Of(c.op, to, c.a < 0 ? to : a, c.a < 0 ? to : b, c.immediate);
      words.push_back(in.word);
      words.push_back(in.immediate);
    }
    if (order_.size() > kMostInstructions || taken.size() > kMostSlots) {
      return absl::ResourceExhaustedError(
          absl::StrCat("the ", what, " takes ", order_.size(), " operations and ", taken.size(),
                       " intermediate results at once; at most ", kMostInstructions, " and ",
                       kMostSlots, " are possible"));
    }
    for (size_t r = 0; r < roots.size(); ++r) root_slots[r] = slots[PlaceOf(roots[r])];
    return static_cast<uint32_t>(order_.size());
  }

 private:
  template <typename F>
  void ForChildren(Graph::Node node, F&& f) const {
    const Graph::Content& c = graph_.nodes_[static_cast<size_t>(node)];
    if (c.a >= 0) f(c.a);
    if (c.b >= 0) f(c.b);
  }
  size_t PlaceOf(Graph::Node node) const {
    return static_cast<size_t>(place_[static_cast<size_t>(node)]);
  }
  // Computes how many slots a tree would take. Children have smaller numbers than their parents.
  int Weight(Graph::Node root) {
    for (; weighed_ <= root; ++weighed_) {
      const Graph::Node n = weighed_;
      int& weight = weight_[static_cast<size_t>(n)];
      const Graph::Content& c = graph_.nodes_[static_cast<size_t>(n)];
      const int a = c.a < 0 ? 0 : weight_[static_cast<size_t>(c.a)];
      const int b = c.b < 0 ? 0 : weight_[static_cast<size_t>(c.b)];
      weight = std::max({1, a == b ? a + (c.b < 0 ? 0 : 1) : std::max(a, b)});
    }
    return weight_[static_cast<size_t>(root)];
  }
  // Not recursive, because graphs may be deep.
  void Visit(Graph::Node root) {
    std::vector<std::pair<Graph::Node, bool>> stack = {{root, false}};
    while (!stack.empty()) {
      const auto [node, entered] = stack.back();
      stack.pop_back();
      int32_t& place = place_[static_cast<size_t>(node)];
      if (place >= 0) continue;
      if (entered) {
        place = static_cast<int32_t>(order_.size());
        order_.push_back(node);
        continue;
      }
      stack.emplace_back(node, true);
      const Graph::Content& c = graph_.nodes_[static_cast<size_t>(node)];
      Graph::Node first = c.a, second = c.b;
      if (second >= 0 && Weight(second) > Weight(first)) std::swap(first, second);
      if (second >= 0) stack.emplace_back(second, false);
      if (first >= 0) stack.emplace_back(first, false);
    }
  }

  const Graph& graph_;
  std::vector<Graph::Node> order_;
  std::vector<int32_t> place_;
  std::vector<int> weight_;
  Graph::Node weighed_ = 0;  // nodes below this number have their weights
};

absl::StatusOr<uint32_t> CompilePart(const Graph& graph, std::span<const Graph::Node> roots,
                                     std::span<uint32_t> root_slots, std::vector<uint32_t>& words) {
  return Compiler(graph).Compile("surface", roots, root_slots, words);
}

absl::StatusOr<std::vector<uint32_t>> Compile(const Graph& graph, const ProgramSource& source) {
  ProgramHeader header;
  std::vector<uint32_t> words(kHeaderWords);
  Compiler compiler(graph);
  const Graph::Node surface[1] = {source.surface}, bound[1] = {source.bound};
  absl::StatusOr<uint32_t> count =
      compiler.Compile("surface", surface, {&header.surface_slot, 1}, words);
  if (!count.ok()) return count.status();
  header.surface = *count;
  if (source.bound >= 0) {
    count = compiler.Compile("bound", bound, {&header.bound_slot, 1}, words);
    if (!count.ok()) return count.status();
    header.bound = *count;
  }
  if (source.color[0] >= 0) {
    const size_t roots = source.table.empty() ? 3 : 1;
    header.color_by = roots == 3 ? ColorBy::kChannels : ColorBy::kTable;
    count = compiler.Compile("colour", {source.color, roots}, {header.color_slots, roots}, words);
    if (!count.ok()) return count.status();
    header.color = *count;
  }
  header.rings = static_cast<uint32_t>(source.ring_ends.size());
  header.ring_axis = source.ring_axis;
  words.insert(words.end(), source.ring_ends.begin(), source.ring_ends.end());
  if (header.color_by == ColorBy::kTable) {
    words.insert(words.end(), source.table.begin(), source.table.end());
  }
  std::memcpy(words.data(), &header, sizeof(header));
  return words;
}

}  // namespace voxeld::gpu::implicit
