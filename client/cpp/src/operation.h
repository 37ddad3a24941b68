// What is staged: operations with their payloads encoded already.
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

// What the server refused of one commit. Operations are counted one by one, those of a frame too: its
// begin, each upsert, its end; none for a frame that was given up.
struct Refusals {
  struct Request {
    uint64_t sequence = 0;
    size_t operations = 0;
  };
  std::vector<Request> requests;  // in their order, Commit left out
  std::set<std::tuple<uint64_t, std::string, std::string>> refused;  // sequence, layer, id
};

}  // namespace voxeld::client
