// Finds which voxels are inside a mesh (primitives/filled.h): every triangle flips bits where rows
// meet it, then each row's bits become the parity up to them, and each tile that has any is noted.
#include "gpu/cuda/kernels.h"
#include "gpu/cuda/warp-inl.h"
#include "gpu/primitives/filled.h"

namespace voxeld::gpu::cuda {
namespace {

constexpr uint32_t kThreads = 256, kWarps = kThreads / 32;
// Threads per triangle, if there are many triangles, and if there are few.
constexpr uint32_t kLeastTeam = 4, kMostTeam = 256 * 32;

// Flips bits for the rows of a triangle, by a team of threads: a power of two.
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

// Each warp handles a row, 32 words at a time.
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
  // A row that is open has no inside.
  for (uint32_t i = lane; before != 0 && i < words; i += 32) at[i] = 0;
}

// For a row of tiles along x, by a block of threads: sets tiles[i] to whether item i has any. A
// lane has a word of 32 voxels along x, half of which is a tile's.
__global__ void NoteTilesKernel(Source source, const uint32_t* bits, uint8_t* tiles) {
  __shared__ uint32_t any[32];
  static_assert(kTileSize == 16);
  const ImplicitPlace& place = source.implicit;
  const InsideRows rows{source.solid.bounds};
  const int32_t tile[2] = {static_cast<int32_t>(blockIdx.x) % place.blocks[1],
                           static_cast<int32_t>(blockIdx.x) / place.blocks[1]};
  int32_t lo[2], count[2];
  for (int a = 0; a < 2; ++a) {
    const int32_t begin = (place.first[a + 1] + tile[a]) * kTileSize;
    lo[a] = Max(begin, rows.box.lo[a + 1]);
    count[a] = Min(begin + kTileSize, rows.box.hi[a + 1]) - lo[a];
  }
  const int32_t lane = static_cast<int32_t>(threadIdx.x % 32);
  for (int32_t begin = 0; begin < rows.words(); begin += 32) {
    if (threadIdx.x < 32) any[threadIdx.x] = 0;
    __syncthreads();
    uint32_t found = 0;
    if (begin + lane < rows.words()) {
      for (int32_t row = static_cast<int32_t>(threadIdx.x / 32); row < count[0] * count[1];
           row += static_cast<int32_t>(kWarps)) {
        found |= bits[rows.PlaceOf((rows.first_word() + begin + lane) * 32, lo[0] + row % count[0],
                                   lo[1] + row / count[0])];
      }
    }
    if (found != 0) atomicOr(&any[lane], found);
    __syncthreads();
    if (threadIdx.x < 64) {
      const int32_t word = static_cast<int32_t>(threadIdx.x / 2), half = threadIdx.x % 2;
      const int32_t i = (rows.first_word() + begin + word) * 2 + half - place.first[0];
      if (i >= 0 && i < place.blocks[0]) {
        tiles[(tile[1] * place.blocks[1] + tile[0]) * place.blocks[0] + i] =
            (any[word] >> 16 * half & 0xFFFF) != 0 ? 1 : 0;
      }
    }
    __syncthreads();
  }
}

uint32_t BlocksOf(uint64_t warps) { return static_cast<uint32_t>((warps + kWarps - 1) / kWarps); }

}  // namespace

cudaError_t FindInside(const Source& source, const GeometryRecord& record, uint32_t* inside,
                       uint8_t* tiles, cudaStream_t stream) {
  const InsideRows rows{source.solid.bounds};
  const uint32_t corners = record.index_count != 0 ? record.index_count : record.vertex_count;
  const uint32_t triangles = corners / 3;
  if (rows.size() == 0) return cudaSuccess;
  constexpr uint64_t kEnough = 1 << 19;  // threads that keep a device busy
  uint32_t team = kLeastTeam;
  while (team < kMostTeam && uint64_t{triangles} * team < kEnough) team *= 2;
  if (triangles != 0) {
    FlipKernel<<<BlocksOf(uint64_t{triangles} * team / 32 + 1), kThreads, 0, stream>>>(
        source, record, team, inside);
  }
  if (const cudaError_t error = cudaGetLastError(); error != cudaSuccess) return error;
  SumKernel<<<BlocksOf(rows.rows()), kThreads, 0, stream>>>(inside, rows.rows(),
                                                            static_cast<uint32_t>(rows.words()));
  if (const cudaError_t error = cudaGetLastError(); error != cudaSuccess) return error;
  const int32_t* const blocks = source.implicit.blocks;
  NoteTilesKernel<<<static_cast<uint32_t>(blocks[1] * blocks[2]), kThreads, 0, stream>>>(
      source, inside, tiles);
  return cudaGetLastError();
}

}  // namespace voxeld::gpu::cuda
