#include "gpu/delta.h"

#include <cmath>
#include <limits>
#include <string>
#include <type_traits>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "gpu/implicit/program_check.h"
#include "gpu/primitives/texture.h"
#include "gpu/samples_check.h"

namespace voxeld::gpu {
namespace {

constexpr size_t kAlign = 16;

static_assert(std::is_trivially_copyable_v<GeometryRecord> && sizeof(GeometryRecord) % kAlign == 0);
static_assert(std::is_trivially_copyable_v<DrawableRecord> && sizeof(DrawableRecord) % kAlign == 0);
static_assert(std::is_trivially_copyable_v<LayerRecord> && sizeof(LayerRecord) % kAlign == 0);
static_assert(std::is_trivially_copyable_v<BulkRef> && sizeof(BulkRef) % kAlign == 0);
static_assert(sizeof(RecordHeader) == kAlign && sizeof(IdRecord) == kAlign);

constexpr uint64_t Padded(uint64_t size) { return (size + kAlign - 1) / kAlign * kAlign; }

// Builds messages that say where the error is, the value, and which values are valid.
class Checker {
 public:
  Checker(uint64_t offset, const char* record) : offset_(offset), record_(record) {}

  template <typename Value>
  absl::Status Wrong(const char* field, const Value& value, const char* right) const {
    return absl::InvalidArgumentError(absl::StrCat("delta, record at byte ", offset_, ": ", record_,
                                                   ".", field, " is ", value, ", must be ", right));
  }
  absl::Status Enum(const char* field, uint32_t value, uint32_t least, uint32_t greatest) const {
    if (value >= least && value <= greatest) return absl::OkStatus();
    return Wrong(field, value, absl::StrCat(least, " to ", greatest).c_str());
  }
  template <typename Number>
  absl::Status Finite(const char* field, const Number* values, size_t count) const {
    for (size_t i = 0; i < count; ++i) {
      if (!std::isfinite(values[i])) {
        return Wrong(absl::StrCat(field, "[", i, "]").c_str(), values[i], "finite");
      }
    }
    return absl::OkStatus();
  }

