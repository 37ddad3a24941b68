// Memory for when the system has none left: taken at the start, given up bit by bit to allocations that failed, and taken
// back when there is some again. Every allocation of the process, of libraries in C too, comes by it (allocations.cc).
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace voxeld::daemon {

// Thread-safe. Without a destructor, so that one may outlive everything: what it holds stays until the process ends.
class MemoryReserve {
 public:
  // More than the allocator asks the system for at once (process.cc), or one part would be of no use to it.
  static constexpr size_t kPartBytes = size_t{2} << 20;
  static constexpr size_t kMostParts = 64;

  struct Figures {
    uint64_t failed = 0;      // allocations that the system had no memory for, at first
    uint64_t refused = 0;     // of them those that there was no memory for in the end
    uint64_t last_bytes = 0;  // what the last of them asked for
    uint64_t wanted_bytes = 0, held_bytes = 0;
  };

  constexpr MemoryReserve() = default;
  MemoryReserve(const MemoryReserve&) = delete;
  MemoryReserve& operator=(const MemoryReserve&) = delete;

  // The one of this process. Holds nothing until it is filled.
  static MemoryReserve& OfProcess();

  // Holds as many bytes as `bytes`, rounded up to whole parts, kMostParts at most, faulted in: so that they are there, whatever
  // the system promises. True if it has them all. Any thread, one at a time; not from within an allocation.
  bool Fill(size_t bytes);

  // An allocation of `bytes` has failed for the n-th time (`attempt`, from 0). True: it is worth another attempt, since part of
  // the reserve, or what the allocator kept, went back to the system. False: there is nothing left that could help, and a
  // line on standard error says so, once until the reserve is whole again. Never for ever, however many threads ask. Allocates
  // nothing, takes no lock of ours, keeps errno.
  bool Help(size_t bytes, unsigned attempt) noexcept;

  Figures figures() const noexcept;

 private:
  bool GiveUpOne() noexcept;

  std::array<std::atomic<void*>, kMostParts> parts_ = {};
  std::atomic<size_t> held_ = 0, wanted_ = 0;  // parts
  std::atomic<uint32_t> giving_ = 0;           // calls that are about to give one up
  std::atomic<uint64_t> given_ = 0;            // parts, ever
  std::atomic<uint64_t> failed_ = 0, refused_ = 0, last_bytes_ = 0;
  std::atomic<bool> said_ = false;
};

// In programs that allocate by the reserve this is so before their main begins. From now on want of memory ends the process at once, with status 1 and a line on standard error: where operator new finds none
// in the end and nobody has said that it copes (gpu/want_of_memory.h), and where a std::bad_alloc is caught by nobody. Uncaught
// exceptions of other kinds end it as before.
void EndWhenMemoryEnds();

}  // namespace voxeld::daemon
