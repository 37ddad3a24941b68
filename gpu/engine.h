// The one door to the volume engine: a scene's deltas in, packed slices out.
//
//   StatusOr<unique_ptr<Engine>> engine = CreateEngine({.kind = EngineKind::kAuto});
//   engine->SetTarget(target, done);                      // which display, which view
//   StagingBlock block = *engine->AcquireStaging(bytes);  // memory that may be shared
//                                                         // with a process
//   DeltaWriter writer(block.bytes()); …                  // gpu/delta.h
//   block.Refer(writer.TakeReferred());                   // if arrays lie in bulk memory
//   engine->Apply(std::move(block), writer.size(), done);
//   engine->SubmitFrame({.frame = 7}, buffer, done);
//
// Contract
// - Calls are carried out in the order in which they were made; each ends in exactly one call of
//   its `done`, from a thread of the engine's (or inside the call, with
//   EngineOptions::inline_execution); those not begun when the engine is destroyed end in
//   Cancelled, before its destructor returns. `done` must only post: it must not call the engine,
//   block, or throw.
// - No pointer passes for keeps: the engine owns a staging block from Apply on;
//   a FrameBuffer belongs to the caller, is written only between SubmitFrame and its `done`, and
//   is not remembered.
// - For any scene every engine gives the same bytes,
//   in any number of threads, parts and frames between.
// - An error leaves the engine as it was before that call, unless the code is DataLoss: then the
//   engine is gone, every later call ends in DataLoss, and its owner makes a new one and gives it
//   the whole scene (what an engine holds is always derived).
// - Thread-safe.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/api/geometry.h"
#include "display/api/slice_frame.h"
#include "gpu/affine.h"
#include "gpu/bulk/bulk_block.h"

namespace voxeld::gpu {

class RankLink;
class WorkerPool;

enum class EngineKind : uint8_t { kAuto, kCpu, kCuda };
const char* EngineKindName(EngineKind kind);

// Slices [begin, end).
struct SliceRange {
  int32_t begin = 0, end = 0;
};

// The slices that an engine owns, [begin, end) of the layout's; it draws only
// the tiles that they look at. Several engines, each with a part, make one display:
// their slices joined equal the whole's.
struct SlicePart {
  int32_t begin = 0;
  int32_t end = -1;  // −1: to the last
  // Of that range, cut into `ranks` runs of equal length, give or take a slice, the one numbered
  // `rank`; it may be empty.
  int32_t rank = 0, ranks = 1;

  // Of a layout with so many slices.
  SliceRange Within(int32_t slices) const {
    const int64_t count = (end == -1 ? slices : end) - begin;
    return {static_cast<int32_t>(begin + count * rank / ranks),
            static_cast<int32_t>(begin + count * (rank + 1) / ranks)};
  }
};

struct EngineOptions {
  EngineKind kind = EngineKind::kAuto;
  int threads = 0;                // worker threads of the CPU engine; 0: one a core
  bool inline_execution = false;  // every call finishes before it returns, in the caller's thread
  int device = 0;                 // of the CUDA engine
  // Several GPUs: the engine is made of ranks, one for each, which each draw their share of the
  // slices in a process of their own (gpu/ranks). The CPU engine has ranks only with `in_worker`, as
  // many as there are numbers. Fewer than two: none.
  std::vector<int> devices;
  // By which a delta goes from the first of them to the others: a path of NCCL's library; empty:
  // $VOXELD_NCCL, then where the loader looks; "off": each is sent all of it.
  std::string nccl;
  // The CPU engine too runs in a process of its own (the CUDA engine always does).
  bool in_worker = false;
  std::string worker;  // the program of that process; empty: voxeld-engine, beside this one
  // Where engines of one GPU find the process that they share; null: this one has its own.
  std::shared_ptr<WorkerPool> workers;
  // After which a worker that does not answer is given up.
  int64_t worker_deadline_ns = 2'000'000'000;
  // False, of an engine in a process of its own: CreateEngine only begins; if the engine cannot be
  // had its calls end in DataLoss that says why. info() is for after the first call that succeeded.
  bool wait_until_ready = true;
  // Called once, from a thread of the engine's, when an engine in a process of its own is lost, also
  // between calls. It must only post.
  std::function<void(const absl::Status&)> lost;
  // When it becomes true, the CPU engine gives up its call in DataLoss. For a daemon that stops. May be null.
  std::shared_ptr<const std::atomic<bool>> abandoned;
  SlicePart part;
  uint64_t staging_limit_bytes = uint64_t{4} << 30;  // of blocks at once, until they are applied
  // Bounds what an engine derives of items by tile (CPU), or by tile and region (CUDA, of the device's
  // memory). The CPU engine may use a quarter more for lists of the tiles that drawables are in, and for pieces of curves.
  // A scene that needs more is drawn in passes: more slowly, with the same result. 0: the engine's default (CPU:
  // cpu_index_bytes; CUDA: 16 GiB or a quarter of the device, whichever is less).
  uint64_t index_bytes = 0;
  uint64_t cpu_index_bytes = 0;  // 0: 4 GiB
};

struct EngineInfo {
  EngineKind kind = EngineKind::kCpu;  // never kAuto
  std::string device;                  // "CPU, 8 threads", "NVIDIA H200"
  std::string reason;                  // why this kind: "no CUDA driver", "asked for", …
};

// The display that an engine draws for.
// `view` maps scene units to voxel space (voxel i = [i, i+1)).
struct Target {
  display::Geometry geometry;
  display::FrameLayout layout;
  display::Tone tone;
  Affine view;
};

// Staging memory, written by the caller before it goes to Apply.
// Movable; given back on destruction.
class StagingBlock {
 public:
  struct Memory {
    virtual ~Memory() = default;
    virtual std::span<std::byte> bytes() = 0;
    // Finds what the delta refers to, where that is not blocks that came along.
    virtual BulkSource* bulk() { return nullptr; }
  };
  StagingBlock() = default;
  explicit StagingBlock(std::shared_ptr<Memory> memory) : memory_(std::move(memory)) {}
  std::span<std::byte> bytes() const { return memory_ ? memory_->bytes() : std::span<std::byte>(); }
  const std::shared_ptr<Memory>& memory() const { return memory_; }
  BulkSource* bulk() const { return memory_ ? memory_->bulk() : nullptr; }

