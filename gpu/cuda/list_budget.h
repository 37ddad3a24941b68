// What the lists of what lies where may take of a device's memory, of all indices together.
#pragma once

#include <cstdint>

#include "gpu/cuda/pool.h"

namespace voxeld::gpu::cuda {

// Thread-bound.
struct ListBudget {
  Pool pool;           // lists, and what making them takes, come out of it: its limit is the budget
  uint64_t most_kept;  // what lists that stay from frame to frame may have of it

  // Whether what is there now, if it stays, leaves too little for making others.
  bool KeepsTooMuch() const { return pool.used() > most_kept; }
};

}  // namespace voxeld::gpu::cuda
