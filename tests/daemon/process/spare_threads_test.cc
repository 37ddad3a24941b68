// In children, which can be left without memory for a thread's stack.
#include "daemon/process/spare_threads.h"

#include <gtest/gtest.h>
#include <pthread.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <fstream>
#include <system_error>
#include <thread>

namespace voxeld::daemon {
namespace {

constexpr rlim_t kLessThanAStack = 64 << 10;

// What this process may still take is less than a stack, or all that the system has.
void LimitMemory(bool limited) {
  uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  const rlim_t now = pages * static_cast<uint64_t>(getpagesize()) + kLessThanAStack;
  const rlimit limit = {limited ? now : RLIM_INFINITY, RLIM_INFINITY};
  if (setrlimit(RLIMIT_AS, &limit) != 0) _exit(9);
}

bool ThreadRuns() {
  std::atomic<int> ran = 0;
  try {
    std::thread thread([&ran] { ran = 4711; });
    thread.join();
  } catch (const std::system_error&) {
    return false;
  }
  return ran == 4711;
}

// Its exit status tells the line that did not hold.
#define HOLDS(condition) \
  if (!(condition)) _exit(100 + __LINE__ % 100)

void NoneInHand() {
  LimitMemory(true);
  HOLDS(!ThreadRuns());
  _exit(0);
}

// At once, as a thread that has ended leaves its stack to the next.
void TwoInHand() {
  HOLDS(SpareThreads::Begin(2).ok());
  HOLDS(SpareThreads::waiting() == 2 && SpareThreads::taken() == 0);
  LimitMemory(true);
  {
    std::atomic<bool> go = false;
    std::atomic<int> ran = 0;
    const auto run = [&] {
      go.wait(false);
      ++ran;
    };
    std::thread first(run), second(run);
    HOLDS(SpareThreads::waiting() == 0 && SpareThreads::taken() == 2);
    HOLDS(!ThreadRuns());
    HOLDS(SpareThreads::Refill() == 2);  // were taken, and they cannot be had
    HOLDS(SpareThreads::waiting() == 0);
    LimitMemory(false);
    HOLDS(SpareThreads::Refill() == 0);
    HOLDS(SpareThreads::waiting() == 2);
    HOLDS(ThreadRuns());  // by the system
    HOLDS(SpareThreads::waiting() == 2 && SpareThreads::taken() == 2);
    go = true;
    go.notify_all();
    first.join();
    second.join();
    HOLDS(ran == 2);
  }
  SpareThreads::End();
  HOLDS(SpareThreads::waiting() == 0);
  _exit(0);
}

void* Answer(void* argument) {
  *static_cast<std::atomic<int>*>(argument) = 4711;
  return nullptr;
}

void Detached() {
  HOLDS(SpareThreads::Begin(1).ok());
  LimitMemory(true);
  std::atomic<int> answer = 0;
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setdetachstate(&attributes, PTHREAD_CREATE_DETACHED);
  pthread_t thread;
  HOLDS(pthread_create(&thread, &attributes, Answer, &answer) == 0);
  while (answer != 4711) std::this_thread::yield();
  _exit(0);
}

void AsMany() {
  LimitMemory(true);
  const absl::Status status = SpareThreads::Begin(SpareThreads::kMost);
  HOLDS(absl::IsResourceExhausted(status));
  HOLDS(SpareThreads::waiting() == 0);
  _exit(0);
}

TEST(SpareThreadsDeathTest, WithoutThemAThreadThatCannotBeHadIsNone) {
  EXPECT_EXIT(NoneInHand(), ::testing::ExitedWithCode(0), "");
}

TEST(SpareThreadsDeathTest, StandInForThoseThatCannotBeHad) {
  EXPECT_EXIT(TwoInHand(), ::testing::ExitedWithCode(0), "");
}

TEST(SpareThreadsDeathTest, AreDetachedAsIsAsked) {
  EXPECT_EXIT(Detached(), ::testing::ExitedWithCode(0), "");
}

TEST(SpareThreadsDeathTest, AreRefusedWhereTheyCannotBeHad) {
  EXPECT_EXIT(AsMany(), ::testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace voxeld::daemon
