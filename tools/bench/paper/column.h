// One of our columns in the paper's tables: a machine that generates, and its ceiling.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/generate/plan.h"
#include "tools/bench/paper/workload.h"

namespace voxeld::bench::paper {

class Column {
 public:
  virtual ~Column() = default;
  virtual std::string engine() const = 0;  // "cpu", "cuda", "auto"
  virtual int threads() const = 0;         // of the CPU's
  virtual bool host_copy() const = 0;      // what is made ends in the host's memory
  virtual std::string call() const = 0;    // what is timed
  virtual std::string ceiling() const = 0;

  // How many calls one Call() and one Ceiling() make, one after the other without waiting between
  // them.
  virtual int repeats() const { return 1; }

  // All that is done once: memory, and what a call does not repeat. The workload stays until the next.
  virtual absl::Status Take(const Workload& workload) = 0;
  virtual absl::Status Call() = 0;
  // The same number of bytes, written by the fastest plain means.
  virtual absl::Status Ceiling() = 0;
  virtual void Release() = 0;  // the memory
};

// On the CPU, with 1 thread and, if there are more, with all.
std::vector<std::unique_ptr<Column>> CpuColumns();
// In device memory, and with the copy. Nothing without CUDA; FailedPrecondition without a device.
absl::StatusOr<std::vector<std::unique_ptr<Column>>> CudaColumns();
// What the device and its bus do at most, in GB/s, of 1 GiB: names and rates.
absl::StatusOr<std::vector<std::pair<std::string, double>>> CudaCeilings();
// Whichever is faster, result on the host.
absl::StatusOr<std::unique_ptr<Column>> AutoColumn();

// Beyond it a call hands over chunk after chunk.
inline constexpr uint64_t kMostAtOnce = uint64_t{1} << 30;  // bytes

}  // namespace voxeld::bench::paper
