// The measurements of the paper: Al-Oraiqat and Zori, "3D Primitives GPGPU Generation for Volume
// Visualization in 3D Graphics Systems", Tables 2 to 4. Times are in milliseconds and include the
// copy to the host.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace voxeld::bench::paper {

struct Hardware {
  std::string_view name;
  int year;  // of release
};
inline constexpr size_t kMachines = 5;
inline constexpr std::array<Hardware, kMachines> kHardware = {{{"Core 2 Quad Q9550", 2008},
                                                               {"GTX 260", 2008},
                                                               {"GTX 1050", 2016},
                                                               {"GTX 760", 2013},
                                                               {"GTX 1070", 2016}}};

struct Row {
  uint64_t voxels;  // per segment
  std::array<double, kMachines> ms;
};

// Table 2: one segment.
inline constexpr std::array<Row, 10> kTable2 = {
    {{1000, {0.05, 1.84, 1.57, 0.91, 0.45}},
     {2000, {0.08, 1.86, 1.58, 0.92, 0.46}},
     {5000, {0.16, 1.99, 1.69, 0.99, 0.49}},
     {10000, {0.29, 2.04, 1.74, 1.01, 0.51}},
     {20000, {0.59, 2.07, 1.77, 1.02, 0.52}},
     {50000, {1.43, 2.53, 2.16, 1.27, 0.67}},
     {100000, {2.73, 3.49, 2.98, 1.75, 0.92}},
     {200000, {5.24, 5.49, 4.86, 3.05, 1.52}},
     {500000, {8.74, 7.89, 7.01, 4.51, 2.22}},
     {1000000, {16.3, 12.79, 11.42, 7.31, 3.65428571}}}};

// Table 3: 1024 segments of one length.
inline constexpr uint64_t kSegments = 1024;
inline constexpr std::array<Row, 11> kTable3 = {
    {{20, {3.2, 3.42, 1.46, 0.84, 0.42}},
     {50, {4.11, 3.8, 1.62, 0.94, 0.46}},
     {100, {7.09, 5.97, 2.54, 1.48, 0.75}},
     {1000, {26.23, 15.82, 4.74, 2.63, 1.44}},
     {2000, {51.38, 33.03, 14.12, 8.14, 4.13}},
     {5000, {124.44, 82.35, 35.19, 20.59, 10.91}},
     {10000, {240.03, 163.87, 70.03, 40.97, 21.70}},
     {20000, {474.58, 320.07, 141.62, 88.91, 43.85}},
     {50000, {1417.4, 783.18, 348.08, 223.77, 105.84}},
     {100000, {2640.33, 1527.20, 681.79, 436.34, 218.17}},
     {200000, {5315.296, 2993.31, 1336.30, 855.23, 427.62}}}};

// Table 4: 1024 segments of different lengths, 10⁹ voxels in total.
inline constexpr uint64_t kGigavoxel = 1'000'000'000;
inline constexpr std::array<double, kMachines> kTable4 = {119729.2, 29932.29, 13000.30, 8051.23,
                                                          4071.01};

}  // namespace voxeld::bench::paper
