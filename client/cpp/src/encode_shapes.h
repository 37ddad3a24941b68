// Shapes by their measures as bytes of v1.Primitive.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "voxeld/drawing.h"

namespace voxeld::client {

// Each is a v1.Primitive with that shape alone. InvalidArgument for what cannot be said on the wire; what
// is wrong with measures the server says.
absl::StatusOr<std::string> EncodeShape(const Implicit& shape);
absl::StatusOr<std::string> EncodeShape(const Ellipsoid& shape);
absl::StatusOr<std::string> EncodeShape(const Torus& shape);
absl::StatusOr<std::string> EncodeShape(const Cone& shape);
absl::StatusOr<std::string> EncodeShape(const Parallelepiped& shape);
absl::StatusOr<std::string> EncodeShape(const Disc& shape);
absl::StatusOr<std::string> EncodeShape(const Patch& shape);
absl::StatusOr<std::string> EncodeShape(const Polygon& shape);
absl::StatusOr<std::string> EncodeShape(const Arrow& shape);
absl::StatusOr<std::string> EncodeShape(const Arc& shape);
absl::StatusOr<std::string> EncodeShape(const Ellipse& shape);
absl::StatusOr<std::string> EncodeShape(const Helix& shape);
absl::StatusOr<std::string> EncodeShape(const Text& shape);
// 0xRRGGBB.
uint32_t RgbOf(const Color& color);
// A v1.Transfer.
std::string EncodeTransfer(const Transfer& transfer);
// A v1.ColorScale.
std::string EncodeColorScale(const ColorScale& scale);

}  // namespace voxeld::client
