// Steps that the readers of meshes share: matrices of nodes, colours, normals, pictures.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {

// Row-major 3×4, in double precision: nodes nest.
using NodeMatrix = std::array<double, 12>;

inline constexpr NodeMatrix kIdentity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

NodeMatrix Compose(const NodeMatrix& outer, const NodeMatrix& inner);
Point3 MapPoint(const NodeMatrix& m, const Point3& p);

// Returns: the inverse transpose up to a positive factor, so that normals stay outside under a mirror too.
NodeMatrix NormalMatrix(const NodeMatrix& m);

// Whether it turns the winding of triangles round.
bool IsMirror(const NodeMatrix& m);

// Of unit length, however small the model is; zero for what has no direction.
Point3 Direction(const Point3& p);

// Returns: a channel from 0 to 1 as a byte; a value that is not a number is 0. `linear`: the value is linear light.
uint8_t ColorByte(double value, bool linear);

// Gives a part of triangles its normals, by the triangles' winding. A corner gets the mean normal of the triangles around its vertex if
// its own triangle is turned by less than `crease_degrees` from it, otherwise its triangle's own normal: 0 makes every triangle flat,
// 180 makes all smooth. Vertices with several normals are duplicated.
void AddNormals(double crease_degrees, Part* part);

// Removes triangles without an area, and vertices that no element refers to: they would take part in the model's size. Returns: the number of
// triangles removed whose corners are at three places; others join strips or close poles.
uint64_t DropEmptyTriangles(Part* part);

// Whether the display can show a picture with these bytes: PNG or JPEG.
bool IsPicture(absl::string_view bytes);

// What follows beyond the edge of a picture.
enum class Wrap : uint8_t { kRepeat, kClamp, kMirror };

// Rewrites the texture coordinates of a part so that a picture that repeats looks like one with these rules. Returns: the number of triangles
// that cross the edge of a picture, for which this is an approximation.
uint64_t ApplyWrap(Wrap u, Wrap v, Part* part);

// "a%20b" as "a b"; a % that two hexadecimal digits do not follow stays.
std::string PercentDecode(absl::string_view text);

}  // namespace voxeld::voxelctl
