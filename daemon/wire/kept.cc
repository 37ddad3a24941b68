#include "daemon/wire/kept.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/core/scene_info.h"
#include "daemon/wire/convert.h"
#include "daemon/wire/decode.h"
#include "daemon/wire/encode.h"
#include "daemon/wire/encode_primitive.h"
#include "voxeld/v1/scene.pb.h"
#include "voxeld/v1/state.pb.h"

namespace voxeld::daemon::wire {
namespace {

// An SQLite row holds at most 10⁹ bytes; this leaves room for the rest of the message.
constexpr uint64_t kMostStoredBytes = uint64_t{900} << 20;

template <typename Message>
absl::Status ParseStored(std::string_view bytes, Message* out) {
  if (out->ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return absl::OkStatus();
  return absl::DataLossError(absl::StrCat(bytes.size(), " bytes are no ", out->GetTypeName()));
}

absl::StatusOr<Operation> TheOperation(const v1::StreamRequest& request, const Limits& limits,
                                       gpu::BulkPool* pool, text::Fonts* fonts) {
  // The content was accepted earlier, in one message or in several.
  Decoded decoded = DecodeStreamRequest(request, limits, 0, pool, {}, fonts);
  if (!decoded.status.ok()) return decoded.status;
  if (decoded.refused.first.has_value()) {
    const Issue& issue = *decoded.refused.first;
    return absl::InvalidArgumentError(absl::StrCat(issue.field, ": ", issue.message));
  }
  if (decoded.operations.size() != 1) return absl::DataLossError("it is no operation");
  return std::move(decoded.operations.front());
}

}  // namespace

std::string EncodeKept(const OwnerRecord& owner) {
  v1::KeptOwner out;
  out.set_token(owner.token);
  out.set_principal(owner.principal);
  out.set_hidden(owner.hidden);
  out.set_max_bytes(owner.max_bytes == UINT64_MAX ? 0 : owner.max_bytes);
  out.set_max_entities(owner.max_entities == UINT64_MAX ? 0 : owner.max_entities);
  return out.SerializeAsString();
}

std::string EncodeKept(const OwnedName& key, const Layer& layer) {
  LayerInfo info = InfoOf(key, layer);
  info.entities = 0;
  info.bytes = 0;
  v1::KeptLayer out;
  Encode(info, out.mutable_info());
  return out.SerializeAsString();
}

std::string EncodeKept(const Object& object) {
  v1::KeptObject out;
  Encode(*object.data, out.mutable_definition());
  return out.SerializeAsString();
}

absl::StatusOr<std::string> EncodeKept(const Entity& entity, const TwoClocks& now) {
  const uint64_t bytes = EncodedBytes(entity.data.content);
  if (bytes > kMostStoredBytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat("its contents are ", bytes, " bytes; ", kMostStoredBytes, " can be kept"));
  }
  v1::KeptEntity out;
  v1::Entity* to = out.mutable_entity();
  Encode(entity.data.content, to->mutable_primitive());
  ToWire(entity.data.transform, to->mutable_transform());
  to->set_priority(entity.data.priority);
  to->set_erase(entity.data.erase);
  to->set_label(entity.data.label);
  if (entity.expires_ns != sync::kNever) {
    // Saturates at the latest time that can be represented, centuries ahead.
    const int64_t left = entity.expires_ns - now.monotonic_ns;
    out.set_expires_unix_ns(now.unix_ns + std::min(left, INT64_MAX - now.unix_ns));
  }
  return out.SerializeAsString();
}

absl::StatusOr<OwnerRecord> DecodeKeptOwner(std::string_view bytes) {
  v1::KeptOwner in;
  if (absl::Status status = ParseStored(bytes, &in); !status.ok()) return status;
  return OwnerRecord{.token = in.token(),
                     .principal = in.principal(),
                     .hidden = in.hidden(),
                     .max_bytes = in.max_bytes() == 0 ? UINT64_MAX : in.max_bytes(),
                     .max_entities = in.max_entities() == 0 ? UINT64_MAX : in.max_entities()};
}

absl::StatusOr<KeptLayerRow> DecodeKeptLayer(std::string_view bytes, const Limits& limits) {
  v1::KeptLayer in;
  if (absl::Status status = ParseStored(bytes, &in); !status.ok()) return status;
  const v1::LayerInfo& info = in.info();
  v1::StreamRequest request;
  v1::LayerState* state = request.mutable_layer_state();
  state->set_layer(info.layer());
  state->set_visible(info.visible());
  state->set_opacity(info.opacity());
  state->set_order(info.order());
  state->set_blend(info.blend());
  *state->mutable_transform() = info.transform();
  if (info.has_clip()) *state->mutable_clip() = info.clip();
  if (info.has_region()) *state->mutable_region() = info.region();
  state->set_mask_layer(info.mask_layer());
  absl::StatusOr<Operation> operation = TheOperation(request, limits, nullptr, nullptr);
  if (!operation.ok()) return operation.status();
  return KeptLayerRow{info.number(), info.client_name(), *std::move(operation)};
}

absl::StatusOr<KeptObjectRow> DecodeKeptObject(const std::string& name, std::string_view bytes,
                                               const Limits& limits, gpu::BulkPool* pool,
                                               text::Fonts* fonts) {
  v1::KeptObject in;
  if (absl::Status status = ParseStored(bytes, &in); !status.ok()) return status;
  KeptObjectRow row;
  for (const v1::Object::Part& part : in.definition().parts()) {
    if (part.primitive().has_instance())
      row.refers_to.push_back(part.primitive().instance().object());
  }
  v1::StreamRequest request;
  request.mutable_define_object()->set_object(name);
  request.mutable_define_object()->mutable_definition()->Swap(in.mutable_definition());
  absl::StatusOr<Operation> operation = TheOperation(request, limits, pool, fonts);
  if (!operation.ok()) return operation.status();
  row.operation = *std::move(operation);
  return row;
}

absl::StatusOr<std::optional<Operation>> DecodeKeptEntity(
    const std::string& layer, const std::string& id, std::string_view bytes, const TwoClocks& now,
    const Limits& limits, gpu::BulkPool* pool, text::Fonts* fonts) {
  v1::KeptEntity in;
  if (absl::Status status = ParseStored(bytes, &in); !status.ok()) return status;
  if (in.expires_unix_ns() != 0) {
    if (in.expires_unix_ns() <= now.unix_ns) return std::optional<Operation>();
    in.mutable_entity()->set_lifetime_ns(in.expires_unix_ns() - now.unix_ns);
  }
  v1::StreamRequest request;
  request.mutable_upsert()->set_layer(layer);
  request.mutable_upsert()->set_id(id);
  request.mutable_upsert()->mutable_entity()->Swap(in.mutable_entity());
  absl::StatusOr<Operation> operation = TheOperation(request, limits, pool, fonts);
  if (!operation.ok()) return operation.status();
  return std::optional<Operation>(*std::move(operation));
}

}  // namespace voxeld::daemon::wire
