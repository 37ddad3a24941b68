// Checks that all parts of the decoder share. Each returns nothing, or the fault that it found.
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

// Two directions are parallel if the sine of their angle is below this.
inline constexpr double kLeastSine = 1e-6;

// Why an operation, entity or part is refused.
struct Fault {
  std::string field;
  Reason reason = Reason::kUnspecified;
  std::string message;
};

using MaybeFault = std::optional<Fault>;

// Returns: a number for messages, in the shortest form that reads back as the same value.
std::string Show(double value);
std::string Show(float value);

// Returns: the size of a payload, also in elements if it has whole ones: "24 bytes, 6 samples".
std::string ShowBytes(uint64_t bytes, uint64_t element_bytes, std::string_view element);

// Returns: text from a client, quoted, with unprintable characters escaped, and shortened for a
// message.
std::string Quote(std::string_view text);

// Checks a name of a layer, entity or object: 1 to `max_bytes` bytes. (The parser checks that it is
// UTF-8.)
MaybeFault CheckName(const FieldPath& path, std::string_view name, uint32_t max_bytes);

// Checks text for people: at most `max_bytes` bytes.
MaybeFault CheckLabel(const FieldPath& path, std::string_view text, size_t max_bytes);

MaybeFault CheckFinite(const FieldPath& path, double value);

// Checks that the value is finite, both as a double and as the float that the engine uses.
MaybeFault CheckFloat(const FieldPath& path, double value);

// Does CheckFloat, and checks that the value is greater than zero as a float.
MaybeFault CheckPositive(const FieldPath& path, double value);

MaybeFault CheckVec3(const FieldPath& path, const v1::Vec3& vec);  // CheckFloat of each
MaybeFault CheckSize(const FieldPath& path, const v1::Vec3& vec);  // CheckPositive of each

// Does CheckVec3 for both corners, and checks that min < max in every component.
MaybeFault CheckBox(const FieldPath& path, const v1::Box3& box);

// Returns: a fault such as "has the unknown value 7; use one of FIRST, SECOND".
Fault UnknownEnum(const FieldPath& path, int value, const char* known);

// Returns: the fault "is not implemented in this version of the server: <reason>".
Fault Unimplemented(const FieldPath& path, const char* what);

// Reads an affine map. No values mean identity. Otherwise it requires 12 finite values whose linear
// part is not singular: after division of each row by its greatest element the determinant must be
// above 1e-12, and the determinant of the rows themselves must be a normal number.
MaybeFault ToAffine(const FieldPath& path, const v1::Affine& in, gpu::Affine* out);

}  // namespace voxeld::daemon::wire
