#include "tools/bench/paper/column.h"

namespace voxeld::bench::paper {

absl::StatusOr<std::vector<std::unique_ptr<Column>>> CudaColumns() {
  return absl::FailedPreconditionError("this program was built without CUDA");
}

}  // namespace voxeld::bench::paper
