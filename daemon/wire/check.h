// Checks that every part of the decoder shares. Each answers with nothing,
// or with the fault that it found.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "daemon/scene/operation.h"
#include "daemon/wire/field_path.h"
#include "display/api/geometry.h"
#include "gpu/affine.h"

namespace voxeld::v1 {
class Affine;
class Box3;
class Vec3;
}  // namespace voxeld::v1

namespace voxeld::daemon::wire {

// Two directions are parallel if the sine of the angle between them is smaller.
inline constexpr double kLeastSine = 1e-6;

// Why one operation, entity or part cannot be taken.
struct Fault {
  std::string field;
  Reason reason = Reason::kUnspecified;
  std::string message;
};

using MaybeFault = std::optional<Fault>;

// A number as it is printed in messages: the shortest form that reads back as the same value.
std::string Show(double value);
std::string Show(float value);

// The size of a payload, in its elements too where it has whole ones: "24 bytes, 6 samples".
std::string ShowBytes(uint64_t bytes, uint64_t element_bytes, std::string_view element);

// Text from a client, quoted, with what is not printable escaped,
// cut to a length fit for a message.
std::string Quote(std::string_view text);

// Names of layers, entities, objects: 1 to `max_bytes` bytes.
// (That text is UTF-8 is checked by the parser.)
MaybeFault CheckName(const FieldPath& path, std::string_view name, uint32_t max_bytes);

// Text for people: at most `max_bytes` bytes.
MaybeFault CheckLabel(const FieldPath& path, std::string_view text, size_t max_bytes);

MaybeFault CheckFinite(const FieldPath& path, double value);

// Finite as a double and as the float that the engine computes with.
MaybeFault CheckFloat(const FieldPath& path, double value);

// As CheckFloat, and greater than zero as a float.
MaybeFault CheckPositive(const FieldPath& path, double value);

MaybeFault CheckVec3(const FieldPath& path, const v1::Vec3& vec);  // CheckFloat of each
MaybeFault CheckSize(const FieldPath& path, const v1::Vec3& vec);  // CheckPositive of each

// CheckVec3 of both corners, and min < max in every component.
MaybeFault CheckBox(const FieldPath& path, const v1::Box3& box);

// "has the unknown value 7; use one of FIRST, SECOND".
Fault UnknownEnum(const FieldPath& path, int value, const char* known);

// "is not implemented in this version of the server: <reason>".
Fault Unimplemented(const FieldPath& path, const char* what);

// 0 values: identity. Otherwise 12 finite ones whose linear part is not singular:
// the rows, each divided by its greatest element, must have a determinant above 1e-12,
// and their own must be a normal number.
MaybeFault ToAffine(const FieldPath& path, const v1::Affine& in, gpu::Affine* out);

}  // namespace voxeld::daemon::wire
