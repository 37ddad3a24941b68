#include "daemon/wire/encode.h"

#include <variant>

#include "daemon/wire/convert.h"

namespace voxeld::daemon::wire {
namespace {

void EncodeStages(const Stages& in, v1::Stages* out) {
  out->set_sent_ns(in.sent_ns);
  out->set_received_ns(in.received_ns);
  out->set_decoded_ns(in.decoded_ns);
  out->set_applied_ns(in.applied_ns);
  out->set_drawing_ns(in.drawing_ns);
  out->set_assembled_ns(in.assembled_ns);
  out->set_sliced_ns(in.sliced_ns);
  out->set_transferred_ns(in.transferred_ns);
  out->set_shown_ns(in.shown_ns);
}

void EncodeOutcome(const CommitOutcome& in, v1::Outcome* out) {
  out->set_display(in.display);
  switch (in.kind) {
    case CommitOutcome::Kind::kPresented:
      out->mutable_presented()->set_volume(in.volume);
      out->mutable_presented()->set_time_ns(in.time_ns);
      out->mutable_presented()->set_evidence(ToWire(in.evidence));
      out->mutable_presented()->set_last_byte_ns(in.last_byte_ns);
      EncodeStages(in.stages, out->mutable_presented()->mutable_stages());
      return;
    case CommitOutcome::Kind::kUnchanged:
      out->mutable_unchanged()->set_volume(in.volume);
      return;
    case CommitOutcome::Kind::kSuperseded:
      out->mutable_superseded()->set_by_frame_id(in.by_frame_id);
      out->mutable_superseded()->set_by_sequence(in.by_sequence);
      return;
    case CommitOutcome::Kind::kLost:
      out->mutable_lost()->set_reason(in.reason);
      return;
    case CommitOutcome::Kind::kNotShown:
      out->mutable_not_shown()->set_why(ToWire(in.why));
      return;
  }
}

struct ReceiptEncoder {
  v1::Receipt* out;
  void operator()(const Accepted& in) const {
    v1::Accepted* to = out->mutable_accepted();
    to->set_snapshot(in.snapshot);
    to->set_refused_operations(in.refused_operations);
    to->set_applied_time_ns(in.applied_time_ns);
    to->mutable_displays()->Assign(in.displays.begin(), in.displays.end());
    to->set_late(in.late);
    to->set_dropped_frames(in.dropped_frames);
    to->set_durable(in.durable);
    EncodeStages(in.stages, to->mutable_stages());
  }
  void operator()(const Refused& in) const {
    out->mutable_refused()->set_refused_operations(in.refused_operations);
    out->mutable_refused()->set_message(in.message);
  }
  void operator()(const CommitOutcome& in) const { EncodeOutcome(in, out->mutable_outcome()); }
  void operator()(const Scheduled& in) const {
    out->mutable_scheduled()->set_present_at_ns(in.present_at_ns);
  }
  void operator()(const Durable& in) const { out->mutable_durable()->set_snapshot(in.snapshot); }
};

}  // namespace

void Encode(const SessionInfo& in, v1::Opened* out) {
  out->set_session(in.session);
  out->set_resume_token(in.resume_token);
  out->set_owner(in.owner);
  out->set_owner_token(in.owner_token);
  out->mutable_displays()->Assign(in.displays.begin(), in.displays.end());
  out->set_credit_bytes(in.credit_bytes);
  if (in.last_frame_id.has_value()) out->set_last_frame_id(*in.last_frame_id);
  if (in.last_sequence.has_value()) out->set_last_sequence(*in.last_sequence);
}

void Encode(const OwnerInfo& in, v1::OwnerInfo* out) {
  out->set_owner(in.owner);
  out->set_principal(in.principal);
  out->mutable_client_names()->Assign(in.client_names.begin(), in.client_names.end());
  out->set_sessions(in.sessions);
  out->set_layers(in.layers);
  out->set_orphaned_layers(in.orphaned_layers);
  out->set_entities(in.entities);
  out->set_objects(in.objects);
  out->set_bytes(in.bytes);
  out->set_hidden(in.hidden);
  out->set_max_bytes(in.max_bytes);
  out->set_max_entities(in.max_entities);
}

void Encode(const std::vector<OwnerInfo>& in, v1::ListOwnersResponse* out) {
  for (const OwnerInfo& owner : in) Encode(owner, out->add_owners());
}

void Encode(const Issue& in, v1::Issue* out) {
  out->set_sequence(in.sequence);
  out->set_layer(in.layer);
  out->set_id(in.id);
  out->set_field(in.field);
  out->set_reason(ToWire(in.reason));
  out->set_message(in.message);
  out->set_applied(in.applied);
}

void Encode(const Receipt& in, v1::Receipt* out) {
  out->set_frame_id(in.frame_id);
  out->set_sequence(in.sequence);
  std::visit(ReceiptEncoder{out}, in.what);
}

void Encode(const Limits& in, v1::Limits* out) {
  out->set_max_message_bytes(in.max_message_bytes);
  out->set_max_entities_per_owner(in.max_entities_per_owner);
  out->set_max_layers_per_owner(in.max_layers_per_owner);
  out->set_max_bytes_per_owner(in.max_bytes_per_owner);
  out->set_max_vertices_per_entity(in.max_vertices_per_entity);
  out->set_max_indices_per_entity(in.max_indices_per_entity);
  out->set_max_id_bytes(in.max_id_bytes);
  out->set_max_operations_per_commit(in.max_operations_per_commit);
  out->set_max_uncommitted_bytes(in.max_uncommitted_bytes);
  out->set_max_instance_depth(in.max_instance_depth);
  out->set_max_coordinate_voxels(in.max_coordinate_voxels);
  out->set_max_thickness(in.max_thickness);
  out->set_max_sessions(in.max_sessions);
  out->set_max_parts_per_object(in.max_parts_per_object);
  out->set_max_clip_planes(in.max_clip_planes);
  out->set_max_clip_cylinders(in.max_clip_cylinders);
  out->set_max_expression_nodes(in.max_expression_nodes);
  out->set_max_expression_depth(in.max_expression_depth);
  out->set_max_boundary_points(in.max_boundary_points);
  out->set_max_texture_texels(in.max_texture_texels);
  out->set_max_entities(in.max_entities);
  out->set_max_layers(in.max_layers);
  out->set_max_scene_bytes(in.max_scene_bytes);
  out->set_max_captures(in.max_captures);
  out->set_max_linger_ns(in.max_linger_ns);
  out->set_max_issues_per_commit(in.max_issues_per_commit);
  out->set_max_uncommitted_bytes_total(in.max_uncommitted_bytes_total);
  out->set_credit_bytes(in.credit_bytes);
  out->set_max_memory_bytes(in.max_memory_bytes);
  out->set_max_riding_commits(in.max_riding_commits);
  out->set_max_timed_commits(in.max_timed_commits);
  out->set_max_present_at_horizon_ns(in.max_present_at_horizon_ns);
  out->set_must_show_timeout_ns(in.must_show_timeout_ns);
  out->set_max_drop_oldest_frames(in.max_drop_oldest_frames);
  out->set_max_local_bytes(in.max_local_bytes);
  out->set_max_asset_bytes(in.max_asset_bytes);
  out->set_max_assets_bytes(in.max_assets_bytes);
  out->set_max_assets(in.max_assets);
}

void Encode(const EntityKey& in, v1::EntityKey* out) {
  out->set_owner(in.owner);
  out->set_layer(in.layer);
  out->set_id(in.id);
}

void Encode(const EntityInfo& in, v1::EntityInfo* out) {
  Encode(in.key, out->mutable_key());
  out->set_kind(in.kind);
  out->set_vertices(in.vertices);
  out->set_bytes(in.bytes);
  out->set_priority(in.priority);
  out->set_erase(in.erase);
  ToWire(in.transform, out->mutable_transform());
  out->set_sequence(in.sequence);
  out->set_expires_ns(in.expires_ns == sync::kNever ? 0 : in.expires_ns);
  out->set_label(in.label);
  out->mutable_color()->set_rgb(in.color);
}

void Encode(const LayerInfo& in, v1::LayerInfo* out) {
  out->set_owner(in.owner);
  out->set_layer(in.layer);
  out->set_number(in.number);
  out->set_visible(in.visible);
  out->set_opacity(in.opacity);
  out->set_order(in.order);
  out->set_blend(ToWire(in.blend));
  ToWire(in.transform, out->mutable_transform());
  if (!in.clip.empty()) ToWire(in.clip, out->mutable_clip());
  if (in.region.has_value()) ToWire(*in.region, out->mutable_region());
  out->set_mask_layer(in.mask);
  out->set_entities(in.entities);
  out->set_bytes(in.bytes);
  out->set_orphaned(in.orphaned);
  out->set_client_name(in.client_name);
}

void Encode(const EntityPage& in, v1::ListEntitiesResponse* out) {
  for (const EntityInfo& entity : in.entities) Encode(entity, out->add_entities());
  for (const LayerInfo& layer : in.layers) Encode(layer, out->add_layers());
  out->set_next_page_token(in.next_page_token);
  out->set_total(in.total);
}

void Encode(const Cleared& in, v1::ClearLayerResponse* out) {
  out->set_entities(in.entities);
  out->set_layers(in.layers);
}

void Encode(const DisplayDescription& in, v1::DisplayDescription* out) {
  out->set_name(in.info.name);
  out->set_driver(in.info.driver);
  out->set_state(ToWire(in.state));
  out->set_state_reason(in.state_reason);
  ToWire(in.info.geometry, out->mutable_geometry());
  ToWire(in.info.layout, out->mutable_layout());
  out->set_volumes_per_second(in.info.volumes_per_second);
  out->set_brightness(in.brightness);
  out->set_blank(in.blank);
  out->set_power_limit_w(in.power_limit_w);
  out->set_genlock(in.genlock);
  out->set_test_pattern(ToWire(in.pattern));
  ToWire(in.view, out->mutable_view());
  ToWire(in.scene_to_voxel, out->mutable_scene_to_voxel());
}

void Encode(const DisplayDescription& display, const display::DecodedVolume& volume,
            v1::VolumeHeader* out) {
  out->set_volume(volume.volume);
  out->set_display(display.info.name);
  ToWire(display.info.geometry, out->mutable_geometry());
  ToWire(volume.layout, out->mutable_layout());
  out->set_source(ToWire(volume.source));
}

}  // namespace voxeld::daemon::wire
