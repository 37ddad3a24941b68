#include "tests/gpu/simt/grid.h"

#include <array>
#include <atomic>
#include <boost/context/fiber.hpp>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <mutex>
#include <random>
#include <thread>
#include <vector>

#include "tests/gpu/simt/limits.h"

namespace voxeld::simt {
namespace {

constexpr uint32_t kWarp = 32;
constexpr size_t kStack = size_t{256} << 10;

[[noreturn]] void Stop(const char* what) {
  std::fprintf(stderr, "simt: %s\n", what);
  std::abort();
}

// Stacks that are reused: a grid has a fiber for each of its threads.
struct Stacks {
  boost::context::stack_context allocate() {
    boost::context::stack_context stack;
    if (free_.empty()) {
      free_.push_back(std::make_unique_for_overwrite<std::byte[]>(kStack));
    }
    stack.size = kStack;
    stack.sp = free_.back().release() + kStack;
    free_.pop_back();
    return stack;
  }
  void deallocate(boost::context::stack_context& stack) {
    free_.emplace_back(static_cast<std::byte*>(stack.sp) - kStack);
  }

 private:
  std::vector<std::unique_ptr<std::byte[]>> free_;
};

// Stacks that no grid is using.
class StackStore {
 public:
  std::unique_ptr<Stacks> Take() {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) return std::make_unique<Stacks>();
    std::unique_ptr<Stacks> stacks = std::move(free_.back());
    free_.pop_back();
    return stacks;
  }
  void GiveBack(std::unique_ptr<Stacks> stacks) {
    const std::lock_guard lock(mutex_);
    free_.push_back(std::move(stacks));
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<Stacks>> free_;
};
StackStore stack_store;

struct StackAllocator {
  Stacks* stacks;
  boost::context::stack_context allocate() { return stacks->allocate(); }
  void deallocate(boost::context::stack_context& stack) { stacks->deallocate(stack); }
};

enum class Waits : uint8_t { kNot, kForBlock, kForLanes, kEnded };

struct Thread {
  boost::context::fiber itself, caller;
  Place place;
  uint32_t number = 0;
  Waits waits = Waits::kNot;
  uint32_t mask = 0;  // the lanes for which it waits
  uint64_t value = 0;
  std::array<uint64_t, kWarp> seen;
  std::vector<std::function<void()>> later;
};

// The block that a thread of the processor runs.
class Block {
 public:
  Block(const Grid& grid, const std::function<void()>& body, uint64_t seed)
      : grid_(grid),
        body_(body),
        random_(seed),
        count_(grid.threads.x * grid.threads.y * grid.threads.z),
        shared_(std::make_unique_for_overwrite<std::byte[]>(grid.shared + 16)),
        threads_(count_) {
    std::memset(shared_.get(), 0xA5, grid.shared);
  }
  ~Block() {
    threads_.clear();
    stack_store.GiveBack(std::move(stacks_));
  }

  void Run(dim3 at) {
    ready_.resize(count_);
    left_ = count_;
    arrived_ = 0;
    for (uint32_t i = 0; i < count_; ++i) {
      Begin(i, at);
      ready_[i] = i;
    }
    current_block = this;
    while (!ready_.empty()) {
      std::swap(ready_[random_() % ready_.size()], ready_.back());
      Thread& next = threads_[ready_.back()];
      ready_.pop_back();
      current = &next;
      next.itself = std::move(next.itself).resume();
    }
    current = nullptr;
    current_block = nullptr;
    if (left_ != 0) TellWhoWaits();
  }

  void* shared() const { return shared_.get(); }

  bool WaitForBlock(bool value) {
    any_ |= value;
    ++arrived_;
    Thread& self = *current;
    self.waits = Waits::kForBlock;
    if (!EndBarrier()) Suspend(self);
    return self.value != 0;
  }

  const uint64_t* Exchange(uint32_t mask, uint64_t value) {
    Thread& self = *current;
    if ((mask >> self.number % kWarp & 1) == 0) Stop("a lane waits for others and not for itself");
    self.waits = Waits::kForLanes;
    self.mask = mask;
    self.value = value;
    if (!EndExchange(self)) Suspend(self);
    return self.seen.data();
  }

  static thread_local Thread* current;
  static thread_local Block* current_block;

 private:
  void Begin(uint32_t number, dim3 at) {
    Thread& thread = threads_[number];
    const dim3 size = grid_.threads;
    thread.number = number;
    thread.waits = Waits::kNot;
    thread.place = {dim3(number % size.x, number / size.x % size.y, number / size.x / size.y), at,
                    size, grid_.blocks};
    thread.itself = boost::context::fiber(std::allocator_arg, StackAllocator{stacks_.get()},
                                          [this, &thread](boost::context::fiber&& caller) {
                                            thread.caller = std::move(caller);
                                            body_();
                                            End(thread);
                                            return std::move(thread.caller);
                                          });
  }