 private:
  uint64_t offset_;
  const char* record_;
};

absl::Status FirstError(std::initializer_list<absl::Status> statuses) {
  for (const absl::Status& status : statuses) {
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status CheckSizes(const Checker& check, const GeometryRecord& g) {
  const int first = 3;
  const int count = g.kind == PrimitiveKind::kBox ? 3 : g.kind == PrimitiveKind::kSphere ? 1 : 2;
  for (int i = first; i < first + count; ++i) {
    if (!(g.params[i] >= 0)) {
      return check.Wrong(absl::StrCat("params[", i, "]").c_str(), g.params[i], "0 or greater");
    }
  }
  return absl::OkStatus();
}

absl::Status CheckDomain(const Checker& check, const GeometryRecord& g) {
  if (g.params[6] != 0 && g.params[6] != 1) return check.Wrong("params[6]", g.params[6], "0 or 1");
  for (int a = 0; a < 3 && g.params[6] != 0; ++a) {
    if (g.params[a] <= g.params[3 + a]) continue;
    return check.Wrong(absl::StrCat("params[", 3 + a, "]").c_str(), g.params[3 + a],
                       absl::StrCat("no less than ", g.params[a]).c_str());
  }
  return absl::OkStatus();
}

absl::Status CheckCurved(const Checker& check, const GeometryRecord& g) {
  if (g.index_count != 0) return check.Wrong("index_count", g.index_count, "0 for curves");
  if (g.kind == PrimitiveKind::kPatches) {
    if (g.vertex_count % 16 == 0) return absl::OkStatus();
    return check.Wrong("vertex_count", g.vertex_count, "a multiple of 16 for patches");
  }
  if (g.topology == Topology::kList) {
    if (g.vertex_count % 4 == 0) return absl::OkStatus();
    return check.Wrong("vertex_count", g.vertex_count, "a multiple of 4 for a list of curves");
  }
  if (g.topology != Topology::kStrip) {
    return check.Wrong("topology", static_cast<uint32_t>(g.topology), "0 or 1 for curves");
  }
  if (g.vertex_count % 3 == 1) return absl::OkStatus();
  return check.Wrong("vertex_count", g.vertex_count, "3 a curve and 1 for a strip of curves");
}

absl::Status CheckTexture(const Checker& check, const GeometryRecord& g) {
  const uint32_t width = g.texture_width, height = g.texture_height;
  if (width == 0 && height == 0) return absl::OkStatus();
  if (g.kind != PrimitiveKind::kTriangles) {
    return check.Wrong("texture_width", width, "0 for what is no triangles");
  }
  return FirstError({check.Enum("texture_width", width, 1, kMostTextureSide),
                     check.Enum("texture_height", height, 1, kMostTextureSide)});
}

absl::Status CheckGeometry(const Checker& check, const GeometryRecord& g) {
  absl::Status status =
      FirstError({check.Enum("kind", static_cast<uint32_t>(g.kind), 1, 11),
                  check.Enum("color_mode", static_cast<uint32_t>(g.color_mode), 0, 1),
                  check.Enum("sampling", static_cast<uint32_t>(g.sampling), 0, 2),
                  check.Enum("rule", static_cast<uint32_t>(g.rule), 0, 1),
                  check.Enum("fill", static_cast<uint32_t>(g.fill), 0, 1),
                  check.Enum("topology", static_cast<uint32_t>(g.topology), 0, 2),
                  check.Enum("thickness_unit", static_cast<uint32_t>(g.thickness_unit), 0, 1),
                  check.Enum("drawn_by", static_cast<uint32_t>(g.drawn_by), 0, 1),
                  check.Enum("splat", static_cast<uint32_t>(g.splat), 0, 3),
                  check.Finite("thickness", &g.thickness, 1), check.Finite("params", g.params, 8),
                  CheckTexture(check, g)});
  if (!status.ok()) return status;
  if (g.thickness < 0) return check.Wrong("thickness", g.thickness, "0 or greater");
  if (IsSolid(g.kind)) {
    if (g.vertex_count != 0) return check.Wrong("vertex_count", g.vertex_count, "0 for a solid");
    if (g.index_count != 0) return check.Wrong("index_count", g.index_count, "0 for a solid");
    if (g.color_mode != ColorMode::kUniform) {
      return check.Wrong("color_mode", static_cast<uint32_t>(g.color_mode), "0 for a solid");
    }
    return CheckSizes(check, g);
  }
  if (g.kind == PrimitiveKind::kImplicit) {
    if (g.color_mode != ColorMode::kUniform) {
      return check.Wrong("color_mode", static_cast<uint32_t>(g.color_mode), "0 for a program");
    }
    return CheckDomain(check, g);
  }
  if (IsCurved(g.kind)) return CheckCurved(check, g);
  if (g.kind == PrimitiveKind::kSamples) {
    if (g.vertex_count != 0) return check.Wrong("vertex_count", g.vertex_count, "0 for samples");
    if (g.color_mode == ColorMode::kUniform) return absl::OkStatus();
    return check.Wrong("color_mode", static_cast<uint32_t>(g.color_mode), "0 for samples");
  }
  const bool indexed = g.index_count != 0;
  const uint32_t corners = indexed ? g.index_count : g.vertex_count;
  const char* field = indexed ? "index_count" : "vertex_count";
  const bool filled = g.kind == PrimitiveKind::kFilled;
  if ((g.kind == PrimitiveKind::kTriangles || filled) && corners % 3 != 0) {
    return check.Wrong(field, corners, "a multiple of 3 for triangles");
  }
  if (filled && g.color_mode != ColorMode::kUniform) {
    return check.Wrong("color_mode", static_cast<uint32_t>(g.color_mode), "0 for a filled mesh");
  }
  if (g.kind == PrimitiveKind::kSegments && g.topology == Topology::kList && corners % 2 != 0) {
    return check.Wrong(field, corners, "even for a list of segments");
  }
  return absl::OkStatus();
}

// Points the view at the geometry's arrays, which begin at `at`. Requires: there is room for them.
void SetArrays(const std::byte* at, GeometryView& view) {
  const GeometryRecord& g = view.record;
  const ArrayLayout layout = ArrayLayout::Of(g);
  view.positions = {reinterpret_cast<const float*>(at), size_t{g.vertex_count} * 3};
  view.indices = {reinterpret_cast<const uint32_t*>(at + layout.indices), g.index_count};
  view.colors = {reinterpret_cast<const uint32_t*>(at + layout.colors), ColorCount(g)};
}

// Checks a program or the head of a grid. These are checked whether they lie in the record or in
// bulk memory.
absl::Status CheckCode(uint64_t offset, const GeometryView& view) {
  absl::Status status;
  if (view.record.kind == PrimitiveKind::kImplicit) {
    status = implicit::CheckProgram(view.indices, view.record.vertex_count);
  } else if (view.record.kind == PrimitiveKind::kSamples) {
    status = CheckSamples(view.indices);
  }
  if (status.ok()) return status;
  return absl::InvalidArgumentError(
      absl::StrCat("delta, record at byte ", offset, ": ", status.message()));
}

std::string ForCounts(uint64_t size, const GeometryRecord& g) {
  return absl::StrCat(size, " for ", g.vertex_count, " vertices, ", g.index_count, " indices and ",
                      ColorCount(g), " colours");
}

// `body`: the bytes after the header.
absl::Status ReadGeometry(uint64_t offset, std::span<const std::byte> body, DeltaVisitor& visitor) {
  const Checker check(offset, "geometry");
  GeometryView view;
  if (body.size() < sizeof(GeometryRecord)) {
    return check.Wrong("size", body.size() + sizeof(RecordHeader), "112 at least");
  }
  std::memcpy(&view.record, body.data(), sizeof(GeometryRecord));
  const GeometryRecord& g = view.record;
  if (absl::Status status = CheckGeometry(check, g); !status.ok()) return status;
  const uint64_t expected = sizeof(GeometryRecord) + ArrayLayout::Of(g).size;
  if (body.size() != expected) {
    return check.Wrong("size", body.size() + sizeof(RecordHeader),
                       ForCounts(expected + sizeof(RecordHeader), g).c_str());
  }
  SetArrays(body.data() + sizeof(GeometryRecord), view);
  absl::Status status = check.Finite("positions", view.positions.data(), view.positions.size());
  if (!status.ok()) return status;
  if (status = CheckCode(offset, view); !status.ok()) return status;
  const bool are_indices = g.kind != PrimitiveKind::kImplicit && g.kind != PrimitiveKind::kSamples;
  for (size_t i = 0; are_indices && i < view.indices.size(); ++i) {
    if (view.indices[i] >= g.vertex_count) {
      return check.Wrong(absl::StrCat("indices[", i, "]").c_str(), view.indices[i],
                         absl::StrCat("less than vertex_count ", g.vertex_count).c_str());
    }
  }
  return visitor.OnGeometry(view);
}

absl::Status ReadBulkGeometry(uint64_t offset, std::span<const std::byte> body,
                              DeltaVisitor& visitor, BulkSource* bulk) {
  const Checker check(offset, "bulk geometry");
  GeometryView view;
  BulkRef ref;
  if (body.size() != sizeof(GeometryRecord) + sizeof(BulkRef)) {
    return check.Wrong("size", body.size() + sizeof(RecordHeader),
                       absl::StrCat(DeltaWriter::kSizeOfBulkGeometry).c_str());
  }
  std::memcpy(&view.record, body.data(), sizeof(GeometryRecord));
  std::memcpy(&ref, body.data() + sizeof(GeometryRecord), sizeof(BulkRef));
  const GeometryRecord& g = view.record;
  if (absl::Status status = CheckGeometry(check, g); !status.ok()) return status;
  const uint64_t expected = ArrayLayout::Of(g).size;
  if (ref.size < expected) {
    return check.Wrong("bulk.size", ref.size, ForCounts(expected, g).append(" at least").c_str());
  }
  if (ref.offset % kAlign != 0) return check.Wrong("bulk.offset", ref.offset, "a multiple of 16");
  absl::StatusOr<BulkView> found =
      bulk != nullptr ? bulk->Find(ref) : absl::InvalidArgumentError("bulk memory: there is none");
  if (!found.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("delta, record at byte ", offset, ": ", found.status().message()));
  }
  SetArrays(found->bytes.data(), view);
  view.bulk = std::move(found->owner);
  view.bulk_segment = ref.segment;
  if (absl::Status status = CheckCode(offset, view); !status.ok()) return status;
  return visitor.OnGeometry(view);
}

template <typename Record>
absl::StatusOr<Record> Fixed(const Checker& check, std::span<const std::byte> body) {
  if (body.size() != sizeof(Record)) {
    return check.Wrong("size", body.size() + sizeof(RecordHeader),
                       absl::StrCat(sizeof(Record) + sizeof(RecordHeader)).c_str());
  }
  Record record;
  std::memcpy(&record, body.data(), sizeof(Record));
  return record;
}

absl::Status ReadDrawable(uint64_t offset, std::span<const std::byte> body, DeltaVisitor& visitor) {
  const Checker check(offset, "drawable");
  absl::StatusOr<DrawableRecord> d = Fixed<DrawableRecord>(check, body);
  if (!d.ok()) return d.status();
  absl::Status status = FirstError(
      {check.Enum("priority", d->priority, 0, 126), check.Enum("erase", d->erase, 0, 1),
       check.Enum("tint", d->tint, 0, 0x00FFFFFF), check.Finite("transform", d->transform.m, 12)});
  return status.ok() ? visitor.OnDrawable(*d) : status;
}

absl::Status CheckClip(const Checker& check, const LayerRecord& l) {
  absl::Status status =
      FirstError({check.Enum("plane_count", l.plane_count, 0, kMaxClipPlanes),
                  check.Enum("cylinder_count", l.cylinder_count, 0, kMaxClipCylinders),
                  check.Enum("has_region", l.has_region, 0, 1)});
  if (!status.ok()) return status;
  for (uint32_t i = 0; i < l.plane_count; ++i) {
    const ClipPlane& p = l.planes[i];
    const std::string field = absl::StrCat("planes[", i, "]");
    const double values[4] = {p.a, p.b, p.c, p.d};
    status = check.Finite(field.c_str(), values, 4);
    if (!status.ok()) return status;
    if (p.a == 0 && p.b == 0 && p.c == 0) {
      return check.Wrong(field.c_str(), "(0, 0, 0)", "a plane with a normal other than zero");
    }
  }
  for (uint32_t i = 0; i < l.cylinder_count; ++i) {
    const std::string field = absl::StrCat("cylinders[", i, "].unit");
    status = check.Finite(field.c_str(), l.cylinders[i].unit.m, 12);
    if (!status.ok()) return status;
  }
  if (l.has_region == 0) return absl::OkStatus();
  status = FirstError(
      {check.Finite("region.min", l.region.min, 3), check.Finite("region.max", l.region.max, 3)});
  for (int a = 0; a < 3 && status.ok(); ++a) {
    if (l.region.min[a] < l.region.max[a]) continue;
    status = check.Wrong(absl::StrCat("region.max[", a, "]").c_str(), l.region.max[a],
                         absl::StrCat("greater than min's ", l.region.min[a]).c_str());
  }
  return status;
}

absl::Status ReadLayer(uint64_t offset, std::span<const std::byte> body, DeltaVisitor& visitor) {
  const Checker check(offset, "layer");
  absl::StatusOr<LayerRecord> l = Fixed<LayerRecord>(check, body);
  if (!l.ok()) return l.status();
  absl::Status status = FirstError(
      {check.Enum("visible", l->visible, 0, 1), check.Enum("opacity", l->opacity, 0, 255),
       check.Enum("blend", static_cast<uint32_t>(l->blend), 0, 2),
       check.Enum("has_mask", l->has_mask, 0, 1), check.Finite("transform", l->transform.m, 12),
       CheckClip(check, *l)});
  return status.ok() ? visitor.OnLayer(*l) : status;
}

absl::Status ReadRecord(Op op, uint64_t offset, std::span<const std::byte> body,
                        DeltaVisitor& visitor, BulkSource* bulk) {
  switch (op) {
    case Op::kPutGeometry:
      return ReadGeometry(offset, body, visitor);
    case Op::kPutBulkGeometry:
      return ReadBulkGeometry(offset, body, visitor, bulk);
    case Op::kPutDrawable:
      return ReadDrawable(offset, body, visitor);
    case Op::kPutLayer:
      return ReadLayer(offset, body, visitor);
    case Op::kDropGeometry:
    case Op::kDropDrawable:
    case Op::kDropLayer: {
      absl::StatusOr<IdRecord> id = Fixed<IdRecord>(Checker(offset, "drop"), body);
      return id.ok() ? visitor.OnDrop(op, id->id) : id.status();
    }
    case Op::kReset:
      if (!body.empty()) {
        return Checker(offset, "reset").Wrong("size", body.size() + sizeof(RecordHeader), "16");
      }
      return visitor.OnReset();
  }
  return Checker(offset, "header").Wrong("op", static_cast<uint32_t>(op), "1 to 8");
}

}  // namespace

uint64_t ColorCount(const GeometryRecord& g) {
  uint64_t count = g.color_mode == ColorMode::kPerVertex ? g.vertex_count : 0;
  if (g.texture_width != 0) {
    count += uint64_t{2} * g.vertex_count + TexelCount(g.texture_width, g.texture_height);
  }
  return count;
}

// Counts are 32-bit, so the sums fit in 64 bits.
ArrayLayout ArrayLayout::Of(const GeometryRecord& g) {
  ArrayLayout layout;
  layout.indices = Padded(uint64_t{g.vertex_count} * 12);
  layout.colors = layout.indices + Padded(uint64_t{g.index_count} * 4);
  layout.size = layout.colors + Padded(ColorCount(g) * 4);
  return layout;
}

size_t DeltaWriter::SizeOf(const GeometryRecord& g) {
  return sizeof(RecordHeader) + sizeof(GeometryRecord) + ArrayLayout::Of(g).size;
}

void DeltaWriter::Append(const void* data, size_t size) {
  if (size != 0 && size_ <= out_.size() && size <= out_.size() - size_) {
    std::memcpy(out_.data() + size_, data, size);
  }
  size_ += size;
}

void DeltaWriter::Pad() {
  constexpr std::byte kZeros[kAlign] = {};
  Append(kZeros, Padded(size_) - size_);
}

void DeltaWriter::Begin(Op op, size_t size) {
  const RecordHeader header{.op = op, .size = size};
  Append(&header, sizeof(header));
}

void DeltaWriter::PutGeometry(const GeometryRecord& g, std::span<const float> positions,
                              std::span<const uint32_t> indices, std::span<const uint32_t> colors) {
  Begin(Op::kPutGeometry, SizeOf(g));
  Append(&g, sizeof(g));
  Append(positions.data(), positions.size_bytes());
  Pad();
  Append(indices.data(), indices.size_bytes());
  Pad();
  Append(colors.data(), colors.size_bytes());
  Pad();
}

void DeltaWriter::PutGeometry(const GeometryRecord& g, BulkBlock arrays) {
  const BulkRef ref = RefOf(arrays);
  Begin(Op::kPutBulkGeometry, kSizeOfBulkGeometry);
  Append(&g, sizeof(g));
  Append(&ref, sizeof(ref));
  referred_.push_back(std::move(arrays));
}

void DeltaWriter::PutDrawable(const DrawableRecord& d) {
  Begin(Op::kPutDrawable, SizeOf(d));
  Append(&d, sizeof(d));
}

void DeltaWriter::PutLayer(const LayerRecord& l) {
  Begin(Op::kPutLayer, SizeOf(l));
  Append(&l, sizeof(l));
}

void DeltaWriter::Drop(Op op, uint64_t id) {
  const IdRecord record{.id = id};
  Begin(op, kSizeOfId);
  Append(&record, sizeof(record));
}

void DeltaWriter::Reset() { Begin(Op::kReset, kSizeOfReset); }

absl::Status ReadDelta(std::span<const std::byte> delta, DeltaVisitor& visitor, BulkSource* bulk) {
  if (reinterpret_cast<uintptr_t>(delta.data()) % kAlign != 0) {
    return absl::InvalidArgumentError("delta: its memory must be 16-byte aligned");
  }
  for (uint64_t offset = 0; offset < delta.size();) {
    const uint64_t left = delta.size() - offset;
    const Checker check(offset, "header");
    if (left < sizeof(RecordHeader)) {
      return check.Wrong("size", left, "16 at least: the delta is cut off");
    }
    RecordHeader header;
    std::memcpy(&header, delta.data() + offset, sizeof(header));
    if (header.size < sizeof(RecordHeader) || header.size % kAlign != 0 || header.size > left) {
      return check.Wrong(
          "size", header.size,
          absl::StrCat("a multiple of 16 from 16 to ", left, ", what is left").c_str());
    }
    absl::Status status =
        ReadRecord(header.op, offset,
                   delta.subspan(offset + sizeof(RecordHeader), header.size - sizeof(RecordHeader)),
                   visitor, bulk);
    if (!status.ok()) return status;
    offset += header.size;
  }
  return absl::OkStatus();
}

}  // namespace voxeld::gpu
