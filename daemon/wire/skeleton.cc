#include "daemon/wire/skeleton.h"

#include <google/protobuf/wire_format_lite.h>

#include <algorithm>

#include "voxeld/v1/primitives.pb.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::wire {
namespace {

using google::protobuf::internal::WireFormatLite;

// Beyond this size, a skeleton that is not much smaller than the message costs more than it saves.
constexpr uint64_t kSpareBytes = 16 << 10;
constexpr uint64_t kLeastFactor = 4;

constexpr int kMostVarint = 10, kMostTag = 5, kMostLength = 5;

// A message on the path to payloads, with the fields that lead there.
struct FieldNode {
  struct Step {
    int field = 0;
    const FieldNode* to = nullptr;  // null: a payload
  };
  Step steps[5];  // field 0: unused
};

constexpr FieldNode kVertices = {{{v1::Vertices::kIndicesFieldNumber},
                                  {v1::Vertices::kColorsFieldNumber},
                                  {v1::Vertices::kPositionsFieldNumber}}};
constexpr FieldNode kPoints = {{{v1::Points::kVerticesFieldNumber, &kVertices}}};
constexpr FieldNode kSegments = {{{v1::Segments::kVerticesFieldNumber, &kVertices}}};
constexpr FieldNode kMesh = {{{v1::Mesh::kVerticesFieldNumber, &kVertices}}};
constexpr FieldNode kCurve = {{{v1::Curve::kVerticesFieldNumber, &kVertices}}};
constexpr FieldNode kBezierSurface = {{{v1::BezierSurface::kVerticesFieldNumber, &kVertices}}};
constexpr FieldNode kPrimitive = {{{v1::Primitive::kPointsFieldNumber, &kPoints},
                                   {v1::Primitive::kSegmentsFieldNumber, &kSegments},
                                   {v1::Primitive::kMeshFieldNumber, &kMesh},
                                   {v1::Primitive::kCurveFieldNumber, &kCurve},
                                   {v1::Primitive::kBezierSurfaceFieldNumber, &kBezierSurface}}};
constexpr FieldNode kEntity = {{{v1::Entity::kPrimitiveFieldNumber, &kPrimitive}}};
constexpr FieldNode kUpsert = {{{v1::Upsert::kEntityFieldNumber, &kEntity}}};
constexpr FieldNode kBatch = {{{v1::Batch::kUpsertsFieldNumber, &kUpsert}}};
constexpr FieldNode kPart = {{{v1::Object::Part::kPrimitiveFieldNumber, &kPrimitive}}};
constexpr FieldNode kObject = {{{v1::Object::kPartsFieldNumber, &kPart}}};
constexpr FieldNode kDefineObject = {{{v1::DefineObject::kDefinitionFieldNumber, &kObject}}};
constexpr FieldNode kStreamRequest = {
    {{v1::StreamRequest::kBatchFieldNumber, &kBatch},
     {v1::StreamRequest::kUpsertFieldNumber, &kUpsert},
     {v1::StreamRequest::kDefineObjectFieldNumber, &kDefineObject}}};
constexpr FieldNode kApplyUpdateRequest = {
    {{v1::ApplyUpdateRequest::kOperationsFieldNumber, &kStreamRequest}}};

class Walker {
 public:
  Walker(std::span<const std::string_view> slices, Skeleton* out) : slices_(slices), out_(*out) {
    for (const std::string_view slice : slices_) left_ += slice.size();
    Advance();
  }

  uint64_t left() const { return left_; }

  // Processes the next `size` bytes as a message of this kind. Requires: the bytes exist. All
  // functions return false for anything unusual.
  bool Message(const FieldNode& node, uint64_t size) {
    const uint64_t end = left_ - size;  // bytes left at its end
    while (left_ > end) {
      if (!Field(node, end)) return false;
    }
    return left_ == end;
  }

 private:
  bool Field(const FieldNode& node, uint64_t end) {
    uint64_t tag = 0;
    if (!Varint(kMostTag, end, &tag) || tag > UINT32_MAX) return false;
    const int field = WireFormatLite::GetTagFieldNumber(static_cast<uint32_t>(tag));
    if (field == 0 || out_.bytes.size() > kSpareBytes + consumed_ / kLeastFactor) return false;
    PutVarint(tag);
    switch (WireFormatLite::GetTagWireType(static_cast<uint32_t>(tag))) {
      case WireFormatLite::WIRETYPE_VARINT:
        return CopyVarint(end);
      case WireFormatLite::WIRETYPE_FIXED64:
        return Copy(8, end);
      case WireFormatLite::WIRETYPE_FIXED32:
        return Copy(4, end);
      case WireFormatLite::WIRETYPE_LENGTH_DELIMITED:
        return Delimited(node, field, end);
      default:
        return false;
    }
  }

