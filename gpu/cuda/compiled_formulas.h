// Kernels for the programs of implicit shapes, compiled on demand. Programs that differ only in
// constants share a kernel. A compiled formula covers the same voxels as an interpreted one, so it
// can replace it in any frame.
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/sync/mutex.h"
#include "gpu/cuda/api.h"
#include "gpu/cuda/nvrtc.h"
#include "gpu/cuda/tuning.h"

namespace voxeld::gpu::cuda {

// Thread-bound, except for its own thread, which compiles and does not use the device.
class CompiledFormulas {
 public:
  // A program heavier than kMostWeight (FormulaWeight) is interpreted, because compiling its code
  // would take seconds.
  static constexpr size_t kMostKept = 512;
  // The limit of programs that wait to be compiled; later requests have to be repeated.
  static constexpr size_t kMostQueued = 32;
  static constexpr uint64_t kMostWeight = 600;

  // Keeps at most `most_kept` programs, and more only if a frame needs them or they are being
  // compiled. Discards the program whose last request is the oldest, with its kernel.
  CompiledFormulas(Api& api, CompileFormulas when, size_t most_kept = kMostKept);
  ~CompiledFormulas();
  CompiledFormulas(const CompiledFormulas&) = delete;
  CompiledFormulas& operator=(const CompiledFormulas&) = delete;

  // Kernels found from here on stay valid until the next call, because they may be launched later.
  void BeginFrame() { begun_ = asked_; }
  // Returns the kernel for a program (implicit/hoisted.h); null if it is not compiled (yet).
  // Errors: those of the device. With kLater a program is compiled when it is requested for the
  // second time, because a shape that does not change is drawn only once.
  absl::StatusOr<cudaKernel_t> Find(std::span<const uint32_t> hoisted);

  // Returns the number compiled so far, discarded ones included.
  size_t compiled() const { return loaded_; }
  size_t kept() const { return formulas_.size(); }

 private:
  using Key = std::vector<uint32_t>;
  enum class State : uint8_t { kSeen, kAsked, kLoaded, kNone };
  struct Formula {
    State state = State::kSeen;
    cudaLibrary_t code = nullptr;
    cudaKernel_t kernel = nullptr;
    uint64_t asked = 0;  // the value of asked_ at the last request
  };
  struct Work {
    Key key;
    std::string source;
  };
  struct Done {
    Key key;
    absl::StatusOr<std::string> module;
  };

  // Returns false if no compiler is available.
  bool HasCompiler();
  absl::StatusOr<std::string> Compile(const std::string& source) const;
  absl::Status TakeDone() VOXELD_EXCLUDES(mutex_);
  absl::Status Load(Formula& formula, const absl::StatusOr<std::string>& module);
  void CompileQueued() VOXELD_EXCLUDES(mutex_);
  // Makes room for one more. Waits for the device, because a kernel that is discarded may still be
  // running.
  absl::Status Forget();

  Api& api_;
  const CompileFormulas when_;
  const size_t most_kept_;
  bool looked_for_ = false;
  std::shared_ptr<const Nvrtc> nvrtc_;
  absl::flat_hash_map<Key, Formula> formulas_;
  size_t loaded_ = 0;
  uint64_t asked_ = 0, begun_ = 0;

  sync::Mutex mutex_;
  sync::CondVar queued_;
  std::deque<Work> queue_ VOXELD_GUARDED_BY(mutex_);
  std::vector<Done> done_ VOXELD_GUARDED_BY(mutex_);
  bool ends_ VOXELD_GUARDED_BY(mutex_) = false;
  std::thread thread_;  // started when something is to be compiled later
};

}  // namespace voxeld::gpu::cuda
