#include "daemon/wire/convert.h"
#include "daemon/wire/encode.h"

namespace voxeld::daemon::wire {
namespace {

void EncodeLatency(const LatencyStats& in, v1::Latency* out) {
  out->set_count(in.count);
  out->set_p50_ns(in.p50_ns);
  out->set_p99_ns(in.p99_ns);
  out->set_max_ns(in.max_ns);
}

void EncodeFigures(const DisplayFigures& in, v1::DisplayStats* out) {
  out->set_name(in.name);
  out->set_state(ToWire(in.state));
  out->set_state_reason(in.state_reason);
  out->set_engine(in.engine);
  out->set_engine_device(in.engine_device);
  out->set_engine_reason(in.engine_reason);
  out->set_engine_degraded(in.engine_degraded);
  out->set_volume_held(in.volume_held);
  out->set_engine_faults(in.engine_faults);
  out->set_engine_returns(in.engine_returns);
  out->set_engine_mismatches(in.engine_mismatches);
  out->set_takeover_last_ns(in.takeover_last_ns);
  out->set_takeover_max_ns(in.takeover_max_ns);
  out->set_redraw_last_ns(in.redraw_last_ns);
  out->set_redraw_max_ns(in.redraw_max_ns);
  out->set_return_last_ns(in.return_last_ns);
  out->set_return_max_ns(in.return_max_ns);
  for (const std::string& entity : in.pinned_entities) out->add_pinned_entities(entity);
  out->set_lit_voxels(in.lit_voxels);
  out->set_singular_drawables(in.singular_drawables);
  out->set_volumes_drawn(in.volumes_drawn);
  out->set_volumes_unchanged(in.volumes_unchanged);
  out->set_volumes_presented(in.volumes_presented);
  out->set_volumes_replaced(in.volumes_replaced);
  out->set_volumes_lost(in.volumes_lost);
  out->set_volumes_per_second(in.volumes_per_second);
  out->set_bytes_out(in.bytes_out);
  out->set_slices_sent(in.slices_sent);
  out->set_slices_resent(in.slices_resent);
  out->set_underruns(in.underruns);
  out->set_attaches(in.attaches);
  out->set_transfers_failed(in.transfers_failed);
  out->set_engine_out_of_memory(in.engine_out_of_memory);
  out->set_device_trouble(in.device_trouble);
  out->set_volumes_late(in.volumes_late);
  out->set_sweep_lock(ToWire(in.sweeps.state));
  out->set_sweep_period_ns(in.sweeps.period_ns);
  out->set_sweep_drift_ppm(in.sweeps.drift_ppm);
  out->set_sweep_jitter_ns(in.sweeps.jitter_ns);
  out->set_sweep_losses(in.sweeps.losses);
  out->set_genlock_volumes(in.genlock_volumes);
  out->set_genlock_dropped(in.genlock_dropped);
  out->set_genlock_postponed(in.genlock_postponed);
  out->set_genlock_slips(in.genlock_slips);
  out->set_light(in.light);
  out->set_power_w(in.power_w);
  out->set_power_unlimited(in.power_unlimited);
  EncodeLatency(in.commit_to_last_byte, out->mutable_commit_to_last_byte());
  EncodeLatency(in.commit_to_presented, out->mutable_commit_to_presented());
  EncodeLatency(in.assemble, out->mutable_assemble());
  EncodeLatency(in.slice, out->mutable_slice());
  EncodeLatency(in.copy, out->mutable_copy());
  out->set_packed_as_drawn(in.packed_as_drawn);
  EncodeLatency(in.waiting, out->mutable_waiting());
  EncodeLatency(in.transferring, out->mutable_transferring());
  EncodeLatency(in.showing, out->mutable_showing());
  out->set_commits_owed(in.commits_owed);
  out->set_commits_presented(in.commits_presented);
  out->set_commits_unchanged(in.commits_unchanged);
  out->set_commits_superseded(in.commits_superseded);
  out->set_commits_lost(in.commits_lost);
  out->set_commits_not_shown(in.commits_not_shown);
  out->set_commits_pending(in.commits_pending);
}

void EncodeMemory(const MemoryFigures& in, v1::MemoryUse* out) {
  out->set_limit_bytes(in.limit);
  out->set_scene_bytes(in.scene);
  out->set_staged_bytes(in.staged);
  out->set_waiting_bytes(in.waiting);
  out->set_answers_bytes(in.answers);
  out->set_owed_bytes(in.owed);
  out->set_engine_bytes(in.engines);
  out->set_local_bytes(in.local);
  out->set_arriving_bytes(in.arriving);
}

void EncodeConnections(const ListenFigures& in, v1::ConnectionStats* out) {
  out->set_open(in.open);
  out->set_accepted(in.accepted);
  out->set_refused_in_all(in.refused_in_all);
  out->set_refused_by_address(in.refused_by_address);
  out->set_cut_for_bytes(in.cut_for_bytes);
  out->set_cut_for_time(in.cut_for_time);
  out->set_cut_for_cancelling(in.cut_for_cancelling);
  out->set_accept_failures(in.accept_failures);
  out->set_probe_failures(in.probe_failures);
  out->set_unreachable(in.unreachable);
  out->set_refused_after_cut(in.refused_after_cut);
  out->set_cut_for_greeting(in.cut_for_greeting);
  out->set_cut_for_room(in.cut_for_room);
  out->set_cut_for_flooding(in.cut_for_flooding);
  out->set_calls_turned_away(in.calls_turned_away);
  out->set_calls_revoked(in.calls_revoked);
  out->set_access_trouble(in.access_trouble);
  out->set_config_trouble(in.config_trouble);
  out->set_tls_taken(in.tls_taken);
  out->set_tls_refused(in.tls_refused);
  out->set_accept_trouble(in.accept_trouble);
}

}  // namespace

void Encode(const Stats& in, v1::Stats* out) {
  out->set_time_ns(in.time_ns);
  out->set_version(in.version);
  out->set_uptime_ns(in.uptime_ns);
  out->set_sessions(in.sessions);
  out->set_owners(in.owners);
  out->set_layers(in.layers);
  out->set_entities(in.entities);
  out->set_objects(in.objects);
  out->set_scene_bytes(in.scene_bytes);
  out->set_commits_accepted(in.commits_accepted);
  out->set_commits_refused(in.commits_refused);
  out->set_operations_applied(in.operations_applied);
  out->set_operations_refused(in.operations_refused);
  out->set_bytes_in(in.bytes_in);
  out->set_outcomes_undelivered(in.outcomes_undelivered);
  out->set_client_drops(in.client_drops);
  out->set_streams_overrun(in.streams_overrun);
  out->set_volume_watches_asleep(in.volume_watches_asleep);
  out->set_frames_dropped(in.frames_dropped);
  out->set_timed_pending(in.timed_pending);
  out->set_timed_dropped(in.timed_dropped);
  out->set_must_show_timeouts(in.must_show_timeouts);
  out->set_sessions_dormant(in.sessions_dormant);
  out->set_sessions_resumed(in.sessions_resumed);
  EncodeLatency(in.sending, out->mutable_sending());
  EncodeLatency(in.decoding, out->mutable_decoding());
  EncodeLatency(in.applying, out->mutable_applying());
  EncodeMemory(in.memory, out->mutable_memory());
  EncodeConnections(in.connections, out->mutable_connections());
  v1::StateStats* state = out->mutable_state();
  state->set_durable_snapshot(in.state.durable_snapshot);
  state->set_transactions(in.state.transactions);
  state->set_rows(in.state.rows);
  state->set_bytes(in.state.bytes);
  state->set_failures(in.state.failures);
  state->set_trouble(in.state.trouble);
  v1::AssetStats* assets = out->mutable_assets();
  assets->set_count(in.assets.count);
  assets->set_bytes(in.assets.bytes);
  assets->set_uploaded(in.assets.uploaded);
  assets->set_evicted(in.assets.evicted);
  assets->set_damaged(in.assets.damaged);
  assets->set_bytes_in(in.assets.bytes_in);
  assets->set_trouble(in.assets.trouble);
  v1::ProcessStats* process = out->mutable_process();
  process->set_trouble(in.process.trouble);
  process->set_segments_refused(in.process.segments_refused);
  process->set_pauses(in.process.pauses);
  process->set_clock_steps(in.process.clock_steps);
  process->set_time_trouble(in.process.time_trouble);
  for (const DisplayFigures& display : in.displays) EncodeFigures(display, out->add_displays());
}

}  // namespace voxeld::daemon::wire
