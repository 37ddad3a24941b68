#include "tools/bench/paper/column.h"

namespace voxeld::bench::paper {

absl::StatusOr<std::vector<std::unique_ptr<Column>>> CudaColumns() {
  return absl::FailedPreconditionError("this program was built without CUDA");
}

absl::StatusOr<std::vector<std::pair<std::string, double>>> CudaCeilings() {
  return CudaColumns().status();
}

}  // namespace voxeld::bench::paper
