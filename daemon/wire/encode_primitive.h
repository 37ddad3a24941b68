// Content that the core keeps as primitives of the wire: the way back of ToContent. Reentrant.
#pragma once

#include <cstdint>

#include "daemon/scene/operation.h"

namespace voxeld::v1 {
class Object;
class Primitive;
class Vertices;
}  // namespace voxeld::v1

namespace voxeld::daemon::wire {

// What ToContent makes of `out` is equal to `in`. Arrays have their plainest types: F32, U32, RGB8.
void Encode(const Content& in, v1::Primitive* out);
// Counts and arrays alone.
void VerticesToWire(const GeometryData& in, v1::Vertices* out);
void Encode(const ObjectData& in, v1::Object* out);

// At least as many bytes as the encoded form has, and not many more: to be asked before it is made.
uint64_t EncodedBytes(const Content& in);
uint64_t EncodedBytes(const ObjectData& in);

}  // namespace voxeld::daemon::wire
