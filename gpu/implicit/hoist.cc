#include "gpu/implicit/hoist.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <optional>
#include <span>

#include "gpu/implicit/graph.h"

namespace voxeld::gpu::implicit {
namespace {

using Node = Graph::Node;

// An operation of the program, by number; its arguments are earlier operations.
struct Operation {
  Op op;
  uint32_t immediate;
  int a = -1, b = -1;
  uint32_t axes = 0;  // bits
  uint32_t cost = 1;  // operations under it, as a tree
  bool hoisted = false;
};

std::vector<Operation> OperationsOf(const ProgramView& program, const uint32_t depends[3],
                                    int* root) {
  std::vector<Operation> operations;
  int at_slot[kMostSlots] = {};
  for (uint32_t i = 0; i < program.surface(); ++i) {
    const Instruction in{program.surface_code()[2 * i], program.surface_code()[2 * i + 1]};
    Operation o{in.op(), in.immediate};
    if (!IsLeaf(in.op())) o.a = at_slot[in.a()];
    if (IsBinary(in.op())) o.b = at_slot[in.b()];
    if (in.op() >= Op::kX && in.op() <= Op::kZ) {
      o.axes = depends[static_cast<int>(in.op()) - static_cast<int>(Op::kX)];
    }
    for (const int argument : {o.a, o.b}) {
      if (argument < 0) continue;
      o.axes |= operations[static_cast<size_t>(argument)].axes;
      o.cost = std::min(1u << 20, o.cost + operations[static_cast<size_t>(argument)].cost);
    }
    at_slot[in.to()] = static_cast<int>(i);
    operations.push_back(o);
  }
  *root = at_slot[program.surface_slot()];
  return operations;
}

bool IsOfOneAxis(const Operation& o) { return std::has_single_bit(o.axes); }

// Marks the operations that depend on one axis only and that are used by an operation which depends
// on more, or are the root. If there are too many, marks the most expensive ones.
void ChooseHoisted(std::vector<Operation>& operations, int root) {
  std::vector<bool> wanted(operations.size());
  // Visit only operations that the root uses.
  std::vector<int> open = {root};
  std::vector<bool> seen(operations.size());
  while (!open.empty()) {
    const int at = open.back();
    open.pop_back();
    if (seen[static_cast<size_t>(at)]) continue;
    seen[static_cast<size_t>(at)] = true;
    const Operation& o = operations[static_cast<size_t>(at)];
    if (IsOfOneAxis(o)) {
      wanted[static_cast<size_t>(at)] = true;
      continue;
    }
    for (const int argument : {o.a, o.b}) {
      if (argument >= 0) open.push_back(argument);
    }
  }
  std::vector<size_t> order;
  for (size_t i = 0; i < operations.size(); ++i) {
    if (wanted[i]) order.push_back(i);
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return operations[a].cost > operations[b].cost; });
  uint32_t all = 0, of_axis[3] = {};
  for (const size_t i : order) {
    uint32_t& axis = of_axis[std::countr_zero(operations[i].axes)];
    if (all == kMostHoisted || axis == kMostHoistedOfAxis) continue;
    operations[i].hoisted = true;
    ++all;
    ++axis;
  }
}

// Creates the nodes of all operations. If there are `numbers`, hoisted values replace the
// operations that they stand for.
std::vector<Node> NodesOf(const std::vector<Operation>& operations, Graph& graph,
                          const std::vector<int>* numbers) {
  std::vector<Node> made(operations.size(), -1);
  const auto at = [&](int argument) {
    return argument < 0 ? -1 : made[static_cast<size_t>(argument)];
  };
  for (size_t i = 0; i < operations.size(); ++i) {
    const Operation& o = operations[i];
    made[i] = numbers != nullptr && o.hoisted
                  ? graph.Operation(Op::kHoisted, static_cast<uint32_t>((*numbers)[i]), -1, -1)
                  : graph.Operation(o.op, o.immediate, at(o.a), at(o.b));
  }
  return made;
}

struct Parts {
  HoistedHeader header;
  std::vector<uint32_t> slots, code;

  std::vector<uint32_t> Words() const {
    std::vector<uint32_t> words(kHoistedWords);
    std::memcpy(words.data(), &header, sizeof(header));
    words.insert(words.end(), slots.begin(), slots.end());
    words.insert(words.end(), code.begin(), code.end());
    return words;
  }
};

// Returns nullopt if some part does not fit.
std::optional<Parts> Part(const std::vector<Operation>& operations, int root) {
  Parts parts;
  std::vector<int> numbers(operations.size(), -1);
  Graph graph;
  const std::vector<Node> whole = NodesOf(operations, graph, nullptr);
  uint32_t next = 0;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<Node> roots;
    for (size_t i = 0; i < operations.size(); ++i) {
      if (!operations[i].hoisted || operations[i].axes != 1u << axis) continue;
      numbers[i] = static_cast<int>(next++);
      roots.push_back(whole[i]);
    }
    parts.header.end[axis] = next;
    if (roots.empty()) continue;
    std::vector<uint32_t> slots(roots.size());
    const absl::StatusOr<uint32_t> count = CompilePart(graph, roots, slots, parts.code);
    if (!count.ok()) return std::nullopt;
    parts.header.axis[axis] = *count;
    parts.slots.insert(parts.slots.end(), slots.begin(), slots.end());
  }
  Graph rest_graph;
  const std::vector<Node> rest = NodesOf(operations, rest_graph, &numbers);
  const Node roots[1] = {rest[static_cast<size_t>(root)]};
  const size_t begin = parts.code.size();
  const absl::StatusOr<uint32_t> count =
      CompilePart(rest_graph, roots, {&parts.header.rest_slot, 1}, parts.code);
  if (!count.ok()) return std::nullopt;
  parts.header.rest = *count;
  for (size_t i = begin; i < parts.code.size(); i += 2) {
    const Op op = Instruction{parts.code[i], 0}.op();
    if (op >= Op::kX && op <= Op::kZ) parts.header.needs_coordinates = 1;
  }
  return parts;
}

}  // namespace

std::vector<uint32_t> Hoist(const ProgramView& program, const uint32_t depends[3]) {
  int root;
  std::vector<Operation> operations = OperationsOf(program, depends, &root);
  ChooseHoisted(operations, root);
  if (const std::optional<Parts> parts = Part(operations, root)) return parts->Words();
  Parts whole;
  whole.header.rest = program.surface();
  whole.header.rest_slot = program.surface_slot();
  whole.header.needs_coordinates = 1;
  whole.code.assign(program.surface_code(), program.surface_code() + 2 * program.surface());
  return whole.Words();
}

}  // namespace voxeld::gpu::implicit
