// Lists every field of the configuration once, with its section, key and range. Reading and
// printing visit this list.
#pragma once

#include <cstdint>
#include <limits>

#include "daemon/config/config.h"

namespace voxeld::daemon {

// `visitor` has
//   Section(name)                         the following fields belong to it
//   Listen(key, addresses&)
//   Http(key, optional<Address>&, asked&)
//   LocalSocket(key, string&)
//   Choice(key, string&, {values…})
//   Engine(key, kind&)
//   Integer(key, integer&, least, greatest)
//   Real(key, double&, least, greatest)
//   Flag(key, bool&)
//   Text(key, string&)                    any text
//   Program(key, string&)                 a file, or unix: and an absolute path
//   Scopes(key, string&, auto_too)        as access::ParseScopes accepts it, or "auto"
template <typename Visitor, typename ConfigType>
void VisitFields(ConfigType& config, Visitor& visitor) {
  constexpr int64_t kMost = std::numeric_limits<int64_t>::max();
  constexpr int64_t kGiB = int64_t{1} << 30;
  constexpr int64_t kSecond = sync::kSecond;
  constexpr int64_t kHour = 3600 * kSecond;
  constexpr int64_t kMost32 = std::numeric_limits<uint32_t>::max();

  visitor.Section("server");
  visitor.Listen("listen", config.server.listen);
  visitor.Http("http", config.server.http, config.server.http_asked);
  visitor.LocalSocket("local_socket", config.server.local_socket);
  visitor.Integer("max_local_memories", config.server.max_local_memories, 1, 4096);
  visitor.Integer("max_queued_answers", config.server.max_queued_answers, 16, 1 << 24);
  visitor.Integer("max_queued_bytes", config.server.max_queued_bytes, 4096, kGiB);
  visitor.Integer("max_calls_per_connection", config.server.max_calls_per_connection, 1, 65536);
  visitor.Integer("max_scene_watches", config.server.max_scene_watches, 1, 65536);
  visitor.Integer("max_stats_watches", config.server.max_stats_watches, 1, 65536);
  visitor.Integer("max_volume_watches", config.server.max_volume_watches, 1, 65536);
  visitor.Integer("watch_write_limit_ns", config.server.watch_write_limit_ns, kSecond / 10, kHour);
  visitor.Integer("upload_silence_limit_ns", config.server.upload_silence_limit_ns, kSecond / 10,
                  kHour);
  auto& connections = config.server.connections;
  visitor.Integer("max_connections", connections.max_connections, 1, 1 << 20);
  visitor.Integer("max_connections_per_address", connections.max_connections_per_address, 1,
                  1 << 20);
  visitor.Integer("unauthorised_bytes", connections.unauthorised_bytes, 4096, kGiB);
  visitor.Integer("unauthorised_limit_ns", connections.unauthorised_limit_ns, kSecond / 10, kHour);
  visitor.Integer("max_cancelled_calls_per_second", connections.max_cancelled_calls_per_second, 0,
                  kMost32);
  visitor.Integer("cut_penalty_ns", connections.cut_penalty_ns, 0, kHour);
  visitor.Integer("probe_interval_ns", connections.probe_interval_ns, 0, kHour);
  visitor.Integer("max_metadata_bytes", config.server.max_metadata_bytes, 1024, 1 << 20);
  visitor.Integer("handshake_limit_ns", config.server.handshake_limit_ns, kSecond / 10, kHour);
  visitor.Integer("ping_interval_min_ns", config.server.ping_interval_min_ns, 0, kHour);
  visitor.Integer("max_ping_strikes", config.server.max_ping_strikes, 1, 1000);
  visitor.Integer("connection_idle_limit_ns", config.server.connection_idle_limit_ns, 0,
                  24 * kHour);
  visitor.Integer("connection_age_limit_ns", config.server.connection_age_limit_ns, 0, 24 * kHour);
  visitor.Integer("connection_age_grace_ns", config.server.connection_age_grace_ns, 0, kHour);
  visitor.Integer("max_arriving_bytes", config.server.max_arriving_bytes, 1 << 26,
                  int64_t{1} << 44);
  visitor.Integer("open_limit_ns", config.server.open_limit_ns, kSecond / 10, kHour);
  visitor.Integer("drain_limit_ns", config.server.drain_limit_ns, 0, kHour);
  visitor.Integer("keepalive_interval_ns", config.server.keepalive_interval_ns, kSecond, kHour);
  visitor.Integer("keepalive_timeout_ns", config.server.keepalive_timeout_ns, kSecond, kHour);
  visitor.Integer("max_http_connections", config.server.max_http_connections, 1, 4096);
  visitor.Integer("http_idle_limit_ns", config.server.http_idle_limit_ns, kSecond / 10, kHour);
  visitor.Text("http_hosts", config.server.http_hosts);
  visitor.Flag("http_control", config.server.http_control);
  visitor.Flag("http_play", config.server.http_play);
  visitor.Integer("http_max_upload_bytes", config.server.http_max_upload_bytes, 1, 2 * kGiB);

  visitor.Section("engine");
  visitor.Engine("kind", config.engine.kind);
  visitor.Integer("threads", config.engine.threads, 0, 1024);
  visitor.Integer("staging_limit_bytes", config.engine.staging_limit_bytes, 1 << 20, 1024 * kGiB);
  visitor.Integer("device", config.engine.device, 0, 1023);
  visitor.Integer("index_bytes", config.engine.index_bytes, 0, 1024 * kGiB);
  visitor.Flag("in_worker", config.engine.in_worker);
  visitor.Program("worker", config.engine.worker);
  visitor.Text("nccl", config.engine.nccl);
  visitor.Integer("worker_deadline_ns", config.engine.worker_deadline_ns, kSecond / 100, kHour);

  visitor.Section("log");
  visitor.Choice("level", config.log.level, {"trace", "debug", "info", "warn", "error", "off"});
  visitor.Choice("format", config.log.format, {"text", "json"});
  visitor.Text("audit", config.log.audit);
  visitor.Flag("audit_required", config.log.audit_required);
  visitor.Integer("max_lines_per_second", config.log.max_lines_per_second, 0, 1000000);

  auto& security = config.security;
  visitor.Section("security");
  visitor.Text("grants", security.grants);
  visitor.Text("tls_certificate", security.tls.certificate);
  visitor.Text("tls_key", security.tls.key);
  visitor.Text("tls_client_ca", security.tls.client_ca);
  visitor.Scopes("anonymous_scopes", security.anonymous_scopes, true);
  visitor.Scopes("certificate_scopes", security.certificate_scopes, false);
  visitor.Scopes("unix_scopes", security.unix_scopes, false);
  visitor.Flag("allow_plain_beyond_loopback", security.allow_plain_beyond_loopback);

  visitor.Section("state");
  visitor.Text("dir", config.state.dir);
  visitor.Integer("interval_ns", config.state.interval_ns, 0, kHour);

  auto& limits = config.limits;
  visitor.Section("limits");
  visitor.Integer("max_message_bytes", limits.max_message_bytes, 1024, 2 * kGiB - 1);
  visitor.Integer("max_entities_per_owner", limits.max_entities_per_owner, 1, kMost);
  visitor.Integer("max_layers_per_owner", limits.max_layers_per_owner, 1, kMost);
  visitor.Integer("max_bytes_per_owner", limits.max_bytes_per_owner, 1, kMost);
  visitor.Integer("max_entities", limits.max_entities, 1, kMost);
  visitor.Integer("max_layers", limits.max_layers, 1, kMost);
  visitor.Integer("max_scene_bytes", limits.max_scene_bytes, 1, kMost);
  visitor.Integer("max_vertices_per_entity", limits.max_vertices_per_entity, 1, kMost32);
  visitor.Integer("max_indices_per_entity", limits.max_indices_per_entity, 1, kMost32);
  visitor.Integer("max_id_bytes", limits.max_id_bytes, 1, 65536);
  visitor.Integer("max_operations_per_commit", limits.max_operations_per_commit, 1, kMost32);
  visitor.Integer("max_issues_per_commit", limits.max_issues_per_commit, 1, kMost32);
  visitor.Integer("max_uncommitted_bytes", limits.max_uncommitted_bytes, 1, kMost);
  visitor.Integer("max_uncommitted_bytes_total", limits.max_uncommitted_bytes_total, 1, kMost);
  visitor.Integer("max_instance_depth", limits.max_instance_depth, 1, 8);
  visitor.Real("max_coordinate_voxels", limits.max_coordinate_voxels, 1, 1073741824);
  visitor.Real("max_thickness", limits.max_thickness, 0, 1048576);
  visitor.Integer("max_sessions", limits.max_sessions, 1, kMost32);
  visitor.Integer("max_parts_per_object", limits.max_parts_per_object, 1, kMost32);
  visitor.Integer("max_clip_planes", limits.max_clip_planes, 1, gpu::kMaxClipPlanes);
  visitor.Integer("max_clip_cylinders", limits.max_clip_cylinders, 0, gpu::kMaxClipCylinders);
  visitor.Integer("max_expression_nodes", limits.max_expression_nodes, 1, 1024);
  visitor.Integer("max_expression_depth", limits.max_expression_depth, 1, 256);
  visitor.Integer("max_boundary_points", limits.max_boundary_points, 3, 65536);
  visitor.Integer("max_texture_texels", limits.max_texture_texels, 1,
                  uint64_t{gpu::kMostTextureSide} * gpu::kMostTextureSide);
  visitor.Integer("max_captures", limits.max_captures, 1, 1024);
  visitor.Integer("max_linger_ns", limits.max_linger_ns, 0, kMost);
  visitor.Integer("credit_bytes", limits.credit_bytes, 4096, kMost);
  visitor.Integer("max_memory_bytes", limits.max_memory_bytes, 1 << 20, kMost);
  visitor.Integer("max_riding_commits", limits.max_riding_commits, 1, kMost32);
  visitor.Integer("max_timed_commits", limits.max_timed_commits, 0, kMost32);
  visitor.Integer("max_present_at_horizon_ns", limits.max_present_at_horizon_ns, 0, kMost / 4);
  visitor.Integer("must_show_timeout_ns", limits.must_show_timeout_ns, 0, kHour);
  visitor.Integer("max_drop_oldest_frames", limits.max_drop_oldest_frames, 1, kMost32);
  visitor.Integer("max_local_bytes", limits.max_local_bytes, 0, kMost);
  visitor.Integer("max_asset_bytes", limits.max_asset_bytes, 1, kMost);
  visitor.Integer("max_assets_bytes", limits.max_assets_bytes, 0, kMost);
  visitor.Integer("max_assets", limits.max_assets, 1, 1 << 20);
}

// Parses "auto", "cpu" or "cuda".
absl::StatusOr<gpu::EngineKind> ParseEngineKind(std::string_view text);
std::string EngineKindText(gpu::EngineKind kind);

// Parses an address or "off".
absl::StatusOr<std::optional<Address>> ParseHttp(std::string_view text);

// Accepts what access::ParseScopes accepts, and "auto" if `auto_too` is set.
absl::Status CheckScopes(std::string_view text, bool auto_too);

// Accepts "auto", an empty text, or an absolute path with or without "unix:".
absl::Status CheckLocalSocket(std::string_view text);

}  // namespace voxeld::daemon
