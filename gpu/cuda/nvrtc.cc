#include "gpu/cuda/nvrtc.h"

#include <dlfcn.h>

#include <cstdlib>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace voxeld::gpu::cuda {
namespace {

constexpr int kSuccess = 0;             // NVRTC_SUCCESS
constexpr int kErrorOfTheSource = 6;    // NVRTC_ERROR_COMPILATION
constexpr size_t kMostOfTheLog = 2000;  // bytes of it that are told

}  // namespace

struct Nvrtc::Functions {
  const char* (*get_error_string)(int) = nullptr;
  int (*create)(void**, const char*, const char*, int, const char* const*,
                const char* const*) = nullptr;
  int (*destroy)(void**) = nullptr;
  int (*compile)(void*, int, const char* const*) = nullptr;
  int (*get_cubin_size)(void*, size_t*) = nullptr;
  int (*get_cubin)(void*, char*) = nullptr;
  int (*get_log_size)(void*, size_t*) = nullptr;
  int (*get_log)(void*, char*) = nullptr;
};

Nvrtc::Nvrtc(void* library, std::string place)
    : library_(library), place_(std::move(place)), functions_(std::make_unique<Functions>()) {}

// It may have threads: it is not closed.
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
  std::vector<std::string> why;
  for (const std::string& place : places) {
    void* const library = dlopen(place.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) {
      const char* const error = dlerror();  // begins with the name
      why.push_back(error != nullptr ? error : absl::StrCat(place, ": cannot be opened"));
      continue;
    }
    std::shared_ptr<Nvrtc> nvrtc(new Nvrtc(library, place));
    const absl::Status status = nvrtc->Find();
    if (status.ok()) return nvrtc;
    dlclose(library);
    why.emplace_back(status.message());
  }
  return absl::FailedPreconditionError(
      absl::StrCat("NVRTC is not to be had; tried ", absl::StrJoin(why, "; ")));
}

absl::StatusOr<std::shared_ptr<const Nvrtc>> Nvrtc::Open() {
  return Open(Places([](const char* name) -> std::string {
    const char* const value = std::getenv(name);
    return value != nullptr ? value : "";
  }));
}

absl::Status Nvrtc::Find() {
  absl::Status status;
  const auto find = [&](const char* name, auto& function) {
    void* const found = dlsym(library_, name);
    if (found == nullptr && status.ok()) {
      status = absl::FailedPreconditionError(absl::StrCat(place_, ": has no ", name));
    }
    static_assert(sizeof(function) == sizeof(found));
    std::memcpy(&function, &found, sizeof(found));
  };
  find("nvrtcGetErrorString", functions_->get_error_string);
  find("nvrtcCreateProgram", functions_->create);
  find("nvrtcDestroyProgram", functions_->destroy);
  find("nvrtcCompileProgram", functions_->compile);
  find("nvrtcGetCUBINSize", functions_->get_cubin_size);
  find("nvrtcGetCUBIN", functions_->get_cubin);
  find("nvrtcGetProgramLogSize", functions_->get_log_size);
  find("nvrtcGetProgramLog", functions_->get_log);
  return status;
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
