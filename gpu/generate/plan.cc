#include "gpu/generate/plan.h"

#include <algorithm>
#include <limits>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "gpu/generate/cpu_kernel.h"

namespace voxeld::gpu::generate {
namespace {

constexpr size_t kBlock = 8192;  // segments that one worker checks at a time
constexpr char kAxes[] = "xyz";

struct Bounds {
  int64_t lo[3] = {INT64_MAX, INT64_MAX, INT64_MAX}, hi[3] = {INT64_MIN, INT64_MIN, INT64_MIN};
  void Add(const Bounds& other) {
    for (int a = 0; a < 3; ++a) {
      lo[a] = std::min(lo[a], other.lo[a]);
      hi[a] = std::max(hi[a], other.hi[a]);
    }
  }
};

struct Range {
  int64_t lo, hi;
};

Range Allowed(Output output, int axis) {
  switch (output) {
    case Output::kF32x3:
      return {-(int64_t{1} << 24), int64_t{1} << 24};
    case Output::kI16x3:
      return {INT16_MIN, INT16_MAX};
    case Output::kPacked:
      return {0, axis == 2 ? 1023 : 2047};
    case Output::kI32x3:
      break;
  }
  return {INT32_MIN, INT32_MAX};
}

const char* NameOf(Output output) {
  switch (output) {
    case Output::kF32x3:
      return "f32x3";
    case Output::kI16x3:
      return "i16x3";
    case Output::kPacked:
      return "packed";
    case Output::kI32x3:
      break;
  }
  return "i32x3";
}

bool InRange(double voxels) {
  constexpr double kMost = static_cast<double>(kMostCoordinate * kUnits);
  const double units = RoundedUnits(voxels);
  return units >= -kMost && units <= kMost;  // false for NaN
}

// Returns an error that describes the first invalid value of a segment, if any.
template <typename T>
absl::Status Check(const Segment<T>& segment, size_t index, Sampling sampling) {
  for (size_t a = 0; a < 3; ++a) {
    for (const auto& [name, v] :
         {std::pair("start", segment.start[a]), std::pair("end", segment.end[a])}) {
      if (InRange(static_cast<double>(v))) continue;
      return absl::InvalidArgumentError(
          absl::StrFormat("segments[%d].%s.%c is %.17g; a coordinate is a number within ±2^30 (%d)",
                          index, name, kAxes[a], static_cast<double>(v), kMostCoordinate));
    }
  }
  const int64_t steps = StepsOf(ToFixed(segment), sampling);
  if (steps <= kMostSteps) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrFormat(
      "segments[%d] has %d steps; at most 2^30 (%d) are allowed", index, steps, kMostSteps));
}

// Counts the voxels of segments[begin, end) into counts. Returns false if one of the segments is
// invalid.
template <typename T>
bool Count(std::span<const Segment<T>> segments, Sampling sampling, size_t begin, size_t end,
           uint64_t* counts, Bounds& bounds) {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  UnitBounds units = {{kFar, kFar, kFar}, {-kFar, -kFar, -kFar}};
  CountVoxels(segments, sampling, begin, end, counts, units);
  if (!units.all_within) return false;
  for (size_t i = begin; i < end; ++i) {
    if (counts[i] == 0)
      counts[i] = static_cast<uint64_t>(StepsOf(ToFixed(segments[i]), sampling)) + 1;
    if (counts[i] > static_cast<uint64_t>(kMostSteps) + 1) return false;
  }
  for (int a = 0; a < 3; ++a) {
    bounds.lo[a] = CellOf(static_cast<int64_t>(units.lo[a]));
    bounds.hi[a] = CellOf(static_cast<int64_t>(units.hi[a]));
  }
  return true;
}

absl::Status CheckBounds(const Bounds& bounds, Output output) {
  for (int a = 0; a < 3; ++a) {
    const Range range = Allowed(output, a);
    if (bounds.lo[a] >= range.lo && bounds.hi[a] <= range.hi) continue;
    return absl::InvalidArgumentError(
        absl::StrFormat("the voxels' %c goes from %d to %d; %s holds %d to %d", kAxes[a],
                        bounds.lo[a], bounds.hi[a], NameOf(output), range.lo, range.hi));
  }
  return absl::OkStatus();
}

template <typename T>
absl::StatusOr<Plan> MakePlanOf(std::span<const Segment<T>> segments, Format format,
                                Executor& executor) {
  Plan plan;
  plan.extent.format = format;
  // At first, offsets[i + 1] holds segment i's count.
  plan.offsets.resize(segments.size() + 1);
  uint64_t* const counts = plan.offsets.data() + 1;
  const size_t blocks = (segments.size() + kBlock - 1) / kBlock;
  std::vector<Bounds> bounds(blocks);
  std::vector<uint8_t> wrong(blocks);
  std::vector<uint64_t> sums(blocks + 1);
  const auto count = [&](size_t block, int) {
    const size_t begin = block * kBlock, end = std::min(begin + kBlock, segments.size());
    wrong[block] = !Count(segments, format.sampling, begin, end, counts, bounds[block]);
    if (wrong[block] != 0) return;
    for (size_t i = begin; i < end; ++i) sums[block + 1] += counts[i];
  };
  const auto place = [&](size_t block, int) {
    const size_t begin = block * kBlock, end = std::min(begin + kBlock, segments.size());
    uint64_t at = sums[block];
    for (size_t i = begin; i < end; ++i) counts[i] = at += counts[i];
  };
  if (blocks == 1) {
    count(0, 0);
  } else {
    executor.For(blocks, 1, count);
  }
  Bounds all;
  for (size_t block = 0; block < blocks; ++block) {
    for (size_t i = block * kBlock; wrong[block] != 0; ++i) {
      if (absl::Status status = Check(segments[i], i, format.sampling); !status.ok()) return status;
    }
    all.Add(bounds[block]);
    sums[block + 1] += sums[block];
  }
  if (blocks == 0) return plan;
  if (sums[blocks] > kMostVoxels) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%d segments have %d voxels; at most 2^40 (%d) are allowed at once: split the batch",
        segments.size(), sums[blocks], kMostVoxels));
  }
  if (absl::Status status = CheckBounds(all, format.output); !status.ok()) return status;
  if (blocks == 1) {
    place(0, 0);
  } else {
    executor.For(blocks, 1, place);
  }
  plan.extent.voxels = sums[blocks];
  plan.extent.lo = {static_cast<int32_t>(all.lo[0]), static_cast<int32_t>(all.lo[1]),
                    static_cast<int32_t>(all.lo[2])};
  plan.extent.hi = {static_cast<int32_t>(all.hi[0]), static_cast<int32_t>(all.hi[1]),
                    static_cast<int32_t>(all.hi[2])};
  return plan;
}

}  // namespace

