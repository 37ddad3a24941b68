// What is staged: operations with their payloads encoded already.
#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "client/cpp/src/wire.h"
#include "voxeld/drawing.h"

namespace voxeld::client {

struct UpsertOperation {
  std::string layer, id;
  Rope primitive;  // a v1.Primitive
  Affine transform;
  uint32_t priority = 0;
  bool erase = false;
  int64_t lifetime_ns = 0;
  std::string label;
};

struct DeleteOperation {
  enum class What : uint8_t { kId, kPrefix, kLayer, kAllMine };
  std::string layer;
  What what = What::kId;
  std::string text;  // the id or prefix
};

struct TransformOperation {
  std::string layer, id;
  Affine transform;
};

struct LayerOperation {
  std::string layer;
  LayerLook look;
};

struct DefineOperation {
  std::string object;
  Rope definition;                // a v1.Object
  std::vector<std::string> uses;  // objects that its parts draw
};

struct RemoveObjectOperation {
  std::string object;
  bool cascade = false;
};

// An immediate frame, whole.
struct FrameOperation {
  std::string layer;
  std::vector<UpsertOperation> upserts;
};

using Operation = std::variant<UpsertOperation, DeleteOperation, TransformOperation, LayerOperation,
                               DefineOperation, RemoveObjectOperation, FrameOperation>;

}  // namespace voxeld::client
