// Collects triangles from files into one part: each distinct corner becomes one vertex.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {

struct Corner {
  Point3 position;
  Point3 normal;  // a unit vector, or zero if missing
  Rgb color;      // ignored unless the builder has colors
};

// Not thread-safe.
class SurfaceBuilder {
 public:
  explicit SurfaceBuilder(bool colored);

  // Adds a corner of the current triangle. Returns: false, and adds nothing, if the part would have
  // more than kMaxModelVertices vertices or kMaxModelIndices indices.
  bool Add(const Corner& corner);

  bool empty() const { return part_.indices.empty(); }
  Part Finish() && { return std::move(part_); }

 private:
  void Grow();
  size_t SlotOf(const Corner& corner) const;
  Corner VertexAt(uint32_t vertex) const;

  const bool colored_;
  Part part_;
  std::vector<uint32_t> slots_;  // vertices by the hash of their corner; kFree if unused
};

// Returns a unit vector; zero without a direction.
Point3 UnitOrZero(const Point3& v);

double Dot(const Point3& a, const Point3& b);

// Returns a triangle's unit normal by its winding; zero if it has no area.
Point3 FacetNormal(const Point3& a, const Point3& b, const Point3& c);

}  // namespace voxeld::voxelctl
