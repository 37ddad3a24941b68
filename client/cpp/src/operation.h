// Staged operations, whose payloads are already encoded.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <tuple>
#include <variant>
#include <vector>

#include "client/cpp/src/wire.h"
#include "voxeld/drawing.h"

namespace voxeld::client {

struct UpsertOperation {
  std::string layer, id;
  Rope primitive;  // encoded v1.Primitive
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
  Rope definition;                // encoded v1.Object
  std::vector<std::string> uses;  // objects that its parts draw
};

struct RemoveObjectOperation {
  std::string object;
  bool cascade = false;
};

// A complete immediate frame.
struct FrameOperation {
  std::string layer;
  std::vector<UpsertOperation> upserts;
};

using Operation = std::variant<UpsertOperation, DeleteOperation, TransformOperation, LayerOperation,
                               DefineOperation, RemoveObjectOperation, FrameOperation>;

// The operations of one commit that the server refused. Operations are counted one by one,
// including a frame's: FrameBegin, each upsert and FrameEnd; a dropped frame counts none.
struct Refusals {
  struct Request {
    uint64_t sequence = 0;
    size_t operations = 0;
  };
  std::vector<Request> requests;  // in their order, without the Commit
  std::set<std::tuple<uint64_t, std::string, std::string>> refused;  // sequence, layer, id
};

}  // namespace voxeld::client
