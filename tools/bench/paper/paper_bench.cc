#include "tools/bench/paper/paper_bench.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "gpu/generate/cpu_kernel.h"
#include "tools/bench/paper/column.h"

namespace voxeld::bench::paper {
namespace {

using nlohmann::json;

constexpr int kLeastCalls = 3, kMostCalls = 2000;
constexpr double kShortSeconds = 0.002;

double Now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const size_t n = values.size();
  return n % 2 == 1 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
}

// Times a call. A short call is timed directly after an untimed one, because the work in between
// displaced the caches.
absl::StatusOr<double> Timed(Column& column, absl::Status (Column::*what)(), bool is_short) {
  if (is_short) {
    if (absl::Status status = (column.*what)(); !status.ok()) return status;
  }
  const double begin = Now();
  if (absl::Status status = (column.*what)(); !status.ok()) return status;
  return (Now() - begin) / column.repeats();
}

struct Figures {
  std::vector<double> calls, ceilings;  // seconds, alternately
};

absl::StatusOr<Figures> Measure(Column& column, double seconds,
                                const std::function<bool()>& go_on) {
  Figures out;
  double sum = 0;
  for (int i = 0; i <= kMostCalls && (i <= kLeastCalls || sum < seconds); ++i) {
    if (!go_on()) return absl::CancelledError("interrupted");
    const bool is_short = i > 0 && sum < i * kShortSeconds;
    const absl::StatusOr<double> call = Timed(column, &Column::Call, is_short);
    if (!call.ok()) return call.status();
    double ceiling = 0;
    if (!column.ceiling().empty()) {
      const absl::StatusOr<double> timed = Timed(column, &Column::Ceiling, is_short);
      if (!timed.ok()) return timed.status();
      ceiling = *timed;
    }
    if (i == 0) continue;  // the first round touches memory and wakes idle parts
    out.calls.push_back(*call);
    out.ceilings.push_back(ceiling);
    sum += *call * column.repeats();
  }
  return out;
}

const char* NameOf(gpu::generate::Output output) {
  return output == gpu::generate::Output::kPacked ? "packed" : "i32x3";
}

json RowOf(const Workload& workload, const Column& column, const Figures& figures) {
  const double voxels = static_cast<double>(workload.voxels);
  const double seconds = Median(figures.calls);
  json row = {{"table", workload.table},
              {"segments", workload.segments.size()},
              {"voxels", workload.voxels},
              {"engine", column.engine()},
              {"threads", column.threads()},
              {"output", NameOf(workload.format.output)},
              {"host_copy", column.host_copy()},
              {"ms", seconds * 1e3},
              {"ms_least", *std::min_element(figures.calls.begin(), figures.calls.end()) * 1e3},
              {"ms_greatest", *std::max_element(figures.calls.begin(), figures.calls.end()) * 1e3},
              {"calls", figures.calls.size()},
              {"mvoxel_per_s", voxels / seconds / 1e6},
              {"paper_mvoxel_per_s", nullptr},
              {"ceiling_mvoxel_per_s", nullptr},
              {"ceiling_ratio", nullptr},
              {"calls_together", column.repeats()},
              {"call", column.call()},
              {"ceiling", column.ceiling()}};
  if (workload.paper_ms.has_value() && column.host_copy()) {
    const auto best = std::min_element(workload.paper_ms->begin(), workload.paper_ms->end());
    const Hardware& hardware = kHardware[static_cast<size_t>(best - workload.paper_ms->begin())];
    row["paper_mvoxel_per_s"] = voxels / *best / 1e3;
    row["paper_hardware"] = absl::StrCat(std::string(hardware.name), " (", hardware.year, ")");
  }
  if (!column.ceiling().empty()) {
    row["ceiling_mvoxel_per_s"] = voxels / Median(figures.ceilings) / 1e6;
    std::vector<double> ratios;
    for (size_t i = 0; i < figures.calls.size(); ++i)
      ratios.push_back(figures.ceilings[i] / figures.calls[i]);
    row["ceiling_ratio"] = Median(ratios);
  }
  return row;
}

bool Has(const std::vector<std::string>& names, const std::string& name) {
  return names.empty() || std::find(names.begin(), names.end(), name) != names.end();
}

std::vector<std::function<Workload()>> Workloads(const PaperOptions& options) {
  std::vector<std::function<Workload()>> out;
  const uint64_t seed = options.seed;
  const auto add_rows = [&](const std::string& table, const auto& rows, uint64_t segments) {
    for (const Row& row : rows) {
      out.push_back([=] {
        Workload workload = OneLength(table, segments, row.voxels, seed);
        workload.paper_ms = row.ms;
        return workload;
      });
    }
  };
  if (Has(options.tables, "2")) add_rows("2", kTable2, 1);
  if (Has(options.tables, "3")) add_rows("3", kTable3, kSegments);
  if (Has(options.tables, "4")) {
    const uint64_t voxels = options.voxels;
    out.push_back([=] {
      Workload workload = Different(voxels, seed);
      if (voxels == kGigavoxel) workload.paper_ms = kTable4;
      return workload;
    });
    out.push_back([=] { return Skewed(voxels, seed); });
    out.push_back([=] { return Packed(voxels, seed); });
  }
  return out;
}

absl::StatusOr<std::vector<std::unique_ptr<Column>>> Columns(
    const PaperOptions& options, const std::function<void(const std::string&)>& progress) {
  std::vector<std::unique_ptr<Column>> columns;
  if (Has(options.engines, "cpu")) columns = CpuColumns();
  if (Has(options.engines, "cuda")) {
    auto cuda = CudaColumns();
    // A missing CUDA is an error only if engines were named.
    if (!cuda.ok() && !options.engines.empty()) return cuda.status();
    if (!cuda.ok()) progress(absl::StrCat("no CUDA: ", std::string(cuda.status().message())));
    if (cuda.ok()) std::move(cuda->begin(), cuda->end(), std::back_inserter(columns));
  }
  if (Has(options.engines, "auto")) {
    auto chosen = AutoColumn();
    if (!chosen.ok()) return chosen.status();
    columns.push_back(*std::move(chosen));
  }
  return columns;
}

std::string ColumnName(const json& row) {
  const std::string engine = row["engine"];
  if (engine == "cpu")
    return absl::StrCat("CPU, ", int(row["threads"]), row["threads"] == 1 ? " thread" : " threads");
  if (engine == "auto") return "auto";
  return row["host_copy"] ? "CUDA, to the host" : "CUDA, on the device";
}

// Formats milliseconds with three significant digits.
std::string Ms(double ms) {
  return ms < 1 ? absl::StrFormat("%.3g", ms) : absl::StrFormat("%.*f", ms < 100 ? 2 : 0, ms);
}

}  // namespace

