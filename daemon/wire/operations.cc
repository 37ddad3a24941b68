#include "daemon/wire/operations.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/wire/clip.h"
#include "daemon/wire/primitive.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::wire {
namespace {

constexpr uint32_t kGreatestPriority = 126;
constexpr uint32_t kGreatestOpacity = 255;
constexpr size_t kLabelBytes = 256;

MaybeFault ToEntity(const FieldPath& path, const v1::Entity& in, const DecodeContext& context,
                    EntityData* out) {
  if (in.priority() > kGreatestPriority) {
    return Fault{FieldPath(path, "priority").ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", in.priority(), "; give 0 to ", kGreatestPriority)};
  }
  if (in.lifetime_ns() < 0) {
    return Fault{FieldPath(path, "lifetime_ns").ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", in.lifetime_ns(),
                              "; give nanoseconds greater than 0, or 0 for an entity that stays")};
  }
  if (auto fault = CheckLabel(FieldPath(path, "label"), in.label(), kLabelBytes)) return fault;
  if (auto fault = ToAffine(FieldPath(path, "transform"), in.transform(), &out->transform)) {
    return fault;
  }
  if (auto fault =
          ToContent(FieldPath(path, "primitive"), in.primitive(), context, &out->content)) {
    return fault;
  }
  out->priority = in.priority();
  out->erase = in.erase();
  out->lifetime_ns = in.lifetime_ns();
  out->label = in.label();
  return {};
}

MaybeFault To(const FieldPath& path, const v1::Upsert& in, const DecodeContext& context,
              Upsert* out) {
  const Limits& limits = context.limits;
  if (auto fault = CheckName(FieldPath(path, "layer"), in.layer(), limits.max_id_bytes)) {
    return fault;
  }
  if (auto fault = CheckName(FieldPath(path, "id"), in.id(), limits.max_id_bytes)) return fault;
  if (auto fault = ToEntity(FieldPath(path, "entity"), in.entity(), context, &out->entity)) {
    return fault;
  }
  out->layer = in.layer();
  out->id = in.id();
  return {};
}

MaybeFault To(const FieldPath& path, const v1::Delete& in, const Limits& limits, Delete* out) {
  switch (in.what_case()) {
    case v1::Delete::kId:
      out->what = Delete::What::kId;
      out->id_or_prefix = in.id();
      if (auto fault = CheckName(FieldPath(path, "id"), in.id(), limits.max_id_bytes)) {
        return fault;
      }
      break;
    case v1::Delete::kPrefix:
      out->what = Delete::What::kPrefix;
      out->id_or_prefix = in.prefix();
      if (auto fault = CheckName(FieldPath(path, "prefix"), in.prefix(), limits.max_id_bytes)) {
        return fault;
      }
      break;
    case v1::Delete::kAllOfLayer:
      out->what = Delete::What::kAllOfLayer;
      if (!in.all_of_layer()) {
        return Fault{FieldPath(path, "all_of_layer").ToString(), Reason::kInvalidValue,
                     "is false; set it to true, or leave it out"};
      }
      break;
    case v1::Delete::kAllMine:
      out->what = Delete::What::kAllMine;
      if (!in.all_mine()) {
        return Fault{FieldPath(path, "all_mine").ToString(), Reason::kInvalidValue,
                     "is false; set it to true, or leave it out"};
      }
      break;
    default:
      return Fault{FieldPath(path, "what").ToString(), Reason::kInvalidValue,
                   "is not set; give one of id, prefix, all_of_layer, all_mine"};
  }
  if (out->what == Delete::What::kAllMine) {
    if (!in.layer().empty()) {
      return Fault{FieldPath(path, "layer").ToString(), Reason::kInvalidValue,
                   absl::StrCat("is ", Quote(in.layer()),
                                "; all_mine is about every layer: leave it empty")};
    }
  } else if (auto fault = CheckName(FieldPath(path, "layer"), in.layer(), limits.max_id_bytes)) {
    return fault;
  }
  out->layer = in.layer();
  out->guard_sequence = in.guard_sequence();
  return {};
}

MaybeFault To(const FieldPath& path, const v1::SetTransform& in, const Limits& limits,
              SetTransform* out) {
  if (auto fault = CheckName(FieldPath(path, "layer"), in.layer(), limits.max_id_bytes)) {
    return fault;
  }
  if (auto fault = CheckName(FieldPath(path, "id"), in.id(), limits.max_id_bytes)) return fault;
  out->layer = in.layer();
  out->id = in.id();
  return ToAffine(FieldPath(path, "transform"), in.transform(), &out->transform);
}

MaybeFault ToRegion(const FieldPath& path, const v1::Box3& in, std::optional<gpu::Region>* out) {
  if (!in.has_min() && !in.has_max()) return {};
  if (!in.has_min() || !in.has_max()) {
    return Fault{FieldPath(path, in.has_min() ? "max" : "min").ToString(), Reason::kInvalidValue,
                 "is not set; give both corners, or neither for all of the scene"};
  }
  if (auto fault = CheckBox(path, in)) return fault;
  *out = gpu::Region{{in.min().x(), in.min().y(), in.min().z()},
                     {in.max().x(), in.max().y(), in.max().z()}};
  return {};
}

MaybeFault To(const FieldPath& path, const v1::LayerState& in, const Limits& limits,
              LayerState* out) {
  if (auto fault = CheckName(FieldPath(path, "layer"), in.layer(), limits.max_id_bytes)) {
    return fault;
  }
  if (in.opacity() > kGreatestOpacity) {
    return Fault{FieldPath(path, "opacity").ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", in.opacity(), "; give 0 to ", kGreatestOpacity)};
  }
  switch (in.blend()) {
    case v1::BLEND_MODE_UNSPECIFIED:
      break;
    case v1::BLEND_MODE_OVER:
      out->blend = gpu::BlendMode::kOver;
      break;
    case v1::BLEND_MODE_ADD:
      out->blend = gpu::BlendMode::kAdd;
      break;
    case v1::BLEND_MODE_ERASE:
      out->blend = gpu::BlendMode::kErase;
      break;
    default:
      return UnknownEnum(FieldPath(path, "blend"), in.blend(),
                         "BLEND_MODE_OVER, BLEND_MODE_ADD, BLEND_MODE_ERASE");
  }
  if (in.has_transform()) {
    gpu::Affine transform;
    if (auto fault = ToAffine(FieldPath(path, "transform"), in.transform(), &transform)) {
      return fault;
    }
    out->transform = transform;
  }
  if (in.has_clip()) {
    auto clip = std::make_shared<Clip>();
    if (auto fault = ToClip(FieldPath(path, "clip"), in.clip(), limits, clip.get())) return fault;
    out->clip = std::move(clip);
  }
  if (in.has_region()) {
    if (auto fault = ToRegion(FieldPath(path, "region"), in.region(), &out->region.emplace())) {
      return fault;
    }
  }
  if (in.has_mask_layer()) {
    if (!in.mask_layer().empty()) {
      if (auto fault =
              CheckName(FieldPath(path, "mask_layer"), in.mask_layer(), limits.max_id_bytes)) {
        return fault;
      }
    }
    out->mask = in.mask_layer();
  }
  out->layer = in.layer();
  if (in.has_visible()) out->visible = in.visible();
  if (in.has_opacity()) out->opacity = in.opacity();
  if (in.has_order()) out->order = in.order();
  return {};
}

MaybeFault To(const FieldPath& path, const v1::FrameBegin& in, const Limits& limits,
              FrameBegin* out) {
  out->layer = in.layer();
  return CheckName(FieldPath(path, "layer"), in.layer(), limits.max_id_bytes);
}

MaybeFault To(const FieldPath& path, const v1::FrameEnd& in, const Limits& limits, FrameEnd* out) {
  out->layer = in.layer();
  return CheckName(FieldPath(path, "layer"), in.layer(), limits.max_id_bytes);
}

MaybeFault To(const FieldPath& path, const v1::DefineObject& in, const DecodeContext& context,
              DefineObject* out) {
  const Limits& limits = context.limits;
  if (auto fault = CheckName(FieldPath(path, "object"), in.object(), limits.max_id_bytes)) {
    return fault;
  }
  const FieldPath definition(path, "definition");
  if (!in.has_definition()) {
    return Fault{definition.ToString(), Reason::kInvalidValue,
                 "is not set; give the parts that the object consists of"};
  }
  const auto& parts = in.definition().parts();
  if (static_cast<uint32_t>(parts.size()) > limits.max_parts_per_object) {
    return Fault{FieldPath(definition, "parts").ToString(), Reason::kQuotaExceeded,
                 absl::StrCat("has ", parts.size(), " parts; max_parts_per_object allows ",
                              limits.max_parts_per_object)};
  }
  auto data = std::make_shared<ObjectData>();
  data->parts.resize(static_cast<size_t>(parts.size()));
  for (int i = 0; i < parts.size(); ++i) {
    const FieldPath part(definition, "parts", i);
    ObjectPart& to = data->parts[static_cast<size_t>(i)];
    if (auto fault = ToAffine(FieldPath(part, "transform"), parts[i].transform(), &to.transform)) {
      return fault;
    }
    if (auto fault =
            ToContent(FieldPath(part, "primitive"), parts[i].primitive(), context, &to.content)) {
      return fault;
    }
  }
  out->object = in.object();
  out->data = std::move(data);
  return {};
}

MaybeFault To(const FieldPath& path, const v1::DeleteObject& in, const Limits& limits,
              DeleteObject* out) {
  out->object = in.object();
  out->cascade = in.cascade();
  return CheckName(FieldPath(path, "object"), in.object(), limits.max_id_bytes);
}

// Checks a Commit. It is applied even if it has a fault.
MaybeFault To(const FieldPath& path, const v1::Commit& in, const Limits&, Commit* out) {
  *out = {in.frame_id(), in.send_time_ns(), in.client_drops(), 0, in.must_show()};
  out->durable = in.durable();
  if (in.present_at_ns() < 0) {
    return Fault{FieldPath(path, "present_at_ns").ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", in.present_at_ns(),
                              "; give a time by the server's clock (Opened.server_time_ns), or 0 "
                              "for at once")};
  }
  out->present_at_ns = in.present_at_ns();
  return {};
}

// The message contains only the field's name; the issue has the whole path.
void AddIssue(Fault fault, uint64_t sequence, std::string layer, std::string id,
              const Limits& limits, const Sinks& out, bool applied = false) {
  std::string message =
      absl::StrCat(fault.field.substr(fault.field.rfind('.') + 1), " ", fault.message);
  out.refused->Add({sequence, std::move(layer), std::move(id), std::move(fault.field), fault.reason,
                    std::move(message), applied},
                   limits.max_issues_per_commit);
}

template <typename In>
std::string LayerOf(const In& in) {
  if constexpr (requires { in.layer(); }) return in.layer();
  return {};
}

template <typename In>
std::string IdOf(const In& in) {
  if constexpr (requires { in.id(); }) return in.id();
  if constexpr (requires { in.object(); }) return in.object();
  return {};
}

template <typename Out, typename In>
void Add(const FieldPath& path, const In& in, uint64_t sequence, const DecodeContext& context,
         const Sinks& out) {
  Out op;
  std::vector<Fault> notes;
  DecodeContext noting = context;
  noting.notes = &notes;
  if (auto fault = To(path, in, noting, &op)) {
    AddIssue(*std::move(fault), sequence, LayerOf(in), IdOf(in), context, out);
    if (!std::is_same_v<Out, Commit>) return;
  }
  for (Fault& note : notes) {
    AddIssue(std::move(note), sequence, LayerOf(in), IdOf(in), context, out, /*applied=*/true);
  }
  out.operations->push_back({sequence, std::move(op)});
}

void AddBatch(const FieldPath& path, const v1::Batch& in, uint64_t sequence,
              const DecodeContext& context, const Sinks& out) {
  if (static_cast<uint32_t>(in.upserts_size()) > context.limits.max_operations_per_commit) {
    const FieldPath upserts(path, "upserts");
    AddIssue(
        {upserts.ToString(), Reason::kQuotaExceeded,
         absl::StrCat("has ", in.upserts_size(), " entities; max_operations_per_commit allows ",
                      context.limits.max_operations_per_commit)},
        sequence, {}, {}, context, out);
    return;
  }
  out.operations->reserve(out.operations->size() + static_cast<size_t>(in.upserts_size()));
  for (int i = 0; i < in.upserts_size(); ++i) {
    Add<Upsert>(FieldPath(path, "upserts", i), in.upserts(i), sequence, context, out);
  }
}

}  // namespace

