// Encodes shapes that are defined by measures as bytes of v1.Primitive.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "voxeld/drawing.h"

namespace voxeld::client {

// Each returns a v1.Primitive with that shape alone. Errors: InvalidArgument for what the wire
// cannot express; the server reports invalid measures.
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
// Returns 0xRRGGBB.
uint32_t RgbOf(const Color& color);
// Returns a v1.Transfer.
std::string EncodeTransfer(const Transfer& transfer);
// Returns a v1.ColorScale.
std::string EncodeColorScale(const ColorScale& scale);

}  // namespace voxeld::client
