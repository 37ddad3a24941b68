// Macros that mark code which compiles for both host and device.
#pragma once

// VOXELD_DEVICE_NOINLINE: nvcc compiles the function once for all its callers. It is for large
// functions that few items need, such as those in 128 bits: if they were inlined at each call, a
// kernel would take minutes to compile.
#if defined(__CUDACC__)
#define VOXELD_HD __host__ __device__
#define VOXELD_DEVICE_NOINLINE __noinline__
#else
#define VOXELD_HD
#define VOXELD_DEVICE_NOINLINE
#endif
