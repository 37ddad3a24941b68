// The interface of the volume engine: it takes a scene's deltas and returns packed slice images.
//
//   StatusOr<unique_ptr<Engine>> engine = CreateEngine({.kind = EngineKind::kAuto});
//   engine->SetTarget(target, done);                      // the display and the view
//   StagingBlock block = *engine->AcquireStaging(bytes);  // memory that may be shared
//                                                         // with a process
//   DeltaWriter writer(block.bytes()); …                  // gpu/delta.h
//   block.Refer(writer.TakeReferred());                   // if arrays lie in bulk memory
//   engine->Apply(std::move(block), writer.size(), done);
//   engine->SubmitFrame({.frame = 7}, buffer, done);
//
// Contract
// - Calls are executed in the order in which they were made. Each ends in exactly one call of its
//   `done`, from one of the engine's threads (or inside the call, with
//   EngineOptions::inline_execution). Calls that have not begun when the engine is destroyed end in
//   Cancelled, before its destructor returns. `done` must only post: it must not call the engine,
//   block, or throw.
// - The engine keeps no caller's pointer after a call: it owns a staging block from Apply on; a
//   FrameBuffer belongs to the caller, and the engine writes it only between SubmitFrame and its
//   `done`.
// - Every engine produces the same bytes for a scene, with any number of threads and parts, and
//   whichever frames were drawn in between.
// - An error leaves the engine as it was before that call, unless the code is DataLoss: then the
//   engine is lost and every later call ends in DataLoss. Its owner creates a new one and sends it
//   the whole scene (everything that an engine holds is derived from it).
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

// The slices that an engine owns: [begin, end) of the layout's slices. The engine draws only the
// tiles that those slices look at. Several engines, each with a part, can drive one display: their
// slices together equal those of one engine for all.
struct SlicePart {
  int32_t begin = 0;
  int32_t end = -1;  // −1: to the last
  // The range is divided into `ranks` runs whose lengths differ by at most one slice; the part is
  // the run with number `rank`, which may be empty.
  int32_t rank = 0, ranks = 1;

  // Returns the slices of this part in a layout with `slices` slices.
  SliceRange Within(int32_t slices) const {
    const int64_t count = (end == -1 ? slices : end) - begin;
    return {static_cast<int32_t>(begin + count * rank / ranks),
            static_cast<int32_t>(begin + count * (rank + 1) / ranks)};
  }
};

struct EngineOptions {
  EngineKind kind = EngineKind::kAuto;
  int threads = 0;                // worker threads of the CPU engine; 0: one per core
  bool inline_execution = false;  // every call finishes before it returns, in the caller's thread
  int device = 0;                 // the GPU of the CUDA engine
  // With several GPUs, the engine consists of ranks, one for each GPU. Each draws its share of the
  // slices in a process of its own (gpu/ranks). The CPU engine has ranks only with `in_worker`: one
  // for each number in the list. With fewer than two entries, no ranks are used.
  std::vector<int> devices;
  // The path of the NCCL library, over which the first rank sends a delta to the others. Empty:
  // $VOXELD_NCCL, then where the loader looks; "off": every rank is sent the whole delta.
  std::string nccl;
  // Runs the CPU engine, too, in a process of its own (the CUDA engine always does).
  bool in_worker = false;
  std::string worker;  // the program of that process; empty: voxeld-engine, beside this program
  // The pool in which engines of one GPU share a process; null: this engine has its own process.
  std::shared_ptr<WorkerPool> workers;
  // The time after which a worker that does not answer is given up.
  int64_t worker_deadline_ns = 2'000'000'000;
  // For an engine in a process of its own. If false, CreateEngine returns at once; if the engine
  // cannot be started, its calls end in DataLoss that says why. info() is valid after the first
  // call that succeeded.
  bool wait_until_ready = true;
  // Called once, from one of the engine's threads, when an engine in a process of its own is lost,
  // even between calls. It must only post.
  std::function<void(const absl::Status&)> lost;
  // When it becomes true, the CPU engine aborts its call with DataLoss. For a daemon that stops.
  // May be null.
  std::shared_ptr<const std::atomic<bool>> abandoned;
  SlicePart part;
  uint64_t staging_limit_bytes = uint64_t{4} << 30;  // of all blocks together, until applied
  // Bounds the items that an engine derives by tile (CPU), or by tile and region (CUDA, in the
  // device's memory). The CPU engine may use a quarter more for lists of the tiles that drawables
  // are in, and for pieces of curves. A scene that needs more is drawn in passes, more slowly but
  // with the same result. 0: the engine's default (CPU: cpu_index_bytes; CUDA: 16 GiB or a quarter
  // of the device, whichever is less).
  uint64_t index_bytes = 0;
  uint64_t cpu_index_bytes = 0;  // 0: 4 GiB
};

