#include "gpu/cuda/nvrtc.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "gpu/cuda/opened_library.h"

namespace voxeld::gpu::cuda {
namespace {

constexpr int kSuccess = 0;             // NVRTC_SUCCESS
constexpr int kErrorOfTheSource = 6;    // NVRTC_ERROR_COMPILATION
constexpr size_t kMostOfTheLog = 2000;  // the reported part of it, in bytes

}  // namespace

struct Nvrtc::Functions {
  const char* (*get_error_string)(int) = nullptr;
  int (*get_num_supported_archs)(int*) = nullptr;
  int (*get_supported_archs)(int*) = nullptr;
  int (*create)(void**, const char*, const char*, int, const char* const*,
                const char* const*) = nullptr;
  int (*destroy)(void**) = nullptr;
  int (*compile)(void*, int, const char* const*) = nullptr;
  int (*get_cubin_size)(void*, size_t*) = nullptr;
  int (*get_cubin)(void*, char*) = nullptr;
  int (*get_log_size)(void*, size_t*) = nullptr;
  int (*get_log)(void*, char*) = nullptr;
};

Nvrtc::Nvrtc() : functions_(std::make_unique<Functions>()) {}

Nvrtc::~Nvrtc() = default;

std::vector<std::string> Nvrtc::Places(const std::function<std::string(const char*)>& environment) {
  const std::string named = environment("VOXELD_NVRTC");
  if (named == "off") return {};
  std::vector<std::string> places;
  if (!named.empty()) places.push_back(named);
  places.insert(places.end(), {"libnvrtc.so.13", "libnvrtc.so.12", "libnvrtc.so",
                               "/usr/local/cuda/lib64/libnvrtc.so"});
  return places;
}

absl::StatusOr<std::shared_ptr<const Nvrtc>> Nvrtc::Open(const std::vector<std::string>& places) {
  if (places.empty()) return absl::FailedPreconditionError("VOXELD_NVRTC is 'off'");
  std::shared_ptr<Nvrtc> nvrtc(new Nvrtc());
  Functions& functions = *nvrtc->functions_;
  const WantedFunction wanted[] = {
      {"nvrtcGetErrorString", functions.get_error_string},
      {"nvrtcGetNumSupportedArchs", functions.get_num_supported_archs},
      {"nvrtcGetSupportedArchs", functions.get_supported_archs},
      {"nvrtcCreateProgram", functions.create},
      {"nvrtcDestroyProgram", functions.destroy},
      {"nvrtcCompileProgram", functions.compile},
      {"nvrtcGetCUBINSize", functions.get_cubin_size},
      {"nvrtcGetCUBIN", functions.get_cubin},
      {"nvrtcGetProgramLogSize", functions.get_log_size},
      {"nvrtcGetProgramLog", functions.get_log},
  };
  absl::StatusOr<std::string> place = OpenLibrary("NVRTC", places, wanted);
  if (!place.ok()) return place.status();
  nvrtc->place_ = *std::move(place);
  return nvrtc;
}

absl::StatusOr<std::shared_ptr<const Nvrtc>> Nvrtc::OpenFor(const std::vector<std::string>& places,
                                                            int major, int minor) {
  if (places.empty()) return Open(places);
  std::vector<std::string> why;
  for (const std::string& place : places) {
    absl::StatusOr<std::shared_ptr<const Nvrtc>> opened = Open({place});
    const absl::Status status = opened.ok() ? (*opened)->Supports(major, minor) : opened.status();
    if (status.ok()) return opened;
    why.emplace_back(status.message());
  }
  return absl::FailedPreconditionError(absl::StrJoin(why, "; "));
}

absl::StatusOr<std::shared_ptr<const Nvrtc>> Nvrtc::OpenFor(int major, int minor) {
  return OpenFor(Places(Environment), major, minor);
}

absl::Status Nvrtc::Supports(int major, int minor) const {
  int count = 0;
  int result = functions_->get_num_supported_archs(&count);
  std::vector<int> archs(static_cast<size_t>(std::max(count, 0)));
  if (result == kSuccess) result = functions_->get_supported_archs(archs.data());
  if (result != kSuccess) {
    return absl::FailedPreconditionError(absl::StrCat("nvrtcGetSupportedArchs (", place_,
                                                      "): ", functions_->get_error_string(result)));
  }
  if (std::find(archs.begin(), archs.end(), major * 10 + minor) != archs.end()) return {};
  return absl::FailedPreconditionError(
      absl::StrCat(place_, " compiles nothing for compute capability ", major, ".", minor,
                   "; install that of a CUDA that does, or name it by VOXELD_NVRTC"));
}

absl::StatusOr<std::string> Nvrtc::Compile(const std::string& source,
                                           std::span<const NamedSource> sources, int major,
                                           int minor) const {
  std::vector<const char*> names, texts;
  for (const NamedSource& named : sources) {
    names.push_back(named.name);
    texts.push_back(named.text);
  }
  void* program = nullptr;
  int result = functions_->create(&program, source.c_str(), "formula.cu",
                                  static_cast<int>(names.size()), texts.data(), names.data());
  const auto failed = [&](const char* what) {
    return absl::StrCat(what, " (", place_, "): ", functions_->get_error_string(result));
  };
  if (result != kSuccess) return absl::InternalError(failed("nvrtcCreateProgram"));
  const std::unique_ptr<void*, int (*)(void**)> owner(&program, functions_->destroy);
  const std::string architecture = absl::StrCat("--gpu-architecture=sm_", major, minor);
  const char* const options[] = {architecture.c_str(), "--std=c++20",      "--fmad=false",
                                 "--prec-div=true",    "--prec-sqrt=true", "--ftz=false"};
  result = functions_->compile(program, static_cast<int>(std::size(options)), options);
  size_t size = 0;
  if (result == kErrorOfTheSource && functions_->get_log_size(program, &size) == kSuccess) {
    std::string log(size, '\0');
    functions_->get_log(program, log.data());
    return absl::InvalidArgumentError(
        absl::StrCat(failed("nvrtcCompileProgram"), ": ", log.substr(0, kMostOfTheLog).c_str()));
  }
  if (result != kSuccess) return absl::InternalError(failed("nvrtcCompileProgram"));
  result = functions_->get_cubin_size(program, &size);
  std::string module(size, '\0');
  if (result == kSuccess) result = functions_->get_cubin(program, module.data());
  if (result != kSuccess) return absl::InternalError(failed("nvrtcGetCUBIN"));
  return module;
}

}  // namespace voxeld::gpu::cuda
