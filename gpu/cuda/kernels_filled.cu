// Which voxels are inside of a mesh (primitives/filled.h): every triangle flips bits where rows meet it, then each row's
// bits become the parity up to them.
#include "gpu/cuda/kernels.h"
#include "gpu/cuda/warp-inl.h"
#include "gpu/primitives/filled.h"

namespace voxeld::gpu::cuda {
namespace {

constexpr uint32_t kThreads = 256, kWarps = kThreads / 32;
// Threads a triangle, where there are many, and where there are few.
constexpr uint32_t kLeastTeam = 4, kMostTeam = 256 * 32;

// Rows of a triangle, by a team of threads: a power of two.
__global__ void FlipKernel(Source source, GeometryRecord record, uint32_t team, uint32_t* bits) {
  source.record = &record;
  const uint64_t thread = uint64_t{blockIdx.x} * kThreads + threadIdx.x;
  if (thread >= uint64_t{Filled::CountTriangles(source)} * team) return;
  Int3 v[3];
  Filled::TriangleOf(source, static_cast<uint32_t>(thread / team), v);
  const InsideRows rows{source.solid.bounds};
  EmitCrossings(v, rows.box, static_cast<uint32_t>(thread % team), team,
                [&](int32_t y, int32_t z, int32_t x) {
                  atomicXor(&bits[rows.PlaceOf(x, y, z)], 1u << (x & 31));
                });
}

// A row a warp, 32 words at a time.
__global__ void SumKernel(uint32_t* bits, uint64_t rows, uint32_t words) {
  const uint64_t row = uint64_t{blockIdx.x} * kWarps + threadIdx.x / 32;
  if (row >= rows) return;
  uint32_t* const at = bits + row * words;
  const uint32_t lane = threadIdx.x % 32;
  uint32_t before = 0;  // the parity of all words of earlier rounds
  for (uint32_t begin = 0; begin < words; begin += 32) {
    const bool is_there = begin + lane < words;
    const uint32_t sums = is_there ? ParityUntil(at[begin + lane]) : 0;
    const uint32_t odd = __ballot_sync(kAllLanes, sums >> 31);
    const uint32_t parity = before ^ (static_cast<uint32_t>(__popc(odd & ((1u << lane) - 1))) & 1);
    if (is_there) at[begin + lane] = sums ^ (0u - parity);
    before ^= static_cast<uint32_t>(__popc(odd)) & 1;
  }
  // The row is open.
  for (uint32_t i = lane; before != 0 && i < words; i += 32) at[i] = 0;
}

uint32_t BlocksOf(uint64_t warps) { return static_cast<uint32_t>((warps + kWarps - 1) / kWarps); }

}  // namespace

cudaError_t FindInside(const Source& source, const GeometryRecord& record, uint32_t* inside,
                       cudaStream_t stream) {
  const InsideRows rows{source.solid.bounds};
  const uint32_t corners = record.index_count != 0 ? record.index_count : record.vertex_count;
  const uint32_t triangles = corners / 3;
  if (triangles == 0 || rows.size() == 0) return cudaSuccess;
  constexpr uint64_t kEnough = 1 << 19;  // threads that keep a device busy
  uint32_t team = kLeastTeam;
  while (team < kMostTeam && uint64_t{triangles} * team < kEnough) team *= 2;
  FlipKernel<<<BlocksOf(uint64_t{triangles} * team / 32 + 1), kThreads, 0, stream>>>(source, record,
                                                                                     team, inside);
  if (const cudaError_t error = cudaGetLastError(); error != cudaSuccess) return error;
  SumKernel<<<BlocksOf(rows.rows()), kThreads, 0, stream>>>(inside, rows.rows(),
                                                            static_cast<uint32_t>(rows.words()));
  return cudaGetLastError();
}

}  // namespace voxeld::gpu::cuda
