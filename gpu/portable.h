// Marks for code that compiles for host and device alike.
#pragma once

#if defined(__CUDACC__)
#define VOXELD_HD __host__ __device__
#else
#define VOXELD_HD
#endif
