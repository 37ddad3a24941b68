// Steps that the readers of meshes share: matrices of nodes, colours, normals, pictures.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {

// Row-major 3×4, in double precision because nodes nest.
using NodeMatrix = std::array<double, 12>;

inline constexpr NodeMatrix kIdentity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

NodeMatrix Compose(const NodeMatrix& outer, const NodeMatrix& inner);
Point3 MapPoint(const NodeMatrix& m, const Point3& p);

// Returns: the inverse transpose up to a positive factor, so normals point outwards even after
// mirroring.
NodeMatrix NormalMatrix(const NodeMatrix& m);

// Returns whether the matrix reverses the winding of triangles.
bool IsMirror(const NodeMatrix& m);

// Returns a vector of unit length, however small the model is; zero without a direction.
Point3 Direction(const Point3& p);

// Returns: a channel from 0 to 1 as a byte; 0 if the value is not a number. `linear` means that the
// value is linear light.
uint8_t ColorByte(double value, bool linear);

// Returns whether a surface emits light.
bool IsLit(const std::array<double, 3>& emission);

// Returns the colour that is multiplied by the vertex colours before emitted light is added: the
// material's own colour `own`. Without one it is white if there are vertex colours, and black if the
// surface only emits light. Returns nothing if the file gives the surface no colour.
std::optional<std::array<double, 3>> BaseColor(const std::optional<std::array<double, 3>>& own,
                                               bool lit, bool has_vertex_colors);

// Gives a part of triangles its normals, by the winding of the triangles. A corner gets the mean
// normal of the triangles around its vertex if its own triangle differs from it by less than
// `crease_degrees`, otherwise its triangle's own normal: 0 makes every triangle flat, 180 makes all
// smooth. Vertices with several normals are duplicated.
void AddNormals(double crease_degrees, Part* part);

// Removes triangles without an area, and vertices that no element refers to, because they would
// affect the model's size. Returns: the number of removed triangles whose corners are at three
// different places; others join strips or close poles.
uint64_t DropEmptyTriangles(Part* part);

// Returns whether the display can show a picture with these bytes: PNG or JPEG.
bool IsPicture(absl::string_view bytes);

// The content beyond the edge of a picture.
enum class Wrap : uint8_t { kRepeat, kClamp, kMirror };

// Rewrites the texture coordinates of a part so that a repeating picture looks like one with these
// rules. Returns: the number of triangles that cross the edge of a picture, for which this is an
// approximation.
uint64_t ApplyWrap(Wrap u, Wrap v, Part* part);

// Decodes "a%20b" to "a b"; a % without two hexadecimal digits stays.
std::string PercentDecode(absl::string_view text);

}  // namespace voxeld::voxelctl
