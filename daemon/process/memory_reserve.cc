#include "daemon/process/memory_reserve.h"

#include <cxxabi.h>
#include <malloc.h>
#include <sched.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>
#include <string_view>

#include "daemon/process/last_words.h"
#include "gpu/want_of_memory.h"

namespace voxeld::daemon {
namespace {

constinit MemoryReserve of_process;

// Parts that anybody has given up since this thread looked last are worth another attempt of it.
constinit thread_local uint64_t seen = 0;

// Nothing if there is no memory for it. Written to, since some systems promise what they do not have.
void* MapPart() {
  void* part = mmap(nullptr, MemoryReserve::kPartBytes, PROT_READ | PROT_WRITE,
                    MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (part == MAP_FAILED) return nullptr;
  std::memset(part, 1, MemoryReserve::kPartBytes);
  return part;
}

void SayThatMemoryEnded(size_t bytes) noexcept {
  constexpr std::string_view kBefore = "voxeld: out of memory: there are no ";
  constexpr std::string_view kAfter = " bytes to be had, and the reserve is used up or too small\n";
  std::array<char, 160> line;
  char* at = std::copy(kBefore.begin(), kBefore.end(), line.data());
  at = std::to_chars(at, line.data() + line.size(), bytes).ptr;
  at = std::copy(kAfter.begin(), kAfter.end(), at);
  SayAtOnce({line.data(), static_cast<size_t>(at - line.data())});
}

[[noreturn]] void End() {
  SayAtOnce(
      "voxeld: it cannot go on without memory, and is ended; what was told to be durable is "
      "kept\n");
  _exit(1);
}

void OnWant() {
  if (gpu::WantOfMemory::IsCaught()) throw std::bad_alloc();
  End();
}

std::terminate_handler others_end = nullptr;

[[noreturn]] void OnTerminate() {
  if (abi::__cxa_current_exception_type() != nullptr) {
    try {
      throw;
    } catch (const std::bad_alloc&) {
      End();
    } catch (...) {  // told below
    }
  }
  others_end();
  std::abort();
}

}  // namespace

MemoryReserve& MemoryReserve::OfProcess() { return of_process; }

bool MemoryReserve::Fill(size_t bytes) {
  const size_t wanted = std::min((bytes + kPartBytes - 1) / kPartBytes, kMostParts);
  wanted_ = wanted;
  bool trimmed = false;
  for (size_t i = 0; i < wanted; ++i) {
    if (parts_[i] != nullptr) continue;
    void* part = MapPart();
#ifdef __GLIBC__
    if (part == nullptr && !trimmed) {
      trimmed = true;
      malloc_trim(0);  // what the allocator keeps for later is worth less than the reserve
      part = MapPart();
    }
#endif
    if (part == nullptr) return false;
    ++held_;  // first: somebody may give it up at once
    parts_[i] = part;
  }
  said_ = false;
  return true;
}

bool MemoryReserve::GiveUpOne() noexcept {
  ++giving_;
  bool given = false;
  for (std::atomic<void*>& part : parts_) {
    void* const memory = part.load() == nullptr ? nullptr : part.exchange(nullptr);
    if (memory == nullptr) continue;
    --held_;
    munmap(memory, kPartBytes);
    ++given_;
    given = true;
    break;
  }
  --giving_;
  return given;
}

bool MemoryReserve::Help(size_t bytes, unsigned attempt) noexcept {
  const int before = errno;
  if (attempt == 0) {
    ++failed_;
    last_bytes_ = bytes;
  }
  // What is larger than all of it cannot be helped by it.
  const size_t held = held_.load();
  bool help = held > 0 && bytes <= held * kPartBytes && GiveUpOne();
  if (!help && giving_.load() > 0) {
    sched_yield();
    help = true;
  }
  if (const uint64_t given = given_.load(); given != seen) {
    seen = given;
    help = true;
  }
#ifdef __GLIBC__
  if (!help && attempt == 0) {
    malloc_trim(0);
    help = true;
  }
#endif
  if (!help) {
    ++refused_;
    if (!said_.exchange(true)) SayThatMemoryEnded(bytes);
  }
  errno = before;
  return help;
}

MemoryReserve::Figures MemoryReserve::figures() const noexcept {
  return {.failed = failed_,
          .refused = refused_,
          .last_bytes = last_bytes_,
          .wanted_bytes = wanted_ * kPartBytes,
          .held_bytes = held_ * kPartBytes};
}

void EndWhenMemoryEnds() {
  if (std::get_terminate() == &OnTerminate) return;
  std::set_new_handler(&OnWant);
  others_end = std::set_terminate(&OnTerminate);
}

}  // namespace voxeld::daemon
