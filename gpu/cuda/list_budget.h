// The budget of device memory for the lists of all indices together.
#pragma once

#include <cstdint>

#include "gpu/cuda/pool.h"

namespace voxeld::gpu::cuda {

// Thread-bound.
struct ListBudget {
  Pool pool;           // memory of lists and of their making: its limit is the budget
  uint64_t most_kept;  // limit of the lists that are kept from frame to frame

  // Returns whether the current lists, if they are kept, leave too little memory for making others.
  bool KeepsTooMuch() const { return pool.used() > most_kept; }
};

}  // namespace voxeld::gpu::cuda
