// Converts the core's content to primitives of the protocol: the inverse of ToContent. Reentrant.
#pragma once

#include <cstdint>

#include "daemon/scene/operation.h"

namespace voxeld::v1 {
class Object;
class Primitive;
class Vertices;
}  // namespace voxeld::v1

namespace voxeld::daemon::wire {

// ToContent converts `out` to content that is equal to `in`. Arrays have the simplest types: F32,
// U32, RGB8.
void Encode(const Content& in, v1::Primitive* out);
// Encodes counts and arrays only.
void VerticesToWire(const GeometryData& in, v1::Vertices* out);
void Encode(const ObjectData& in, v1::Object* out);

// Returns: an upper bound of the encoded size that is not much larger. Computes it without
// encoding.
uint64_t EncodedBytes(const Content& in);
uint64_t EncodedBytes(const ObjectData& in);

}  // namespace voxeld::daemon::wire
