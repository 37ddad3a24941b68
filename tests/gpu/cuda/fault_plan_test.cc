#include <gtest/gtest.h>

#include "gpu/cuda/api.h"

namespace voxeld::gpu::cuda {
namespace {

TEST(FaultPlan, NamesOneCallOrAllFromIt) {
  const FaultPlan none;
  const FaultPlan once = {3, cudaErrorMemoryAllocation};
  const FaultPlan from = {3, cudaErrorIllegalAddress, true};
  for (uint64_t n = 1; n < 10; ++n) {
    EXPECT_EQ(none.At(n), cudaSuccess) << n;
    EXPECT_EQ(once.At(n), n == 3 ? cudaErrorMemoryAllocation : cudaSuccess) << n;
    EXPECT_EQ(from.At(n), n >= 3 ? cudaErrorIllegalAddress : cudaSuccess) << n;
  }
}

}  // namespace
}  // namespace voxeld::gpu::cuda
