#include "daemon/wire/named_ranges.h"

#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/core/budget.h"
#include "daemon/wire/context.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace {

constexpr uint64_t kAlignment = 4;

Fault NoLocalMemory(const FieldPath& path, const v1::MemoryRange& range) {
  return {path.ToString(), Reason::kNotFound,
          absl::StrCat("names memory ", range.memory(),
                       ", and this call has no local socket to bring any; send the bytes "
                       "themselves (Stream tells of its socket in Opened.local_socket)")};
}

// A field that can be replaced by a range.
struct Named {
  const char* name;
  const char* range_name;
  const v1::MemoryRange* range;  // null: none
  std::string* bytes;            // destination
};

MaybeFault Fetch(const FieldPath& path, const Named& named, const DecodeContext& context) {
  if (named.range == nullptr) return {};
  const FieldPath in(path, named.range_name);
  if (!named.bytes->empty()) {
    return Fault{in.ToString(), Reason::kInvalidValue,
                 absl::StrCat("is set, and ", named.name, " has ", named.bytes->size(),
                              " bytes; give one of them")};
  }
  MappedRange mapped;
  if (auto fault = ReadRange(in, *named.range, context, &mapped)) return fault;
  named.bytes->assign(mapped.bytes);
  return {};
}

MaybeFault FetchTexture(const FieldPath& path, const DecodeContext& context, v1::Texture* out) {
  const v1::MemoryRange* picture = out->has_picture_in() ? &out->picture_in() : nullptr;
  const v1::MemoryRange* places = out->has_coordinates_in() ? &out->coordinates_in() : nullptr;
  auto fault = Fetch(path, {"picture", "picture_in", picture, out->mutable_picture()}, context);
  if (!fault) {
    fault =
        Fetch(path, {"coordinates", "coordinates_in", places, out->mutable_coordinates()}, context);
  }
  out->clear_picture_in();
  out->clear_coordinates_in();
  return fault;
}

MaybeFault FetchHeights(const FieldPath& path, const DecodeContext& context, v1::HeightMap* out) {
  const Named rows[] = {
      {"heights", "heights_in", out->has_heights_in() ? &out->heights_in() : nullptr,
       out->mutable_heights()},
      {"colors", "colors_in", out->has_colors_in() ? &out->colors_in() : nullptr,
       out->mutable_colors()},
      {"picture", "picture_in", out->has_picture_in() ? &out->picture_in() : nullptr,
       out->mutable_picture()}};
  for (const Named& named : rows) {
    if (auto fault = Fetch(path, named, context)) return fault;
  }
  out->clear_heights_in();
  out->clear_colors_in();
  out->clear_picture_in();
  return {};
}

// Requires: `out` names samples (NamesMore).
MaybeFault FetchSamples(const FieldPath& path, const DecodeContext& context, v1::Grid* out) {
  auto fault =
      Fetch(path, {"samples", "samples_in", &out->samples_in(), out->mutable_samples()}, context);
  out->clear_samples_in();
  return fault;
}

}  // namespace

MaybeFault ReadRange(const FieldPath& path, const v1::MemoryRange& range,
                     const DecodeContext& context, MappedRange* out) {
  if (context.ranges == nullptr) return NoLocalMemory(path, range);
  return context.ranges->Read(path, range, out);
}

NamedRanges::~NamedRanges() {
  if (charged_ > 0) sources_.budget->Release(Budget::Use::kArriving, charged_);
}