  void End(Thread& thread) {
    thread.later.clear();
    thread.waits = Waits::kEnded;
    --left_;
    EndBarrier();
  }

  static void Suspend(Thread& self) { self.caller = std::move(self.caller).resume(); }

  // Does not wait for threads that have ended. Returns true if the calling thread, which has
  // arrived, may continue.
  bool EndBarrier() {
    if (arrived_ == 0 || arrived_ < left_) return false;
    for (Thread& thread : threads_) {
      if (thread.waits != Waits::kForBlock) continue;
      thread.value = any_;
      GoOn(thread);
    }
    arrived_ = 0;
    any_ = false;
    return true;
  }

  bool EndExchange(const Thread& self) {
    const uint32_t first = self.number / kWarp * kWarp;
    for (uint32_t lane = 0; lane < kWarp; ++lane) {
      if ((self.mask >> lane & 1) == 0) continue;
      if (first + lane >= count_) {
        // In a warp that is not full, missing lanes are not waited for.
        continue;
      }
      const Thread& other = threads_[first + lane];
      if (other.waits == Waits::kEnded) Stop("lanes wait for one that has ended");
      if (other.waits != Waits::kForLanes) return false;
      if (other.mask != self.mask) {
        if ((other.mask & self.mask) != 0 && (other.mask >> self.number % kWarp & 1) != 0) {
          Stop("lanes wait for each other with masks that differ");
        }
        return false;
      }
    }
    std::array<uint64_t, kWarp> values{};
    for (uint32_t lane = 0; lane < kWarp && first + lane < count_; ++lane) {
      values[lane] = threads_[first + lane].value;
    }
    for (uint32_t lane = 0; lane < kWarp && first + lane < count_; ++lane) {
      if ((self.mask >> lane & 1) == 0) continue;
      threads_[first + lane].seen = values;
      GoOn(threads_[first + lane]);
    }
    return true;
  }

  void GoOn(Thread& thread) {
    thread.waits = Waits::kNot;
    if (&thread != current) ready_.push_back(thread.number);
  }

  [[noreturn]] void TellWhoWaits() const {
    for (const Thread& thread : threads_) {
      if (thread.waits == Waits::kEnded) continue;
      std::fprintf(stderr, "simt: thread %u of block %u waits for %s %08X\n", thread.number,
                   thread.place.block.x, thread.waits == Waits::kForBlock ? "its block" : "lanes",
                   thread.mask);
    }
    Stop("threads wait for others that never come");
  }

  const Grid& grid_;
  const std::function<void()>& body_;
  std::minstd_rand random_;
  const uint32_t count_;
  const std::unique_ptr<std::byte[]> shared_;
  std::unique_ptr<Stacks> stacks_ = stack_store.Take();
  std::vector<Thread> threads_;
  std::vector<uint32_t> ready_;
  uint32_t left_ = 0, arrived_ = 0;
  bool any_ = false;
};

thread_local Thread* Block::current = nullptr;
thread_local Block* Block::current_block = nullptr;

}  // namespace

const Place& Here() { return Block::current->place; }
uint32_t Lane() { return Block::current->number % kWarp; }
void* DynamicShared() { return Block::current_block->shared(); }
bool WaitForBlock(bool value) { return Block::current_block->WaitForBlock(value); }
const uint64_t* Exchange(uint32_t mask, uint64_t value) {
  return Block::current_block->Exchange(mask, value);
}
void Later(std::function<void()> work) { Block::current->later.push_back(std::move(work)); }
void DoLater() {
  for (const std::function<void()>& work : Block::current->later) work();
  Block::current->later.clear();
}
void AskedOfNobody(uint32_t mask, uint32_t lane) {
  std::fprintf(stderr, "simt: lane %u is asked for a value, mask %08X\n", lane, mask);
  Stop("a value is asked of a lane that does not take part");
}

void Run(const Grid& grid, const std::function<void()>& body) {
  if (!IsAllowed(grid)) return;
  static std::atomic<uint64_t> launches{Seed()};
  const uint64_t seed = launches += 2;
  const uint64_t blocks =
      static_cast<uint64_t>(grid.blocks.x) * grid.blocks.y * static_cast<uint64_t>(grid.blocks.z);
  std::atomic<uint64_t> next{0};
  const auto run_some = [&](uint64_t own_seed) {
    Block block(grid, body, own_seed);
    for (uint64_t b = next++; b < blocks; b = next++) {
      block.Run(dim3(static_cast<uint32_t>(b % grid.blocks.x),
                     static_cast<uint32_t>(b / grid.blocks.x % grid.blocks.y),
                     static_cast<uint32_t>(b / grid.blocks.x / grid.blocks.y)));
    }
  };
  if (blocks == 1) return run_some(seed);
  std::thread beside([&] { run_some(seed + 1); });
  run_some(seed);
  beside.join();
}

}  // namespace voxeld::simt
