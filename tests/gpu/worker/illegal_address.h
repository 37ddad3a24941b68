// A fault of the GPU itself.
#pragma once

namespace voxeld::gpu {

// Has a kernel write to an invalid address, and waits for it: from then on, every CUDA call of this
// process that checks the device returns cudaErrorIllegalAddress. Needs a current device.
void WriteToAnIllegalAddress();

}  // namespace voxeld::gpu
