// Kernels for implicit shapes' programs, compiled for each as they are asked for. Programs that differ in
// constants alone share a kernel; a compiled formula covers the same voxels as an interpreted one does, so it
// can take its place in any frame.
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

// Thread-bound, but for its own thread, which compiles and knows no device.
class CompiledFormulas {
 public:
  // A program heavier than kMostWeight (FormulaWeight) is left to be interpreted: its code would be
  // compiled for seconds.
  static constexpr size_t kMostKept = 512;
  // So many wait to be compiled; what comes then is to ask again.
  static constexpr size_t kMostQueued = 32;
  static constexpr uint64_t kMostWeight = 600;

  // Of no more programs than `most_kept`, but for those that a frame needs, if they are not being compiled, is anything kept: the one that was
  // asked for the longest ago goes, with its kernel.
  CompiledFormulas(Api& api, CompileFormulas when, size_t most_kept = kMostKept);
  ~CompiledFormulas();
  CompiledFormulas(const CompiledFormulas&) = delete;
  CompiledFormulas& operator=(const CompiledFormulas&) = delete;

  // What is found from here on stays until the next call: kernels may be launched later.
  void BeginFrame() { begun_ = asked_; }
  // The kernel for a program (implicit/hoisted.h); null: there is none, or not yet. An error is one of the
  // device's. With kLater a program is compiled when it comes for the second time: one that comes once and
  // stays is drawn once.
  absl::StatusOr<cudaKernel_t> Find(std::span<const uint32_t> hoisted);

  // So far, also of what has gone.
  size_t compiled() const { return loaded_; }
  size_t kept() const { return formulas_.size(); }

 private:
  using Key = std::vector<uint32_t>;
  enum class State : uint8_t { kSeen, kAsked, kLoaded, kNone };
  struct Formula {
    State state = State::kSeen;
    cudaLibrary_t code = nullptr;
    cudaKernel_t kernel = nullptr;
    uint64_t asked = 0;  // when last, by asked_
  };
  struct Work {
    Key key;
    std::string source;
  };
  struct Done {
    Key key;
    absl::StatusOr<std::string> module;
  };

  // False: there is no compiler.
  bool HasCompiler();
  absl::StatusOr<std::string> Compile(const std::string& source) const;
  absl::Status TakeDone() VOXELD_EXCLUDES(mutex_);
  absl::Status Load(Formula& formula, const absl::StatusOr<std::string>& module);
  void CompileQueued() VOXELD_EXCLUDES(mutex_);
  // Makes room for one more. What a kernel was launched for may still be under way: it is waited for.
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
  std::thread thread_;  // once something is to be compiled later
};

}  // namespace voxeld::gpu::cuda