void DecodeOperation(const FieldPath& path, const v1::StreamRequest& request, uint64_t sequence,
                     const DecodeContext& context, const Sinks& out) {
  switch (request.op_case()) {
    case v1::StreamRequest::kUpsert:
      return Add<Upsert>(FieldPath(path, "upsert"), request.upsert(), sequence, context, out);
    case v1::StreamRequest::kDelete:
      return Add<Delete>(FieldPath(path, "delete"), request.delete_(), sequence, context, out);
    case v1::StreamRequest::kSetTransform:
      return Add<SetTransform>(FieldPath(path, "set_transform"), request.set_transform(), sequence,
                               context, out);
    case v1::StreamRequest::kLayerState:
      return Add<LayerState>(FieldPath(path, "layer_state"), request.layer_state(), sequence,
                             context, out);
    case v1::StreamRequest::kFrameBegin:
      return Add<FrameBegin>(FieldPath(path, "frame_begin"), request.frame_begin(), sequence,
                             context, out);
    case v1::StreamRequest::kFrameEnd:
      return Add<FrameEnd>(FieldPath(path, "frame_end"), request.frame_end(), sequence, context,
                           out);
    case v1::StreamRequest::kCommit:
      return Add<Commit>(FieldPath(path, "commit"), request.commit(), sequence, context, out);
    case v1::StreamRequest::kDefineObject:
      return Add<DefineObject>(FieldPath(path, "define_object"), request.define_object(), sequence,
                               context, out);
    case v1::StreamRequest::kDeleteObject:
      return Add<DeleteObject>(FieldPath(path, "delete_object"), request.delete_object(), sequence,
                               context, out);
    case v1::StreamRequest::kBatch:
      return AddBatch(FieldPath(path, "batch"), request.batch(), sequence, context, out);
    case v1::StreamRequest::kOpen:
    case v1::StreamRequest::kPing:
    case v1::StreamRequest::OP_NOT_SET:
      break;
  }
  AddIssue({FieldPath(path, "op").ToString(), Reason::kInvalidValue,
            "is not set, or not known to this version of the server; give one of upsert, delete, "
            "set_transform, layer_state, frame_begin, frame_end, commit, define_object, "
            "delete_object, batch"},
           sequence, {}, {}, context, out);
}

}  // namespace voxeld::daemon::wire