absl::StatusOr<json> MeasurePaper(const PaperOptions& options,
                                  const std::function<void(const std::string&)>& progress,
                                  const std::function<bool()>& go_on) {
  auto columns = Columns(options, progress);
  if (!columns.ok()) return columns.status();
  json report = {
      {"rows", json::array()}, {"seed", options.seed}, {"vectors", gpu::generate::VectorTarget()}};
  const bool has_cuda = std::any_of(columns->begin(), columns->end(),
                                    [](const auto& c) { return c->engine() == "cuda"; });
  report["ceilings_gb_per_s"] = json::object();
  if (has_cuda) {
    const auto ceilings = CudaCeilings();
    if (!ceilings.ok()) return ceilings.status();
    for (const auto& [name, rate] : *ceilings) {
      report["ceilings_gb_per_s"][name] = rate;
      progress(absl::StrFormat("%s: %.0f GB/s", name, rate));
    }
  }
  for (const auto& make : Workloads(options)) {
    const Workload workload = make();
    for (const std::unique_ptr<Column>& column : *columns) {
      absl::Status taken = column->Take(workload);
      if (!taken.ok()) return taken;
      const absl::StatusOr<Figures> figures = Measure(*column, options.seconds, go_on);
      column->Release();
      if (!figures.ok()) return figures.status();
      report["rows"].push_back(RowOf(workload, *column, *figures));
      const json& row = report["rows"].back();
      progress(absl::StrFormat(
          "table %s, %d segments, %d voxels, %s: %s ms, %.0f Mvoxel/s%s", workload.table,
          workload.segments.size(), workload.voxels, ColumnName(row), Ms(row["ms"]),
          double(row["mvoxel_per_s"]),
          row["ceiling_ratio"].is_null()
              ? ""
              : absl::StrFormat(", %.2f of its ceiling", double(row["ceiling_ratio"]))));
    }
  }
  return report;
}

std::string PaperText(const json& report) {
  // Rows of one batch are printed together.
  std::string out = absl::StrFormat("seed %d; vectors: %s\n", uint64_t(report["seed"]),
                                    std::string(report["vectors"]));
  if (report.contains("ceilings_gb_per_s")) {
    for (const auto& [name, rate] : report["ceilings_gb_per_s"].items()) {
      absl::StrAppendFormat(&out, "%s: %.0f GB/s\n", name, double(rate));
    }
  }
  std::string batch;
  for (const json& row : report["rows"]) {
    const std::string here = absl::StrFormat("Table %s: %d segments, %d voxels, %s",
                                             std::string(row["table"]), uint64_t(row["segments"]),
                                             uint64_t(row["voxels"]), std::string(row["output"]));
    if (here != batch) {
      batch = here;
      absl::StrAppend(&out, "\n", batch, "\n");
      const std::string table = row["table"];
      const std::array<double, kMachines>* ms = nullptr;
      const uint64_t each = uint64_t(row["voxels"]) / uint64_t(row["segments"]);
      const auto find = [&](const auto& rows) {
        for (const Row& known : rows) {
          if (known.voxels == each) ms = &known.ms;
        }
      };
      if (table == "2") find(kTable2);
      if (table == "3") find(kTable3);
      if (table == "4" && row["voxels"] == kGigavoxel) ms = &kTable4;
      for (size_t i = 0; ms != nullptr && i < kMachines; ++i) {
        absl::StrAppendFormat(
            &out, "  %-26s %10s ms %12.1f Mvoxel/s\n",
            absl::StrCat(std::string(kHardware[i].name), " (", kHardware[i].year, ")"),
            Ms((*ms)[i]), double(row["voxels"]) / (*ms)[i] / 1e3);
      }
    }
    absl::StrAppendFormat(&out, "  %-26s %10s ms %12.1f Mvoxel/s", ColumnName(row), Ms(row["ms"]),
                          double(row["mvoxel_per_s"]));
    if (!row["ceiling_ratio"].is_null()) {
      absl::StrAppendFormat(&out, "  %.3f of %s", double(row["ceiling_ratio"]),
                            std::string(row["ceiling"]));
    }
    if (!row["paper_mvoxel_per_s"].is_null()) {
      absl::StrAppendFormat(&out, "  %.0f x the paper's %s",
                            double(row["mvoxel_per_s"]) / double(row["paper_mvoxel_per_s"]),
                            row.value("paper_hardware", "best"));
    }
    absl::StrAppend(&out, "\n");
  }
  return out;
}

}  // namespace voxeld::bench::paper
