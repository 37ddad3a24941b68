#include "daemon/wire/open_edges.h"

#include <algorithm>
#include <numeric>
#include <tuple>
#include <vector>

namespace voxeld::daemon::wire {
namespace {

// Requires: `vertex(corner)` is less than `vertices`.
template <typename VertexOf>
std::optional<OpenEdge> Find(uint32_t corners, uint32_t vertices, VertexOf&& vertex) {
  // For each vertex, the greater vertices with which it has edges, in one array.
  std::vector<uint32_t> begin(size_t{vertices} + 1), greater;
  const auto for_edges = [&](auto&& f) {
    for (uint32_t corner = 0; corner < corners; ++corner) {
      const uint32_t a = vertex(corner), b = vertex(corner % 3 == 2 ? corner - 2 : corner + 1);
      if (a != b) f(std::min(a, b), std::max(a, b));
    }
  };
  for_edges([&](uint32_t least, uint32_t) { ++begin[size_t{least} + 1]; });
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  greater.resize(begin.back());
  for_edges([&](uint32_t least, uint32_t most) { greater[begin[least]++] = most; });
  // Each entry of `begin` is now the end of its row.
  uint32_t row = 0;
  for (uint32_t least = 0; least < vertices; ++least) {
    const auto first = greater.begin() + row, end = greater.begin() + begin[least];
    row = begin[least];
    std::sort(first, end);
    for (auto at = first; at != end;) {
      const auto next = std::upper_bound(at, end, *at);
      if ((next - at) % 2 != 0) {
        return OpenEdge{least, *at, static_cast<uint32_t>(next - at)};
      }
      at = next;
    }
  }
  return std::nullopt;
}

// Returns: for each vertex, the first vertex at its position.
std::vector<uint32_t> FirstAtPositions(std::span<const float> positions) {
  const auto at = [&](uint32_t vertex) {
    const float* p = &positions[size_t{vertex} * 3];
    return std::tuple(p[0], p[1], p[2]);
  };
  std::vector<uint32_t> order(positions.size() / 3), first(order.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](uint32_t a, uint32_t b) { return at(a) != at(b) ? at(a) < at(b) : a < b; });
  for (size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && at(order[i]) == at(order[i - 1]);
    first[order[i]] = same ? first[order[i - 1]] : order[i];
  }
  return first;
}

}  // namespace

std::optional<OpenEdge> FindOpenEdge(std::span<const float> positions,
                                     std::span<const uint32_t> indices) {
  const uint32_t vertices = static_cast<uint32_t>(positions.size() / 3);
  const auto vertex_of = [&](uint32_t corner) {
    return indices.empty() ? corner : indices[corner];
  };
  const uint32_t corners = indices.empty() ? vertices : static_cast<uint32_t>(indices.size());
  if (!indices.empty() && !Find(corners, vertices, vertex_of)) return std::nullopt;
  const std::vector<uint32_t> first = FirstAtPositions(positions);
  return Find(corners, vertices, [&](uint32_t corner) { return first[vertex_of(corner)]; });
}

}  // namespace voxeld::daemon::wire
