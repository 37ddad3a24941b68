#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "tools/bench/frame/frame_bench.h"

namespace voxeld::bench::frame {
namespace {

using nlohmann::json;

std::string SpreadText(const json& spread) {
  return absl::StrFormat("%.4g ms (%.4g to %.4g)", double(spread["median"]),
                         double(spread["least"]), double(spread["greatest"]));
}

}  // namespace

std::string MachineText(const json& row) {
  if (row["engine"] == "cuda") return row["device"];
  return absl::StrFormat("CPU, %d thread%s", int(row["threads"]), row["threads"] == 1 ? "" : "s");
}

std::string RowText(const json& row) {
  return absl::StrFormat("%s, %s: %s %s, host %s, %.3g Gvoxel/s, %.3g of its ceiling's time",
                         std::string(row["scene"]), MachineText(row),
                         row["slicing_only"] ? "slicing" : "device", SpreadText(row["device_ms"]),
                         SpreadText(row["host_ms"]), double(row["gvoxel_per_s"]),
                         double(row["ratio"]));
}

std::string FrameText(const json& report) {
  std::string out;
  for (const json& row : report["rows"]) {
    absl::StrAppendFormat(&out, "%s, %s: %d voxels %s\n", std::string(row["scene"]),
                          MachineText(row), uint64_t(row["voxels"]),
                          std::string(row["voxels_are"]));
    absl::StrAppendFormat(&out, "  %-8s %s, %.4g Gvoxel/s\n",
                          row["slicing_only"] ? "slicing" : "device", SpreadText(row["device_ms"]),
                          double(row["gvoxel_per_s"]));
    absl::StrAppendFormat(&out, "  %-8s %s, %.4g Gvoxel/s\n", "host", SpreadText(row["host_ms"]),
                          double(row["host_gvoxel_per_s"]));
    absl::StrAppendFormat(&out, "  %-8s %d of %d\n", "tiles", uint64_t(row["tiles"]["drawn"]),
                          uint64_t(row["tiles"]["most"]));
    if (!row["packed_as_drawn"]) out += "  drawn into tiles, and sliced from there\n";
    absl::StrAppendFormat(&out, "  %-8s %s\n", "apply", SpreadText(row["apply_ms"]));
    absl::StrAppendFormat(&out, "  ceiling  %.4g ms: %s; %s takes %.3g times as long\n",
                          double(row["ceiling"]["ms"]), std::string(row["ceiling"]["name"]),
                          row["slicing_only"] ? "slicing" : "host", double(row["ratio"]));
    for (const json& peer : row["peers"]) {
      absl::StrAppendFormat(&out, "  peer     %.4g ms: %s; device takes %.3g times as long\n",
                            double(peer["ms"]), std::string(peer["name"]), double(peer["ratio"]));
    }
    if (row.contains("one_gpu")) {
      const char* const what = row["engine"] == "cuda" ? "GPU" : "process";
      const char* const clock = row["slicing_only"] ? "slicing" : "device";
      const int count = int(row["gpus"]);
      absl::StrAppendFormat(&out, "  one %s: %s %s, host %s, apply %s\n", what, clock,
                            SpreadText(row["one_gpu"]["device_ms"]),
                            SpreadText(row["one_gpu"]["host_ms"]),
                            SpreadText(row["one_gpu"]["apply_ms"]));
      absl::StrAppendFormat(
          &out, "  %d %s: %s %.3g times as fast, host %.3g; the same bytes\n", count,
          count == 1 ? what : absl::StrCat(what, row["engine"] == "cuda" ? "s" : "es"), clock,
          double(row["speedup"]["device"]), double(row["speedup"]["host"]));
      absl::StrAppendFormat(&out, "  engine   %s\n", std::string(row["reason"]));
    }
    out += "  shares  ";
    for (const auto& [stage, share] : row["stages"].items()) {
      absl::StrAppendFormat(&out, " %s %.1f %%", stage, 100 * double(share));
    }
    out += "\n";
    if (!row["volumes_per_s"].is_null()) {
      absl::StrAppendFormat(&out, "  %.3g volumes a second; the display shows %.3g\n",
                            double(row["volumes_per_s"]["reached"]),
                            double(row["volumes_per_s"]["asked"]));
    }
  }
  return out;
}

}  // namespace voxeld::bench::frame