  bool Delimited(const FieldNode& node, int field, uint64_t end) {
    uint64_t size = 0;
    if (!Varint(kMostLength, end, &size) || size > left_ - end) return false;
    const auto step = std::find_if(std::begin(node.steps), std::end(node.steps),
                                   [&](const FieldNode::Step& s) { return s.field == field; });
    if (step == std::end(node.steps)) {
      PutVarint(size);
      return Copy(size, end);
    }
    if (step->to != nullptr) {
      const size_t at = out_.bytes.size();
      out_.bytes.append(kMostLength, '\0');
      if (!Message(*step->to, size)) return false;
      PatchLength(at);
      return true;
    }
    if (size == 0) {  // equivalent to absent, but may override an earlier occurrence
      PutVarint(0);
      return true;
    }
    out_.payloads.Begin();
    Take(size, [&](std::string_view piece) { out_.payloads.Add(piece); });
    const std::string token = out_.payloads.Token();
    PutVarint(token.size());
    out_.bytes += token;
    return true;
  }

  // Moves to the next byte.
  void Advance() {
    while (next_ < slices_.size() && piece_.empty()) piece_ = slices_[next_++];
  }

  // Calls `take(piece)` for the next `size` bytes. Requires: they exist.
  template <typename TakePiece>
  void Take(uint64_t size, TakePiece&& take) {
    left_ -= size;
    consumed_ += size;
    while (size > 0) {
      const std::string_view piece = piece_.substr(0, size);
      take(piece);
      size -= piece.size();
      piece_.remove_prefix(piece.size());
      Advance();
    }
  }

  bool Byte(uint64_t end, uint8_t* byte) {
    if (left_ <= end) return false;
    *byte = static_cast<uint8_t>(piece_.front());
    piece_.remove_prefix(1);
    --left_;
    ++consumed_;
    Advance();
    return true;
  }

  bool Copy(uint64_t size, uint64_t end) {
    if (size > left_ - end) return false;
    Take(size, [&](std::string_view piece) { out_.bytes += piece; });
    return true;
  }

  bool Varint(int most, uint64_t end, uint64_t* value) {
    *value = 0;
    for (int i = 0; i < most; ++i) {
      uint8_t byte = 0;
      if (!Byte(end, &byte)) return false;
      *value |= uint64_t{byte & 0x7Fu} << (7 * i);
      if (byte < 0x80) return true;
    }
    return false;
  }

  bool CopyVarint(uint64_t end) {
    for (int i = 0; i < kMostVarint; ++i) {
      uint8_t byte = 0;
      if (!Byte(end, &byte)) return false;
      out_.bytes.push_back(static_cast<char>(byte));
      if (byte < 0x80) return true;
    }
    return false;
  }

  void PutVarint(uint64_t value) {
    for (; value >= 0x80; value >>= 7) out_.bytes.push_back(static_cast<char>(value | 0x80));
    out_.bytes.push_back(static_cast<char>(value));
  }

  // Writes the length of the data after the gap at `at`, using all bytes of the gap.
  void PatchLength(size_t at) {
    uint64_t size = out_.bytes.size() - at - kMostLength;
    for (int i = 0; i < kMostLength; ++i, size >>= 7) {
      out_.bytes[at++] = static_cast<char>((size & 0x7F) | (i + 1 < kMostLength ? 0x80 : 0));
    }
  }

  const std::span<const std::string_view> slices_;
  Skeleton& out_;
  size_t next_ = 0;         // the slice after the current one
  std::string_view piece_;  // the rest of the current slice; empty only at the end
  uint64_t left_ = 0, consumed_ = 0;
};

}  // namespace

bool MakeSkeleton(std::span<const std::string_view> slices, Root root, Skeleton* out) {
  Walker walker(slices, out);
  return walker.Message(root == Root::kStreamRequest ? kStreamRequest : kApplyUpdateRequest,
                        walker.left());
}

}  // namespace voxeld::daemon::wire
