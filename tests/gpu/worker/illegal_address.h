// A fault of the GPU itself.
#pragma once

namespace voxeld::gpu {

// Has a kernel write where there is no memory, and waits for it: from then on every CUDA call of
// this process that looks at the device ends in cudaErrorIllegalAddress. Needs a current device.
void WriteToAnIllegalAddress();

}  // namespace voxeld::gpu
