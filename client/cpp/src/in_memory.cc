#include "client/cpp/src/in_memory.h"

#include <algorithm>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "voxeld/v1/primitives.pb.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::client {
namespace {

constexpr size_t kRangeAlignment = 4;

// The messages that can contain vertices.
enum class Level : uint8_t {
  kRequest,
  kBatch,
  kUpsert,
  kEntity,
  kDefine,
  kObject,
  kPart,
  kPrimitive,
  kShape,
  kVertices,
};

struct Step {
  Level in;
  int field;
  Level leads_to;
};
constexpr Step kSteps[] = {
    {Level::kRequest, v1::StreamRequest::kBatchFieldNumber, Level::kBatch},
    {Level::kRequest, v1::StreamRequest::kDefineObjectFieldNumber, Level::kDefine},
    {Level::kBatch, v1::Batch::kUpsertsFieldNumber, Level::kUpsert},
    {Level::kUpsert, v1::Upsert::kEntityFieldNumber, Level::kEntity},
    {Level::kEntity, v1::Entity::kPrimitiveFieldNumber, Level::kPrimitive},
    {Level::kDefine, v1::DefineObject::kDefinitionFieldNumber, Level::kObject},
    {Level::kObject, v1::Object::kPartsFieldNumber, Level::kPart},
    {Level::kPart, v1::Object::Part::kPrimitiveFieldNumber, Level::kPrimitive},
    {Level::kPrimitive, v1::Primitive::kPointsFieldNumber, Level::kShape},
    {Level::kPrimitive, v1::Primitive::kSegmentsFieldNumber, Level::kShape},
    {Level::kPrimitive, v1::Primitive::kMeshFieldNumber, Level::kShape},
    {Level::kShape, v1::Points::kVerticesFieldNumber, Level::kVertices},
};
// All shapes with vertices use the same field number for them.
static_assert(int{v1::Points::kVerticesFieldNumber} == int{v1::Segments::kVerticesFieldNumber});
static_assert(int{v1::Points::kVerticesFieldNumber} == int{v1::Mesh::kVerticesFieldNumber});

// Returns the field that names a range in place of this payload of Vertices; 0: it is not a
// payload.
int RangeField(int field) {
  switch (field) {
    case v1::Vertices::kPositionsFieldNumber:
      return v1::Vertices::kPositionsInFieldNumber;
    case v1::Vertices::kColorsFieldNumber:
      return v1::Vertices::kColorsInFieldNumber;
    case v1::Vertices::kIndicesFieldNumber:
      return v1::Vertices::kIndicesInFieldNumber;
    default:
      return 0;
  }
}

// Reads a rope from its beginning; the parts taken share its payloads.
class Reader {
 public:
  explicit Reader(const Rope& rope) : left_(rope.size()) {
    if (!rope.head().empty()) chunks_.push_back({nullptr, rope.head()});
    for (const Rope::Chunk& chunk : rope.tail()) {
      if (!chunk.bytes().empty())
        chunks_.push_back({chunk.owner == nullptr ? nullptr : &chunk.owner, chunk.bytes()});
    }
  }

  size_t left() const { return left_; }

  // Requires: bytes are left.
  uint8_t Byte() {
    const auto byte = static_cast<uint8_t>(chunks_[at_].bytes.front());
    Skip(1);
    return byte;
  }

  std::optional<uint64_t> Varint() {
    uint64_t value = 0;
    for (int shift = 0; shift < 64 && left_ > 0; shift += 7) {
      const uint8_t byte = Byte();
      value |= static_cast<uint64_t>(byte & 0x7f) << shift;
      if (byte < 0x80) return value;
    }
    return std::nullopt;
  }

  std::optional<Rope> Take(uint64_t size) {
    if (size > left_) return std::nullopt;
    Rope out;
    while (size > 0) {
      const std::string_view bytes = chunks_[at_].bytes.substr(0, size);
      if (chunks_[at_].owner == nullptr) {
        out.Append(bytes);
      } else {
        out.AppendShared(*chunks_[at_].owner, bytes);
      }
      size -= bytes.size();
      Skip(bytes.size());
    }
    return out;
  }

