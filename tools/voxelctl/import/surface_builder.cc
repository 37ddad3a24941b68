#include "tools/voxelctl/import/surface_builder.h"

#include <algorithm>
#include <cmath>

#include "absl/hash/hash.h"

namespace voxeld::voxelctl {
namespace {

constexpr uint32_t kFree = 0xffffffff;
constexpr size_t kFirstSlots = 1024;

// Adding zero turns −0 into 0, which is the same place.
size_t HashOf(const Corner& c, bool colored) {
  const Rgb color = colored ? c.color : Rgb{};
  return absl::HashOf(c.position.x + 0.0, c.position.y + 0.0, c.position.z + 0.0, c.normal.x + 0.0,
                      c.normal.y + 0.0, c.normal.z + 0.0, color.r, color.g, color.b);
}

}  // namespace

SurfaceBuilder::SurfaceBuilder(bool colored) : colored_(colored), slots_(kFirstSlots, kFree) {
  part_.kind = Kind::kTriangles;
}

bool SurfaceBuilder::Add(const Corner& corner) {
  if (part_.indices.size() >= kMaxModelIndices) return false;
  size_t slot = SlotOf(corner);
  if (slots_[slot] == kFree) {
    if (part_.positions.size() >= kMaxModelVertices) return false;
    if (part_.positions.size() * 2 >= slots_.size()) {
      Grow();
      slot = SlotOf(corner);
    }
    slots_[slot] = static_cast<uint32_t>(part_.positions.size());
    part_.positions.push_back(corner.position);
    part_.normals.push_back(corner.normal);
    if (colored_) part_.colors.push_back(corner.color);
  }
  part_.indices.push_back(slots_[slot]);
  return true;
}

void SurfaceBuilder::Grow() {
  slots_.assign(slots_.size() * 2, kFree);
  for (uint32_t v = 0; v < part_.positions.size(); ++v) slots_[SlotOf(VertexAt(v))] = v;
}

size_t SurfaceBuilder::SlotOf(const Corner& corner) const {
  const size_t mask = slots_.size() - 1;
  size_t slot = HashOf(corner, colored_) & mask;
  while (slots_[slot] != kFree) {
    const Corner other = VertexAt(slots_[slot]);
    if (other.position == corner.position && other.normal == corner.normal &&
        (!colored_ || other.color == corner.color)) {
      break;
    }
    slot = (slot + 1) & mask;
  }
  return slot;
}

Corner SurfaceBuilder::VertexAt(uint32_t vertex) const {
  return {part_.positions[vertex], part_.normals[vertex], colored_ ? part_.colors[vertex] : Rgb{}};
}

double Dot(const Point3& a, const Point3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

Point3 UnitOrZero(const Point3& v) {
  const double length = std::hypot(v.x, v.y, v.z);
  if (!(length > 1e-12) || !std::isfinite(length)) return {};
  return {v.x / length, v.y / length, v.z / length};
}

Point3 FacetNormal(const Point3& a, const Point3& b, const Point3& c) {
  const Point3 u = {b.x - a.x, b.y - a.y, b.z - a.z}, v = {c.x - a.x, c.y - a.y, c.z - a.z};
  const Point3 n = {u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x};
  // A small model's triangles have small areas, so the cross product is scaled before its length is
  // tested.
  const double largest = std::max({std::abs(n.x), std::abs(n.y), std::abs(n.z)});
  if (!(largest > 0) || !std::isfinite(largest)) return {};
  return UnitOrZero({n.x / largest, n.y / largest, n.z / largest});
}

}  // namespace voxeld::voxelctl