  // The bulk memory that the delta in it refers to. The engine holds it for as long as it reads it.
  void Refer(std::vector<BulkBlock> blocks) {
    referred_ = std::make_shared<const std::vector<BulkBlock>>(std::move(blocks));
  }
  std::span<const BulkBlock> referred() const {
    return referred_ ? std::span(*referred_) : std::span<const BulkBlock>();
  }

 private:
  std::shared_ptr<Memory> memory_;
  std::shared_ptr<const std::vector<BulkBlock>> referred_;
};

struct FrameRequest {
  uint64_t frame = 0;  // ascending; recorded as the frame in which a picture's bytes changed
  // The last frame that this very buffer held, whole; 0: none. Pictures that have not changed since
  // then are not written again.
  uint64_t buffer_holds = 0;
};

// Caller's memory. Sizes are the whole layout's, also when the engine owns a part:
// it writes its slices.
struct FrameBuffer {
  std::span<std::byte> bytes;      // layout.bytes()
  std::span<uint64_t> changed_in;  // layout.pictures()
};

struct FrameResult {
  uint64_t frame = 0;
  bool changed = false;  // some picture differs from the frame before
  // Of the engine's tiles, less those that a rank before counts: result not black.
  uint64_t lit_voxels = 0;
  uint32_t tiles_drawn = 0;         // dirty tiles, of the engine's own size, drawn for this frame
  uint32_t pictures_drawn = 0;      // pictures sliced again
  uint32_t singular_drawables = 0;  // solids whose map has no inverse: they draw nothing
  // Where a display's pixels are voxels, pictures may be packed as the volume is drawn; then that is
  // all assembling. Else the volume is drawn, and sliced.
  bool packed_as_drawn = false;
  // Until the volume was drawn; from there until the pictures were packed; and until they lay in the
  // buffer, as far as that took longer than the packing.
  int64_t assemble_ns = 0, slice_ns = 0, copy_ns = 0;
  // What the engine holds of its own, on the device where it has one: what it derives from the scene, the volume and
  // the pictures. Bulk memory is not its own.
  uint64_t memory_bytes = 0;
};

// A box of voxels, half-open.
struct VoxelBox {
  int32_t x0 = 0, y0 = 0, z0 = 0, x1 = 0, y1 = 0, z1 = 0;
};

class Engine {
 public:
  using Done = std::function<void(absl::Status)>;
  using FrameDone = std::function<void(absl::StatusOr<FrameResult>)>;

  virtual ~Engine() = default;

  virtual const EngineInfo& info() const = 0;

  // Sets or replaces the target; the scene stays, everything is drawn anew. InvalidArgument for a
  // geometry or layout that does not hold together. Must come before the first frame.
  virtual void SetTarget(Target target, Done done) = 0;

  // `size` bytes of staging memory. ResourceExhausted past the limit.
  virtual absl::StatusOr<StagingBlock> AcquireStaging(size_t size) = 0;

  // Applies the first `size` bytes of `block`, a delta as gpu/delta.h has it. InvalidArgument for a
  // malformed one, with the offset; then nothing of it is applied.
  virtual void Apply(StagingBlock block, size_t size, Done done) = 0;

  // Brings the scene up to date, and `buffer` up to `request.frame`.
  virtual void SubmitFrame(const FrameRequest& request, FrameBuffer buffer, FrameDone done) = 0;

  // The blended voxels of `box`, x fastest, as 0x00RRGGBB; those outside the engine's tiles are 0.
  // For tests and tools: brings the scene up to date first.
  virtual void ReadVoxels(VoxelBox box, std::span<uint32_t> out, Done done) = 0;

  // What connects it, in a worker, with the other ranks of its display (gpu/rank_link.h); null: such
  // an engine needs nothing. Between calls, with inline_execution.
  virtual RankLink* link() { return nullptr; }
};

// FailedPrecondition if the kind asked for cannot be had, with the reason; kAuto always succeeds.
absl::StatusOr<std::unique_ptr<Engine>> CreateEngine(const EngineOptions& options);

}  // namespace voxeld::gpu
