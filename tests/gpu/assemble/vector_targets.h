// Runs kernels in every instruction set that is compiled and that this processor supports.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "hwy/highway.h"

namespace voxeld::gpu {

// Calls f() with each; `target()` returns the one in use. At least two are expected.
template <typename Target, typename F>
void ForEachVectorTarget(const Target& target, const F& f) {
  int targets = 0;
  for (int64_t left = hwy::SupportedTargets(); left != 0; left &= left - 1) {
    hwy::SetSupportedTargetsForTest(left & -left);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    // Not all that the processor supports are compiled.
    if (target() == hwy::TargetName(left & -left)) {
      ++targets;
      SCOPED_TRACE(target());
      f();
    }
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    if (testing::Test::HasFatalFailure()) return;
  }
  EXPECT_GE(targets, 2);
}

}  // namespace voxeld::gpu