 private:
  struct Chunk {
    const std::shared_ptr<const void>* owner;  // null: not shared
    std::string_view bytes;
  };

  // Skips bytes within the first chunk.
  void Skip(size_t size) {
    chunks_[at_].bytes.remove_prefix(size);
    left_ -= size;
    if (chunks_[at_].bytes.empty()) ++at_;
  }

  std::vector<Chunk> chunks_;
  size_t at_ = 0;
  size_t left_;
};

class Mover {
 public:
  Mover(uint64_t memory_id, Rope* memory) : id_(memory_id), memory_(*memory) {}

  // Returns nothing if the message is not one that this client encodes.
  std::optional<Rope> Move(const Rope& message, Level level) {
    if (message.size() < kMemoryBytes) return message;
    Reader reader(message);
    Rope out;
    while (reader.left() > 0) {
      const std::optional<uint64_t> tag = reader.Varint();
      if (!tag || !MoveField(*tag, level, &reader, &out)) return std::nullopt;
    }
    return out;
  }

 private:
  enum Type : uint8_t { kVarint = 0, kFixed64 = 1, kLength = 2, kFixed32 = 5 };

  bool MoveField(uint64_t tag, Level level, Reader* reader, Rope* out) {
    const int field = static_cast<int>(tag >> 3);
    const auto type = static_cast<Type>(tag & 7);
    if (type != kLength) {
      std::string plain;
      AppendVarint(tag, &plain);
      out->Append(plain);
      return CopyValue(type, reader, out);
    }
    const std::optional<uint64_t> size = reader->Varint();
    if (!size) return false;
    std::optional<Rope> inner = reader->Take(*size);
    if (!inner) return false;
    if (level == Level::kVertices && RangeField(field) != 0) {
      std::string range;
      AppendPresentBytes(RangeField(field), ToRange(*inner), &range);
      out->Append(range);
      return true;
    }
    for (const Step& step : kSteps) {
      if (step.in != level || step.field != field) continue;
      inner = Move(*inner, step.leads_to);
      if (!inner) return false;
    }
    out->Append(Wrap("", field, *std::move(inner)));
    return true;
  }

  static bool CopyValue(Type type, Reader* reader, Rope* out) {
    std::string value;
    if (type == kVarint) {
      const std::optional<uint64_t> number = reader->Varint();
      if (!number) return false;
      AppendVarint(*number, &value);
      out->Append(value);
      return true;
    }
    if (type != kFixed64 && type != kFixed32) return false;
    const std::optional<Rope> bytes = reader->Take(type == kFixed64 ? 8 : 4);
    if (bytes) out->Append(*bytes);
    return bytes.has_value();
  }

  std::string ToRange(const Rope& payload) {
    if (const size_t over = memory_.size() % kRangeAlignment; over != 0)
      memory_.Append(std::string(kRangeAlignment - over, '\0'));
    std::string range;
    AppendUnsigned(v1::MemoryRange::kMemoryFieldNumber, id_, &range);
    AppendUnsigned(v1::MemoryRange::kOffsetFieldNumber, memory_.size(), &range);
    AppendUnsigned(v1::MemoryRange::kSizeFieldNumber, payload.size(), &range);
    memory_.Append(payload);
    return range;
  }

  const uint64_t id_;
  Rope& memory_;
};

}  // namespace

std::optional<InMemory> MoveToMemory(const Rope& request, uint64_t memory_id) {
  // A message has at most three such payloads. Most have none, and are left unchanged.
  const bool has_any =
      std::any_of(request.tail().begin(), request.tail().end(), [](const Rope::Chunk& chunk) {
        return chunk.owner != nullptr && chunk.shared.size() >= kMemoryBytes / 4;
      });
  if (!has_any) return std::nullopt;
  InMemory out;
  std::optional<Rope> moved = Mover(memory_id, &out.memory).Move(request, Level::kRequest);
  if (!moved || out.memory.size() == 0) return std::nullopt;
  out.request = *std::move(moved);
  return out;
}

}  // namespace voxeld::client
