// Marks for code that compiles for host and device alike.
#pragma once

// VOXELD_DEVICE_NOINLINE: nvcc compiles the function once for all its callers. It is for large functions that few items
// need, such as those in 128 bits: inlined wherever they are called, they take a kernel's compilation minutes.
#if defined(__CUDACC__)
#define VOXELD_HD __host__ __device__
#define VOXELD_DEVICE_NOINLINE __noinline__
#else
#define VOXELD_HD
#define VOXELD_DEVICE_NOINLINE
#endif
