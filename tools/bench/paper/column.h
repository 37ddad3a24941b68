// One of our columns in the paper's tables: a machine that generates voxels, and its upper bound.
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
  virtual int threads() const = 0;         // of the CPU
  virtual bool host_copy() const = 0;      // whether the result ends in the host's memory
  virtual std::string call() const = 0;    // the call that is timed
  virtual std::string ceiling() const = 0;

  // Returns how many calls one Call() and one Ceiling() make, back to back without waiting in
  // between.
  virtual int repeats() const { return 1; }

  // Does everything that is done once, such as allocating memory. The workload must stay valid
  // until the next Take().
  virtual absl::Status Take(const Workload& workload) = 0;
  virtual absl::Status Call() = 0;
  // Writes the same number of bytes by the fastest plain means.
  virtual absl::Status Ceiling() = 0;
  virtual void Release() = 0;  // frees the memory
};

// Returns columns for the CPU with 1 thread and, if there are more, with all threads.
std::vector<std::unique_ptr<Column>> CpuColumns();
// Returns columns with the result in device memory and with the copy to the host. Empty without
// CUDA; FailedPrecondition without a device.
absl::StatusOr<std::vector<std::unique_ptr<Column>>> CudaColumns();
// Returns the highest rates of the device and its bus for 1 GiB, in GB/s: names and rates.
absl::StatusOr<std::vector<std::pair<std::string, double>>> CudaCeilings();
// Returns the column of the faster of the two, with the result on the host.
absl::StatusOr<std::unique_ptr<Column>> AutoColumn();

// Above this size a call delivers one chunk after another.
inline constexpr uint64_t kMostAtOnce = uint64_t{1} << 30;  // bytes

}  // namespace voxeld::bench::paper
