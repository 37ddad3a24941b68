#include "tools/voxelctl/import/ply_points.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "absl/strings/str_cat.h"
#include "tools/voxelctl/import/ply_values.h"
#include "tools/voxelctl/import/point_table.h"

namespace voxeld::voxelctl {

absl::StatusOr<Model> ReadPlyPoints(const SourceFile& file, const PlyHeader& header,
                                    bool attributes) {
  PlyValues values(file, header);
  const PlyElement* vertex = header.Find("vertex");
  for (const PlyElement& element : header.elements) {
    if (&element == vertex) break;
    if (absl::Status status = SkipPlyElement(file, element, &values); !status.ok()) return status;
  }
  absl::StatusOr<PlyVertices> vertices = ReadPlyVertices(file, *vertex, attributes, true, &values);
  if (!vertices.ok()) return vertices.status();

  // Scanners write NaN for points that they did not measure.
  Part part;
  part.kind = Kind::kPoints;
  const size_t count = vertices->positions.size();
  size_t kept = 0;
  uint64_t uncolored = 0;
  for (size_t i = 0; i < count; ++i) {
    const Point3 p = vertices->positions[i];
    if (std::isnan(p.x) || std::isnan(p.y) || std::isnan(p.z)) continue;
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) {
      return FileError(file, absl::StrCat("vertex ", i, " is (", p.x, ", ", p.y, ", ", p.z, ")"),
                       "coordinates must be finite");
    }
    vertices->positions[kept] = p;
    if (!vertices->normals.empty()) vertices->normals[kept] = vertices->normals[i];
    if (!vertices->colors.empty()) vertices->colors[kept] = vertices->colors[i];
    if (!vertices->intensities.empty()) vertices->intensities[kept] = vertices->intensities[i];
    uncolored += std::ranges::binary_search(vertices->unknown, i) ? 1 : 0;
    for (Attribute& attribute : vertices->attributes) attribute.values[kept] = attribute.values[i];
    ++kept;
  }
  if (kept == 0) {
    return FileError(file, absl::StrCat("all of its ", count, " points are not a number (NaN)"),
                     "at least one place is expected");
  }
  vertices->positions.resize(kept);
  if (!vertices->normals.empty()) vertices->normals.resize(kept);
  if (!vertices->colors.empty()) vertices->colors.resize(kept);
  if (!vertices->intensities.empty()) {
    vertices->intensities.resize(kept);
    vertices->colors = GreysOf(vertices->intensities, &uncolored);
  }
  for (Attribute& attribute : vertices->attributes) attribute.values.resize(kept);
  Model model;
  AddLeftOut("points that are not a number", count - kept, &model);
  AddLeftOut(kUnknownColors, uncolored, &model);
  AddLeftOut("other properties of vertices", vertices->others, &model);
  AddLeftOut("entries of other elements", header.OtherEntries(), &model);
  AddLeftOut("pictures", header.pictures, &model);
  part.positions = std::move(vertices->positions);
  part.normals = std::move(vertices->normals);
  part.colors = std::move(vertices->colors);
  part.attributes = std::move(vertices->attributes);
  model.path = file.path;
  model.format = "PLY points";
  model.up = Up::kZ;
  model.lit_already = !part.colors.empty();
  model.parts.push_back(std::move(part));
  return model;
}

}  // namespace voxeld::voxelctl
