#include "gpu/cuda/compiled_formulas.h"

#include <system_error>
#include <utility>

#include "gpu/cuda/formula_source.h"
#include "gpu/implicit/formula_text.h"

namespace voxeld::gpu::cuda {

CompiledFormulas::CompiledFormulas(Api& api, CompileFormulas when, size_t most_kept)
    : api_(api), when_(when), most_kept_(most_kept) {}

CompiledFormulas::~CompiledFormulas() {
  {
    const sync::MutexLock lock(mutex_);
    ends_ = true;
    queue_.clear();
  }
  queued_.NotifyAll();
  if (thread_.joinable()) thread_.join();
  if (loaded_ != 0) cudaDeviceSynchronize();  // kernels may be running
  for (const auto& [key, formula] : formulas_) {
    if (formula.code != nullptr) cudaLibraryUnload(formula.code);
  }
}

bool CompiledFormulas::HasCompiler() {
  if (!looked_for_) {
    looked_for_ = true;
    absl::StatusOr<std::shared_ptr<const Nvrtc>> opened =
        Nvrtc::OpenFor(api_.device().major, api_.device().minor);
    if (opened.ok()) nvrtc_ = *std::move(opened);
  }
  return nvrtc_ != nullptr;
}

absl::StatusOr<std::string> CompiledFormulas::Compile(const std::string& source) const {
  return nvrtc_->Compile(source, FormulaSources(), api_.device().major, api_.device().minor);
}

absl::StatusOr<cudaKernel_t> CompiledFormulas::Find(std::span<const uint32_t> hoisted) {
  if (when_ == CompileFormulas::kNever) return nullptr;
  if (absl::Status status = TakeDone(); !status.ok()) return status;
  Key key = implicit::FormulaKey(hoisted);
  const bool is_new = !formulas_.contains(key);
  if (is_new && formulas_.size() >= most_kept_) {
    if (absl::Status status = Forget(); !status.ok()) return status;
  }
  Formula& formula = formulas_[key];
  formula.asked = ++asked_;
  if (formula.state != State::kSeen) return formula.kernel;
  if (is_new && when_ == CompileFormulas::kLater) return nullptr;
  if (implicit::FormulaWeight(hoisted) > kMostWeight || !HasCompiler()) {
    formula.state = State::kNone;
    return nullptr;
  }
  std::string source = FormulaSource(hoisted);
  if (when_ == CompileFormulas::kAtOnce) {
    if (absl::Status status = Load(formula, Compile(source)); !status.ok()) return status;
    return formula.kernel;
  }
  {
    const sync::MutexLock lock(mutex_);
    if (queue_.size() >= kMostQueued) return nullptr;
    queue_.push_back({std::move(key), std::move(source)});
  }
  formula.state = State::kAsked;
  if (!thread_.joinable()) {
    try {
      thread_ = std::thread([this] { CompileQueued(); });
    } catch (const std::system_error&) {  // out of threads or memory: nothing is compiled now
      const sync::MutexLock lock(mutex_);
      queue_.clear();
      formula.state = State::kSeen;
      return nullptr;
    }
  }
  queued_.NotifyOne();
  return nullptr;
}

absl::Status CompiledFormulas::Forget() {
  auto oldest = formulas_.end();
  for (auto it = formulas_.begin(); it != formulas_.end(); ++it) {
    if (it->second.state == State::kAsked || it->second.asked > begun_) continue;
    if (oldest == formulas_.end() || it->second.asked < oldest->second.asked) oldest = it;
  }
  if (oldest == formulas_.end()) return absl::OkStatus();
  if (cudaLibrary_t code = oldest->second.code; code != nullptr) {
    absl::Status status =
        api_.Call("cudaDeviceSynchronize", [] { return cudaDeviceSynchronize(); });
    if (!status.ok()) return status;
    cudaLibraryUnload(code);
  }
  formulas_.erase(oldest);
  return absl::OkStatus();
}

absl::Status CompiledFormulas::TakeDone() {
  std::vector<Done> done;
  {
    const sync::MutexLock lock(mutex_);
    done.swap(done_);
  }
  absl::Status status;
  for (const Done& one : done) {
    const auto found = formulas_.find(one.key);
    if (found == formulas_.end()) continue;
    if (status.ok()) {
      status = Load(found->second, one.module);
    } else {
      found->second.state = State::kSeen;  // it is compiled again when it is requested again
    }
  }
  return status;
}

// A module that the device rejects is treated as if there were none.
absl::Status CompiledFormulas::Load(Formula& formula, const absl::StatusOr<std::string>& module) {
  formula.state = State::kNone;
  if (!module.ok()) return absl::OkStatus();
  const absl::Status status = api_.Call("cudaLibraryLoadData", [&] {
    cudaError_t error = cudaLibraryLoadData(&formula.code, module->data(), nullptr, nullptr, 0,
                                            nullptr, nullptr, 0);
    if (error == cudaSuccess) {
      error = cudaLibraryGetKernel(&formula.kernel, formula.code, kFormulaKernel);
    }
    // Modules may be loaded only when something in them is first used, so use the kernel now.
    cudaFuncAttributes attributes;
    if (error == cudaSuccess) error = cudaFuncGetAttributes(&attributes, formula.kernel);
    if (error == cudaSuccess) {
      formula.state = State::kLoaded;
      ++loaded_;
      return cudaSuccess;
    }
    cudaGetLastError();
    if (formula.code != nullptr) cudaLibraryUnload(formula.code);
    formula.code = nullptr;
    formula.kernel = nullptr;
    return cudaSuccess;
  });
  if (!status.ok()) formula.state = State::kSeen;
  return status;
}

void CompiledFormulas::CompileQueued() {
  for (;;) {
    Work work;
    {
      const sync::MutexLock lock(mutex_);
      while (queue_.empty() && !ends_) queued_.Wait(mutex_);
      if (ends_) return;
      work = std::move(queue_.front());
      queue_.pop_front();
    }
    absl::StatusOr<std::string> module = Compile(work.source);
    const sync::MutexLock lock(mutex_);
    done_.push_back({std::move(work.key), std::move(module)});
  }
}

}  // namespace voxeld::gpu::cuda
