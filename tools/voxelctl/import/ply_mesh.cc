#include "tools/voxelctl/import/ply_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "tools/voxelctl/import/ply_values.h"
#include "tools/voxelctl/import/point_table.h"
#include "tools/voxelctl/import/surface_builder.h"
#include "tools/voxelctl/import/triangulate.h"

namespace voxeld::voxelctl {
namespace {

constexpr double kSmoothCosine = 0.642787609686539;  // 50 degrees; sharper edges stay edges
constexpr size_t kMostFacesAround = 64;  // a vertex of more faces gets one normal, the mean of all

// Triangles as they are read: three vertices each, and the color of the face to which each belongs.
struct PlyTriangles {
  std::vector<uint32_t> vertices;
  std::vector<Rgb> colors;  // or none
  uint64_t too_few = 0;     // faces and pieces of strips with fewer than three vertices
};

// The lists of vertices of an element, one per entry, with colors.
struct PlyFaces {
  std::vector<uint32_t> vertices;  // of all faces
  std::vector<uint32_t> sizes;     // of each
  std::vector<Rgb> colors;         // or none
  std::vector<uint32_t> unknown;   // which colors are not finite in the file
  uint64_t others = 0;             // properties that are neither indices nor colours
};

constexpr double kMostListed = kMaxModelIndices;  // entries of a list

constexpr uint32_t kRestart = 0xffffffff;  // marks the end of a strip

absl::Status FaceError(const SourceFile& file, const PlyElement& element, uint64_t number,
                       absl::string_view found, absl::string_view expected) {
  return FileError(
      file,
      absl::StrCat(EscapeForTerminal(element.name), " ", number, " of ", element.count, " ", found),
      expected);
}

std::optional<size_t> IndexList(const PlyElement& element) {
  for (size_t p = 0; p < element.properties.size(); ++p) {
    const PlyProperty& property = element.properties[p];
    if (property.is_list && (property.name == "vertex_indices" || property.name == "vertex_index"))
      return p;
  }
  return std::nullopt;
}

absl::Status TooManyIndices(const SourceFile& file) {
  return FileError(file,
                   absl::StrCat("has over ", kMaxModelVertices, " different vertices or ",
                                kMaxModelIndices, " indices"),
                   "so large a model is not read; simplify it first");
}

// Reads "face" or "tristrips", in which −1 begins a new strip; −1 may be stored as an unsigned
// number with the same bits.
absl::StatusOr<PlyFaces> ReadFaces(const SourceFile& file, const PlyElement& element,
                                   uint64_t vertices, bool strips, PlyValues* values) {
  const std::optional<size_t> list = IndexList(element);
  if (!list) {
    return FileError(file,
                     absl::StrCat("its element \"", EscapeForTerminal(element.name),
                                  "\" has no list of vertices"),
                     "\"property list uchar int vertex_indices\" is expected");
  }
  if (element.count > kMaxModelIndices) return TooManyIndices(file);
  const PointLayout layout = PointLayout::Of(PlyColumns(element));
  PlyColors colors(element, layout.shown);
  PlyFaces faces;
  for (size_t p = 0; p < element.properties.size(); ++p) {
    if (p != *list && !(layout.shown[p] && IsColor(*layout.shown[p]))) ++faces.others;
  }
  PointRow row = {};
  const auto cut = [&](uint64_t number) {
    return FaceError(file, element, number, "is cut off or no number",
                     "the file is truncated or damaged");
  };
  for (uint64_t i = 0; i < element.count; ++i) {
    for (size_t p = 0; p < element.properties.size(); ++p) {
      const PlyProperty& property = element.properties[p];
      double value = 0;
      if (!values->Next(property.is_list ? property.count_type : property.type, &value))
        return cut(i);
      if (!property.is_list) {
        if (layout.shown[p]) row[static_cast<size_t>(*layout.shown[p])] = value;
        continue;
      }
      if (!(value >= 0 && value <= kMostListed && value == std::floor(value))) {
        return FaceError(file, element, i, absl::StrCat("has a list of ", value, " entries"),
                         absl::StrCat("0 to ", kMostListed, " are expected"));
      }
      const bool indices = p == *list;
      if (indices) faces.sizes.push_back(static_cast<uint32_t>(value));
      for (double left = value; left > 0; --left) {
        double index = 0;
        if (!values->Next(property.type, &index)) return cut(i);
        if (!indices) continue;
        const bool restart = strips && (index == -1 || index == kRestart);
        if (!restart &&
            !(index >= 0 && index < static_cast<double>(vertices) && index == std::floor(index))) {
          return FaceError(file, element, i, absl::StrCat("refers to vertex ", index),
                           absl::StrCat("the file has ", vertices, ", counted from 0"));
        }
        if (faces.vertices.size() >= kMaxModelIndices) return TooManyIndices(file);
        faces.vertices.push_back(restart ? kRestart : static_cast<uint32_t>(index));
      }
    }
    if (colors.found()) colors.Add(row);
  }
  faces.colors = std::move(colors).Finish(&faces.unknown);
  return faces;
}

// Returns the triangles of all polygons.
absl::StatusOr<PlyTriangles> Triangulated(const SourceFile& file, const PlyFaces& faces,
                                          const std::vector<Point3>& positions) {
  PlyTriangles triangles;
  Triangulator triangulator;
  std::vector<Point3> corners;
  std::vector<uint32_t> cut;
  size_t first = 0;
  for (size_t f = 0; f < faces.sizes.size(); first += faces.sizes[f++]) {
    const size_t size = faces.sizes[f];
    if (size < 3) {
      ++triangles.too_few;
      continue;
    }
    corners.clear();
    for (size_t i = 0; i < size; ++i) corners.push_back(positions[faces.vertices[first + i]]);
    cut.clear();
    triangulator.Append(corners, &cut);
    if (triangles.vertices.size() + cut.size() > kMaxModelIndices) return TooManyIndices(file);
    for (const uint32_t corner : cut) triangles.vertices.push_back(faces.vertices[first + corner]);
    if (!faces.colors.empty())
      triangles.colors.insert(triangles.colors.end(), cut.size() / 3, faces.colors[f]);
  }
  return triangles;
}

// Reverses every second triangle of a strip.
absl::StatusOr<PlyTriangles> Unstripped(const SourceFile& file, const PlyFaces& strips) {
  PlyTriangles triangles;
  size_t first = 0;
  for (size_t s = 0; s < strips.sizes.size(); first += strips.sizes[s++]) {
    const size_t end = first + strips.sizes[s];
    size_t begun = first;
    for (size_t i = first; i <= end; ++i) {
      if (i == end || strips.vertices[i] == kRestart) {
        if (i == begun + 1 || i == begun + 2) ++triangles.too_few;
        begun = i + 1;
      }
      if (i < begun + 2) continue;
      if (triangles.vertices.size() + 3 > kMaxModelIndices) return TooManyIndices(file);
      const bool turned = (i - begun) % 2 == 1;
      const uint32_t a = strips.vertices[i - 2], b = strips.vertices[i - 1];
      // A strip turns by repeating a vertex.
      const uint32_t c = strips.vertices[i];
      if (a == b || b == c || a == c) continue;
      for (const uint32_t v : {turned ? b : a, turned ? a : b, c}) triangles.vertices.push_back(v);
      if (!strips.colors.empty()) triangles.colors.push_back(strips.colors[s]);
    }
  }
  return triangles;
}

// Returns for each vertex the number of its place; vertices at the same place share one.
std::vector<uint32_t> Places(const std::vector<Point3>& positions,
                             const std::vector<uint32_t>& triangles) {
  SurfaceBuilder places(false);
  for (const uint32_t v : triangles) places.Add({positions[v], {}, {}});
  return std::move(places).Finish().indices;  // per corner
}

// Half the size of a Point3, because there are as many as corners.
using SmallVector = std::array<float, 3>;

SmallVector Small(const Point3& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

// Returns a normal for each corner of the triangles.
std::vector<SmallVector> SmoothNormals(const std::vector<Point3>& positions,
                                       const std::vector<uint32_t>& triangles) {
  const size_t corners = triangles.size();
  std::vector<SmallVector> of_face(corners / 3);
  for (size_t f = 0; f < of_face.size(); ++f) {
    of_face[f] = Small(FacetNormal(positions[triangles[3 * f]], positions[triangles[3 * f + 1]],
                                   positions[triangles[3 * f + 2]]));
  }
  const std::vector<uint32_t> place = Places(positions, triangles);
  const size_t places =
      place.empty() ? 0 : size_t{*std::max_element(place.begin(), place.end())} + 1;
  // Corners by place: those of place p are from first[p] to first[p + 1].
  std::vector<uint32_t> first(places + 1), order(corners);
  for (const uint32_t p : place) ++first[p + 1];
  for (size_t p = 0; p < places; ++p) first[p + 1] += first[p];
  std::vector<uint32_t> next(first.begin(), first.end() - 1);
  for (uint32_t c = 0; c < corners; ++c) order[next[place[c]]++] = c;

  std::vector<SmallVector> normals(corners);
  for (size_t p = 0; p < places; ++p) {
    const bool many = first[p + 1] - first[p] > kMostFacesAround;
    SmallVector normal = {};
    for (uint32_t i = first[p]; i < first[p + 1]; ++i) {
      if (!many || i == first[p]) {
        const SmallVector& own = of_face[order[i] / 3];
        Point3 sum;
        for (uint32_t j = first[p]; j < first[p + 1]; ++j) {
          const SmallVector& n = of_face[order[j] / 3];
          if (!many && own[0] * n[0] + own[1] * n[1] + own[2] * n[2] < kSmoothCosine) continue;
          sum = {sum.x + n[0], sum.y + n[1], sum.z + n[2]};
        }
        normal = Small(UnitOrZero(sum));
      }
      normals[order[i]] = normal;
    }
  }
  return normals;
}

absl::StatusOr<Part> Surface(const SourceFile& file, const PlyVertices& vertices,
                             const PlyTriangles& triangles) {
  for (const uint32_t v : triangles.vertices) {
    const Point3& p = vertices.positions[v];
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) {
      return FileError(file,
                       absl::StrCat("a face refers to vertex ", v, ", which is (", p.x, ", ", p.y,
                                    ", ", p.z, ")"),
                       "coordinates must be finite");
    }
  }
  std::vector<SmallVector> normals;
  if (vertices.normals.empty()) normals = SmoothNormals(vertices.positions, triangles.vertices);
  SurfaceBuilder surface(!triangles.colors.empty() || !vertices.colors.empty());
  for (size_t c = 0; c < triangles.vertices.size(); ++c) {
    const uint32_t v = triangles.vertices[c];
    const Corner corner = {vertices.positions[v],
                           vertices.normals.empty()
                               ? Point3{normals[c][0], normals[c][1], normals[c][2]}
                               : vertices.normals[v],
                           !triangles.colors.empty()  ? triangles.colors[c / 3]
                           : !vertices.colors.empty() ? vertices.colors[v]
                                                      : Rgb{}};
    if (!surface.Add(corner)) return TooManyIndices(file);
  }
  return std::move(surface).Finish();
}

// Counts what the surfaces do not show of vertices and colors.
void CountUnseen(const PlyVertices& vertices, const PlyFaces& faces, const PlyTriangles& triangles,
                 std::vector<uint8_t>* is_used, Model* model) {
  for (const uint32_t v : faces.vertices) {
    if (v != kRestart) (*is_used)[v] = 1;
  }
  AddLeftOut("faces of fewer than three vertices", triangles.too_few, model);
  AddLeftOut(kUnknownColors, faces.unknown.size(), model);
  if (vertices.colors.empty()) return;
  std::vector<uint8_t> is_counted(vertices.colors.size());
  uint64_t covered = 0, unknown = 0;
  for (size_t c = 0; c < triangles.vertices.size(); ++c) {
    const uint32_t v = triangles.vertices[c];
    if (is_counted[v] != 0) continue;
    const bool is_covered =
        !triangles.colors.empty() && triangles.colors[c / 3] != vertices.colors[v];
    const bool is_unknown =
        triangles.colors.empty() && std::ranges::binary_search(vertices.unknown, v);
    covered += is_covered ? 1 : 0;
    unknown += is_unknown ? 1 : 0;
    is_counted[v] = is_covered || is_unknown ? 1 : 0;
  }
  AddLeftOut("colours of vertices whose faces have others", covered, model);
  AddLeftOut(kUnknownColors, unknown, model);
}

// Gives each corner of the triangles a vertex of its own, with the attributes of the vertex that it is in the file.
void AddAttributes(const PlyVertices& vertices, const PlyTriangles& triangles, Part* part) {
  if (vertices.attributes.empty()) return;
  Part apart;
  apart.kind = part->kind;
  for (uint32_t c = 0; c < part->indices.size(); ++c) {
    const uint32_t v = part->indices[c];
    apart.positions.push_back(part->positions[v]);
    if (!part->normals.empty()) apart.normals.push_back(part->normals[v]);
    if (!part->colors.empty()) apart.colors.push_back(part->colors[v]);
    apart.indices.push_back(c);
  }
  for (const Attribute& attribute : vertices.attributes) {
    Attribute& own = apart.attributes.emplace_back(Attribute{attribute.name, {}});
    for (const uint32_t v : triangles.vertices) own.values.push_back(attribute.values[v]);
  }
  *part = std::move(apart);
}

}  // namespace

bool HasPlySurfaces(const PlyHeader& header) {
  return header.Find("face") != nullptr || header.Find("tristrips") != nullptr;
}

absl::StatusOr<Model> ReadPlyMesh(const SourceFile& file, const PlyHeader& header,
                                  bool attributes) {
  const PlyElement* const vertex = header.Find("vertex");
  PlyValues values(file, header);
  absl::StatusOr<PlyVertices> vertices = PlyVertices();
  absl::StatusOr<PlyFaces> faces = PlyFaces(), strips = PlyFaces();
  for (const PlyElement& element : header.elements) {
    absl::Status status;
    if (&element == vertex) {
      vertices = ReadPlyVertices(file, element, attributes, false, &values);
      status = vertices.status();
    } else if (&element == header.Find("face")) {
      faces = ReadFaces(file, element, vertex->count, false, &values);
      status = faces.status();
    } else if (&element == header.Find("tristrips")) {
      strips = ReadFaces(file, element, vertex->count, true, &values);
      status = strips.status();
    } else {
      status = SkipPlyElement(file, element, &values);
    }
    if (!status.ok()) return status;
  }
  Model model;
  model.path = file.path;
  model.format = "PLY mesh";
  model.up = Up::kZ;
  const absl::StatusOr<PlyTriangles> of_faces = Triangulated(file, *faces, vertices->positions);
  if (!of_faces.ok()) return of_faces.status();
  const absl::StatusOr<PlyTriangles> of_strips = Unstripped(file, *strips);
  if (!of_strips.ok()) return of_strips.status();
  std::vector<uint8_t> is_used(vertices->positions.size());
  for (const auto& [listed, triangles] :
       {std::pair(&*faces, &*of_faces), {&*strips, &*of_strips}}) {
    CountUnseen(*vertices, *listed, *triangles, &is_used, &model);
    if (triangles->vertices.empty()) continue;
    absl::StatusOr<Part> part = Surface(file, *vertices, *triangles);
    if (!part.ok()) return part.status();
    AddAttributes(*vertices, *triangles, &*part);
    model.parts.push_back(*std::move(part));
  }
  AddLeftOut("vertices that no face has",
             static_cast<uint64_t>(std::ranges::count(is_used, uint8_t{0})), &model);
  AddLeftOut("other properties of vertices", vertices->others, &model);
  AddLeftOut("other properties of faces", faces->others + strips->others, &model);
  AddLeftOut("entries of other elements", header.OtherEntries(), &model);
  AddLeftOut("pictures", header.pictures, &model);
  if (model.parts.empty()) {
    return FileError(file, "its faces are no triangle", "a face has at least three vertices");
  }
  return model;
}

}  // namespace voxeld::voxelctl
