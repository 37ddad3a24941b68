#include "gpu/generate/cost_model.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <span>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"

namespace voxeld::gpu::generate {
namespace {

// Increase the number when the generators' costs change: files with an older one are measured
// again.
constexpr std::string_view kHeader = "voxeld generator costs 1";
constexpr double kSecondsAPoint = 0.005;
constexpr int kLeastCalls = 3;
constexpr uint64_t kMostMeasured = 8 << 20;  // voxels

// Returns the number of voxels, and the least of several durations in seconds: other work of the
// machine only adds to them.
absl::StatusOr<std::pair<double, double>> SecondsOf(Generator& generator,
                                                    const std::vector<Segment<float>>& segments,
                                                    Sampling sampling, std::span<std::byte> out) {
  double least = 0, sum = 0, voxels = 0;
  for (int call = 0; call < kLeastCalls + 1 || sum < kSecondsAPoint; ++call) {
    const auto begin = std::chrono::steady_clock::now();
    const absl::StatusOr<Plan> plan = generator.Prepare(segments, {sampling, Output::kI32x3});
    if (!plan.ok()) return plan.status();
    voxels = static_cast<double>(plan->voxels());
    if (absl::Status status = generator.Generate(segments, *plan, {sampling, Output::kI32x3}, out);
        !status.ok())
      return status;
    const double seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    if (call == 0) continue;  // the first call starts idle threads and devices
    least = call == 1 ? seconds : std::min(least, seconds);
    sum += seconds;
  }
  return std::pair(voxels, std::max(least, 1e-9));
}

std::vector<Segment<float>> Segments(size_t count, uint64_t voxels) {
  const float length = static_cast<float>(voxels - 1);
  // The direction is neither along an axis nor between whole voxels; two thirds of the length are
  // along x.
  constexpr float kX = 2.0F / 3, kY = 2.0F / 3, kZ = 1.0F / 3;
  return std::vector<Segment<float>>(
      count, {{0.3F, 0.4F, 0.6F}, {0.3F + length * kX, 0.4F + length * kY, 0.6F + length * kZ}});
}

}  // namespace

double CostCurve::SecondsFor(uint64_t voxels, uint64_t segments) const {
  const double v = std::max<double>(1, static_cast<double>(voxels));
  size_t i = 1;
  while (i + 1 < points.size() && points[i].first < v) ++i;
  const auto& [v0, s0] = points[i - 1];
  const auto& [v1, s1] = points[i];
  // A batch below the least measured size costs no less.
  const double at = std::max(0.0, std::log(v / v0) / std::log(v1 / v0));
  return std::exp(std::log(s0) + at * std::log(s1 / s0)) +
         seconds_a_segment * static_cast<double>(segments > 0 ? segments - 1 : 0);
}

absl::StatusOr<CostCurve> MeasureCost(Generator& generator, Sampling sampling) {
  CostCurve curve;
  // COVER crosses more faces than a segment has steps, here at most twice as many.
  const size_t bytes = 2 * kMostMeasured * BytesOf(Output::kI32x3);
  absl::StatusOr<HostMemory> memory = generator.Allocate(bytes);
  if (!memory.ok()) return memory.status();
  const std::span<std::byte> out(memory->get(), bytes);
  std::memset(out.data(), 1, out.size());
  for (uint64_t voxels = 512; voxels <= kMostMeasured; voxels *= 2) {
    const auto measured = SecondsOf(generator, Segments(1, voxels), sampling, out);
    if (!measured.ok()) return measured.status();
    curve.points.push_back(*measured);
  }
  constexpr uint64_t kMany = 65536, kShort = 20;
  const auto many = SecondsOf(generator, Segments(kMany, kShort), sampling, out);
  if (!many.ok()) return many.status();
  const auto& [voxels, seconds] = *many;
  curve.seconds_a_segment =
      std::max(0.0, (seconds - curve.SecondsFor(static_cast<uint64_t>(voxels), 1)) /
                        static_cast<double>(kMany - 1));
  return curve;
}

std::string ToText(std::string_view machine,
                   const std::vector<std::pair<std::string, CostCurve>>& curves) {
  std::string text = absl::StrCat(std::string(kHeader), "\n", std::string(machine), "\n");
  for (const auto& [name, curve] : curves) {
    absl::StrAppend(&text, name, "\t", absl::StrFormat("%.9g", curve.seconds_a_segment));
    for (const auto& [voxels, seconds] : curve.points)
      absl::StrAppendFormat(&text, "\t%.9g %.9g", voxels, seconds);
    absl::StrAppend(&text, "\n");
  }
  return text;
}

absl::StatusOr<std::vector<CostCurve>> FromText(std::string_view text, std::string_view machine,
                                                const std::vector<std::string>& names) {
  const std::vector<std::string> lines =
      absl::StrSplit(absl::string_view(text.data(), text.size()), '\n');
  if (lines.empty() || lines[0] != kHeader)
    return absl::DataLossError("not a file of generator costs");
  if (lines.size() < names.size() + 2 || lines[1] != machine) {
    return absl::NotFoundError("the generator costs are of another machine");
  }
  std::vector<CostCurve> curves;
  for (size_t i = 0; i < names.size(); ++i) {
    const std::vector<std::string> fields = absl::StrSplit(lines[i + 2], '\t');
    if (fields[0] != names[i])
      return absl::NotFoundError("the generator costs are of other generators");
    CostCurve curve;
    bool good = fields.size() >= 4 && absl::SimpleAtod(fields[1], &curve.seconds_a_segment) &&
                curve.seconds_a_segment >= 0;
    for (size_t f = 2; good && f < fields.size(); ++f) {
      const std::vector<std::string> pair = absl::StrSplit(fields[f], ' ');
      double voxels = 0, seconds = 0;
      good = pair.size() == 2 && absl::SimpleAtod(pair[0], &voxels) &&
             absl::SimpleAtod(pair[1], &seconds) &&
             voxels > (curve.points.empty() ? 0 : curve.points.back().first) && seconds > 0 &&
             std::isfinite(seconds);
      if (good) curve.points.emplace_back(voxels, seconds);
    }
    if (!good)
      return absl::DataLossError(
          absl::StrCat("line ", i + 3, " of the generator costs cannot be read"));
    curves.push_back(std::move(curve));
  }
  return curves;
}

}  // namespace voxeld::gpu::generate