MaybeFault NamedRanges::Read(const FieldPath& path, const v1::MemoryRange& range,
                             MappedRange* out) {
  const bool asset = !range.asset().empty();
  if (asset && range.asset().size() != AssetSource::kDigestBytes) {
    return Fault{FieldPath(path, "asset").ToString(), Reason::kInvalidValue,
                 absl::StrCat("has ", range.asset().size(), " bytes; a SHA-256 has ",
                              AssetSource::kDigestBytes)};
  }
  if (asset && range.memory() != 0) {
    return Fault{FieldPath(path, "asset").ToString(), Reason::kInvalidValue,
                 absl::StrCat("is set, and memory is ", range.memory(), "; give one of them")};
  }
  if (!asset && sources_.memory == nullptr) return NoLocalMemory(path, range);
  if (!asset && range.offset() % kAlignment != 0) {
    return Fault{FieldPath(path, "offset").ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", range.offset(), "; give a multiple of ", kAlignment)};
  }
  if (range.size() > limit_ - bytes_read_) {
    return Fault{FieldPath(path, "size").ToString(), Reason::kQuotaExceeded,
                 absl::StrCat("is ", range.size(), " after ", bytes_read_,
                              " bytes that this request has read from memory and assets; "
                              "max_uncommitted_bytes allows ",
                              limit_, " in one: spread them over requests with commits between")};
  }
  if (asset && sources_.assets == nullptr) {
    return Fault{FieldPath(path, "asset").ToString(), Reason::kUnimplemented,
                 "is set, and this server keeps no assets (max_assets_bytes is 0); send the bytes "
                 "themselves"};
  }
  if (asset && sources_.budget != nullptr) {
    if (!sources_.budget->Charge(Budget::Use::kArriving, range.size())) {
      return Fault{FieldPath(path, "size").ToString(), Reason::kQuotaExceeded,
                   absl::StrCat("is ", range.size(), ", beside ", sources_.budget->used_bytes(),
                                " bytes that are held for all clients; max_memory_bytes allows ",
                                sources_.budget->limit_bytes(),
                                ": try again when others have taken something away")};
    }
    charged_ += range.size();
  }
  absl::StatusOr<MappedRange> found =
      asset ? sources_.assets->FindAsset(range.asset(), range.offset(), range.size())
            : sources_.memory->Find(range.memory(), range.offset(), range.size());
  if (!found.ok()) {
    const bool beyond = absl::IsOutOfRange(found.status());
    const FieldPath field(path, beyond ? "size" : asset ? "asset" : "memory");
    return Fault{field.ToString(),
                 absl::IsNotFound(found.status()) ? Reason::kNotFound : Reason::kInvalidValue,
                 std::string(found.status().message())};
  }
  bytes_read_ += range.size();
  *out = *std::move(found);
  return {};
}

bool NamesMore(const v1::Primitive& in) {
  switch (in.kind_case()) {
    case v1::Primitive::kMesh:
      return in.mesh().texture().has_picture_in() || in.mesh().texture().has_coordinates_in();
    case v1::Primitive::kHeightMap:
      return in.height_map().has_heights_in() || in.height_map().has_colors_in() ||
             in.height_map().has_picture_in();
    case v1::Primitive::kVolume:
      return in.volume().grid().has_samples_in();
    case v1::Primitive::kIsosurface:
      return in.isosurface().grid().has_samples_in();
    default:
      return false;
  }
}

MaybeFault PutInPlace(const FieldPath& path, const v1::Primitive& in, const DecodeContext& context,
                      v1::Primitive* out) {
  *out = in;
  const FieldPath kind(path, in.GetDescriptor()->FindFieldByNumber(in.kind_case())->name());
  switch (in.kind_case()) {
    case v1::Primitive::kMesh:
      return FetchTexture(FieldPath(kind, "texture"), context,
                          out->mutable_mesh()->mutable_texture());
    case v1::Primitive::kHeightMap:
      return FetchHeights(kind, context, out->mutable_height_map());
    case v1::Primitive::kVolume:
      return FetchSamples(FieldPath(kind, "grid"), context, out->mutable_volume()->mutable_grid());
    case v1::Primitive::kIsosurface:
      return FetchSamples(FieldPath(kind, "grid"), context,
                          out->mutable_isosurface()->mutable_grid());
    default:
      return {};
  }
}

}  // namespace voxeld::daemon::wire