struct EngineInfo {
  EngineKind kind = EngineKind::kCpu;  // never kAuto
  std::string device;                  // "CPU, 8 threads", "NVIDIA H200"
  std::string reason;  // why this kind was chosen: "no CUDA driver", "asked for", …
};

// The display that an engine draws for.
// `view` maps scene units to voxel space (voxel i = [i, i+1)).
struct Target {
  display::Geometry geometry;
  display::FrameLayout layout;
  display::Tone tone;
  Affine view;
};

// Staging memory, which the caller writes before it passes the block to Apply. Movable; released on
// destruction.
class StagingBlock {
 public:
  struct Memory {
    virtual ~Memory() = default;
    virtual std::span<std::byte> bytes() = 0;
    // Finds the data that the delta refers to, if it is not in blocks that came with the delta.
    virtual BulkSource* bulk() { return nullptr; }
  };
  StagingBlock() = default;
  explicit StagingBlock(std::shared_ptr<Memory> memory) : memory_(std::move(memory)) {}
  std::span<std::byte> bytes() const { return memory_ ? memory_->bytes() : std::span<std::byte>(); }
  const std::shared_ptr<Memory>& memory() const { return memory_; }
  BulkSource* bulk() const { return memory_ ? memory_->bulk() : nullptr; }

  // Adds the bulk memory that this block's delta refers to. The engine holds it while it reads it.
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
  uint64_t frame = 0;  // ascending; recorded as the frame in which a slice image's bytes changed
  // The last complete frame that this buffer held; 0: none. Slice images that have not changed
  // since that frame are not written again.
  uint64_t buffer_holds = 0;
};

// The caller's memory. It has the size of the whole layout, even if the engine owns a part: the
// engine writes only its own slices.
struct FrameBuffer {
  std::span<std::byte> bytes;      // layout.bytes()
  std::span<uint64_t> changed_in;  // layout.pictures()
};

struct FrameResult {
  uint64_t frame = 0;
  bool changed = false;  // some slice image differs from the frame before
  // Voxels that are not black, in the engine's tiles except those that a rank before it counts.
  uint64_t lit_voxels = 0;
  uint32_t tiles_drawn = 0;         // dirty tiles, of the engine's own size, that this frame drew
  uint32_t pictures_drawn = 0;      // slice images that were packed again
  uint32_t singular_drawables = 0;  // solids whose map has no inverse: they draw nothing
  // If a display's pixels are voxels, slice images may be packed while the volume is drawn; both
  // then count as assembling. Otherwise the volume is drawn first and sliced afterwards.
  bool packed_as_drawn = false;
  // Durations of: drawing the volume; packing the slice images; and copying them into the buffer,
  // as far as that took longer than the packing.
  int64_t assemble_ns = 0, slice_ns = 0, copy_ns = 0;
  // The memory that the engine itself owns, on the device if it has one: the data derived from the
  // scene, the volume and the slice images. Bulk memory does not count.
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

  // Sets or replaces the target. The scene stays, and everything is drawn again. Must be called
  // before the first frame. Errors: InvalidArgument for an inconsistent geometry or layout.
  virtual void SetTarget(Target target, Done done) = 0;

  // Returns `size` bytes of staging memory. Errors: ResourceExhausted past the limit.
  virtual absl::StatusOr<StagingBlock> AcquireStaging(size_t size) = 0;

  // Applies the first `size` bytes of `block`, a delta in the format of gpu/delta.h. Errors:
  // InvalidArgument with the offset for a malformed delta, of which nothing is applied.
  virtual void Apply(StagingBlock block, size_t size, Done done) = 0;

  // Brings the scene up to date, and `buffer` up to `request.frame`.
  virtual void SubmitFrame(const FrameRequest& request, FrameBuffer buffer, FrameDone done) = 0;

  // Writes the blended voxels of `box`, x fastest, as 0x00RRGGBB; voxels outside the engine's tiles
  // are 0. For tests and tools: brings the scene up to date first.
  virtual void ReadVoxels(VoxelBox box, std::span<uint32_t> out, Done done) = 0;

  // Returns the link that connects the engine, in a worker, with the other ranks of its display
  // (gpu/rank_link.h); null if it needs none. Requires: inline_execution, and no call in progress.
  virtual RankLink* link() { return nullptr; }
};

// Errors: FailedPrecondition with the reason if the requested kind is not available; kAuto always
// succeeds.
absl::StatusOr<std::unique_ptr<Engine>> CreateEngine(const EngineOptions& options);

}  // namespace voxeld::gpu