absl::StatusOr<Plan> MakePlan(const Batch& batch, Format format, Executor& executor) {
  if (batch.size() > kMostSegments) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%d segments; at most 2^27 (%d) are allowed at once", batch.size(), kMostSegments));
  }
  return batch.With([&](const auto& segments) { return MakePlanOf(segments, format, executor); });
}

absl::Status CheckPlan(const Plan& plan, const Batch& batch) {
  if (plan.offsets.size() == batch.size() + 1) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrFormat("the plan is of %d segments; the batch has %d",
                                                    plan.offsets.size() - 1, batch.size()));
}

absl::Status CheckForm(const Extent& extent, Format format) {
  if (format.sampling != extent.format.sampling) {
    return absl::InvalidArgumentError(
        "the plan was made for another sampling: prepare the batch anew");
  }
  if (extent.voxels == 0) return absl::OkStatus();
  return CheckBounds(
      {{extent.lo.x, extent.lo.y, extent.lo.z}, {extent.hi.x, extent.hi.y, extent.hi.z}},
      format.output);
}

absl::Status CheckRoom(const Extent& extent, Format format, size_t bytes) {
  if (absl::Status status = CheckForm(extent, format); !status.ok()) return status;
  const size_t each = BytesOf(format.output);
  if (extent.voxels * each <= bytes) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrFormat("the output has %d bytes; %d voxels of %d bytes (%s) need %d", bytes,
                      extent.voxels, each, NameOf(format.output), extent.voxels * each));
}

}  // namespace voxeld::gpu::generate
