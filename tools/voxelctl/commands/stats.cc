#include <cmath>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/strip.h"
#include "common/text/printable.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/text/proto_json.h"
#include "tools/voxelctl/text/table.h"
#include "tools/voxelctl/text/troubles.h"

namespace voxeld::voxelctl {
namespace {

using Align = Table::Align;

std::string Server(const v1::Stats& s) {
  return absl::StrCat(
      "voxeld ", EscapeForTerminal(s.version()), ", up ", Duration(s.uptime_ns()), ": ",
      Counted(s.sessions(), "session"), ", ", Counted(s.layers(), "layer"), ", ",
      Counted(s.entities(), "entity", "entities"), ", ", Counted(s.objects(), "object"), ", ",
      Bytes(s.scene_bytes()), " of scene\ncommits ", Grouped(s.commits_accepted()), " accepted, ",
      Grouped(s.commits_refused()), " refused; operations ", Grouped(s.operations_applied()),
      " applied, ", Grouped(s.operations_refused()), " refused; ", Bytes(s.bytes_in()), " in\n");
}

std::string Engine(const v1::DisplayStats& d) {
  return d.engine_device().empty() ? d.engine()
                                   : absl::StrCat(d.engine(), " (", d.engine_device(), ")");
}

std::string SweepText(const v1::DisplayStats& d) {
  std::string text =
      absl::AsciiStrToLower(absl::StripPrefix(v1::SweepLock_Name(d.sweep_lock()), "SWEEP_LOCK_"));
  if (d.sweep_lock() == v1::SWEEP_LOCK_LOCKED) {
    absl::StrAppendFormat(&text, ", %+.0f ppm", std::round(d.sweep_drift_ppm()) + 0.0);  // no −0
  }
  return text;
}

std::string Full(const v1::Stats& stats) {
  std::vector<Table::Column> columns = {{"DISPLAY"}};
  for (const v1::DisplayStats& d : stats.displays())
    columns.push_back({EscapeForTerminal(d.name()), Align::kRight});
  Table table(columns);
  const auto row = [&](const char* name, const auto& value) {
    std::vector<std::string> cells = {name};
    for (const v1::DisplayStats& d : stats.displays()) cells.push_back(value(d));
    table.Add(std::move(cells));
  };
  using D = v1::DisplayStats;
  row("state", [](const D& d) {
    return absl::AsciiStrToLower(
        absl::StripPrefix(v1::DisplayState_Name(d.state()), "DISPLAY_STATE_"));
  });
  row("engine", [](const D& d) { return Engine(d); });
  row("voxels lit", [](const D& d) { return Grouped(d.lit_voxels()); });
  row("volumes/s", [](const D& d) { return absl::StrFormat("%.1f", d.volumes_per_second()); });
  row("volumes drawn", [](const D& d) { return Grouped(d.volumes_drawn()); });
  row("  unchanged", [](const D& d) { return Grouped(d.volumes_unchanged()); });
  row("  presented", [](const D& d) { return Grouped(d.volumes_presented()); });
  row("  replaced", [](const D& d) { return Grouped(d.volumes_replaced()); });
  row("  lost", [](const D& d) { return Grouped(d.volumes_lost()); });
  row("commits owed", [](const D& d) { return Grouped(d.commits_owed()); });
  row("  presented", [](const D& d) { return Grouped(d.commits_presented()); });
  row("  unchanged", [](const D& d) { return Grouped(d.commits_unchanged()); });
  row("  superseded", [](const D& d) { return Grouped(d.commits_superseded()); });
  row("  lost", [](const D& d) { return Grouped(d.commits_lost()); });
  row("  not shown", [](const D& d) { return Grouped(d.commits_not_shown()); });
  row("  pending", [](const D& d) { return Grouped(d.commits_pending()); });
  row("commit to last byte p50",
      [](const D& d) { return Duration(d.commit_to_last_byte().p50_ns()); });
  row("  p99", [](const D& d) { return Duration(d.commit_to_last_byte().p99_ns()); });
  row("commit to presented p50",
      [](const D& d) { return Duration(d.commit_to_presented().p50_ns()); });
  row("  p99", [](const D& d) { return Duration(d.commit_to_presented().p99_ns()); });
  row("assemble p50", [](const D& d) { return Duration(d.assemble().p50_ns()); });
  row("slice p50", [](const D& d) {
    return d.packed_as_drawn() ? std::string("as drawn") : Duration(d.slice().p50_ns());
  });
  row("copy p50", [](const D& d) { return Duration(d.copy().p50_ns()); });
  row("bytes out", [](const D& d) { return Bytes(d.bytes_out()); });
  row("slices sent", [](const D& d) { return Grouped(d.slices_sent()); });
  row("  again", [](const D& d) { return Grouped(d.slices_resent()); });
  row("underruns", [](const D& d) { return Grouped(d.underruns()); });
  row("failed transfers", [](const D& d) { return Grouped(d.transfers_failed()); });
  row("late", [](const D& d) { return Grouped(d.volumes_late()); });
  row("sweeps", [](const D& d) { return SweepText(d); });
  row("  lock lost", [](const D& d) { return Grouped(d.sweep_losses()); });
  row("genlock", [](const D& d) { return Grouped(d.genlock_volumes()); });
  row("  dropped", [](const D& d) { return Grouped(d.genlock_dropped()); });
  row("  put off", [](const D& d) { return Grouped(d.genlock_postponed()); });
  row("  slips", [](const D& d) { return Grouped(d.genlock_slips()); });
  row("light", [](const D& d) { return absl::StrFormat("%.0f %%", d.light() * 100); });
  row("power", [](const D& d) {
    return d.power_unlimited() ? std::string("limit not kept")
           : d.power_w() > 0   ? absl::StrFormat("%.3g W", d.power_w())
                               : std::string("-");
  });
  row("engine faults", [](const D& d) { return Grouped(d.engine_faults()); });
  row("  out of memory", [](const D& d) { return Grouped(d.engine_out_of_memory()); });
  row("  returns", [](const D& d) { return Grouped(d.engine_returns()); });
  std::string text = Server(stats);
  for (const std::string& trouble : Troubles(stats)) absl::StrAppend(&text, trouble, "\n");
  absl::StrAppend(&text, "\n", table.Text());
  for (const D& d : stats.displays()) {
    if (d.state() != v1::DISPLAY_STATE_SHOWING) {
      absl::StrAppend(&text, "\n", EscapeForTerminal(d.name()), ": ",
                      EscapeForTerminal(d.state_reason()), "\n");
    }
    if (!d.engine_degraded().empty()) {
      absl::StrAppend(&text, "\n", EscapeForTerminal(d.name()), ": ",
                      d.volume_held() ? "the last volume is held" : "degraded", ": ",
                      EscapeForTerminal(d.engine_degraded()), "\n");
    }
    for (const std::string& entity : d.pinned_entities()) {
      absl::StrAppend(&text, "  drawn by the CPU: ", EscapeForTerminal(entity), "\n");
    }
  }
  return text;
}

std::string Brief(const v1::Stats& stats) {
  Table table({{"DISPLAY"},
               {"VOLUMES/s", Align::kRight},
               {"VOXELS LIT", Align::kRight},
               {"PRESENTED", Align::kRight},
               {"SUPERSEDED", Align::kRight},
               {"LOST", Align::kRight},
               {"p50", Align::kRight},
               {"p99", Align::kRight},
               {"BYTES OUT", Align::kRight}});
  for (const v1::DisplayStats& d : stats.displays()) {
    table.Add({d.name(), absl::StrFormat("%.1f", d.volumes_per_second()), Grouped(d.lit_voxels()),
               Grouped(d.commits_presented()), Grouped(d.commits_superseded()),
               Grouped(d.commits_lost()), Duration(d.commit_to_last_byte().p50_ns()),
               Duration(d.commit_to_last_byte().p99_ns()), Bytes(d.bytes_out())});
  }
  return table.Text();
}

}  // namespace

absl::Status ShowStats(const StatsOptions& options, Connection& connection, Interrupt& interrupt,
                       Console& console) {
  v1::WatchStatsRequest request;
  request.set_once(!options.watch);
  if (options.watch) request.set_interval_ns(std::llround(options.interval_s * 1e9));
  bool any = false;
  absl::Status status = connection.WatchStats(request, [&](const v1::Stats& stats) {
    any = true;
    if (console.json())
      return console.Data(JsonText(ToJson(stats), options.watch)) && options.watch;
    return console.Data(options.watch ? absl::StrCat(Brief(stats), "\n") : Full(stats)) &&
           options.watch;
  });
  // Ctrl-C is the normal end of a watch.
  if (options.watch && any && interrupt.requested()) return absl::OkStatus();
  return status;
}

}  // namespace voxeld::voxelctl
