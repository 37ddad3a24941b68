// What wants a thread's stack and has no memory for it is in children; else the system refuses threads as it is told to.
#include "daemon/process/spare_threads.h"

#include <gtest/gtest.h>
#include <pthread.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <fstream>
#include <system_error>
#include <thread>

#include "tests/refused_calls.h"

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

class SpareThreadsTest : public ::testing::Test {
 protected:
  ~SpareThreadsTest() override { SpareThreads::End(); }
  uint64_t taken() const { return SpareThreads::taken() - before_; }

 private:
  const uint64_t before_ = SpareThreads::taken();
};

TEST_F(SpareThreadsTest, WhatIsRefusedOnceIsAskedForAgainAndTakesNone) {
  ASSERT_TRUE(SpareThreads::Begin(1).ok());
  const RefusedCalls refused(SystemCall::kPthreadCreate, EAGAIN);
  EXPECT_TRUE(ThreadRuns());
  EXPECT_EQ(refused.made(), 2);
  EXPECT_EQ(taken(), 0u);
  EXPECT_EQ(SpareThreads::waiting(), 1);
}

TEST_F(SpareThreadsTest, WhatIsRefusedTwiceTakesOneAndItIsMissed) {
  ASSERT_TRUE(SpareThreads::Begin(2).ok());
  SpareThreads::Refill();
  {
    const RefusedCalls refused(SystemCall::kPthreadCreate, EAGAIN, 2);
    EXPECT_TRUE(ThreadRuns());
    EXPECT_EQ(refused.made(), 2);
  }
  EXPECT_EQ(taken(), 1u);
  EXPECT_EQ(SpareThreads::waiting(), 1);
  EXPECT_EQ(SpareThreads::Refill(), 1u);
  EXPECT_EQ(SpareThreads::waiting(), 2);
  EXPECT_EQ(SpareThreads::Refill(), 0u);
}

TEST_F(SpareThreadsTest, WithNoneInHandWhatIsRefusedTwiceIsNone) {
  const RefusedCalls refused(SystemCall::kPthreadCreate, EAGAIN, 2);
  EXPECT_FALSE(ThreadRuns());
  EXPECT_EQ(refused.made(), 2);
  EXPECT_EQ(taken(), 0u);
}

TEST_F(SpareThreadsTest, WhatFailsOtherwiseIsNotAskedForAgain) {
  ASSERT_TRUE(SpareThreads::Begin(1).ok());
  const RefusedCalls refused(SystemCall::kPthreadCreate, EPERM);
  EXPECT_FALSE(ThreadRuns());
  EXPECT_EQ(refused.made(), 1);
  EXPECT_EQ(taken(), 0u);
}

TEST_F(SpareThreadsTest, OneThatIsTakenIsAsItsAttributesSay) {
  ASSERT_TRUE(SpareThreads::Begin(2).ok());
  const RefusedCalls refused(SystemCall::kPthreadCreate, EAGAIN, 4);
  for (const int state : {PTHREAD_CREATE_JOINABLE, PTHREAD_CREATE_DETACHED}) {
    pthread_attr_t attributes;
    pthread_attr_init(&attributes);
    pthread_attr_setdetachstate(&attributes, state);
    std::atomic<int> answer = 0;
    pthread_t thread;
    ASSERT_EQ(pthread_create(&thread, &attributes, Answer, &answer), 0);
    pthread_attr_destroy(&attributes);
    if (state == PTHREAD_CREATE_JOINABLE) {
      EXPECT_EQ(pthread_join(thread, nullptr), 0);
      EXPECT_EQ(answer, 4711);
    }
    while (answer != 4711) std::this_thread::yield();
  }
  EXPECT_EQ(taken(), 2u);
}

TEST_F(SpareThreadsTest, AllThatWereAskedForAreInHandOrNone) {
  const RefusedCalls refused(SystemCall::kPthreadCreate, EAGAIN);
  EXPECT_TRUE(absl::IsResourceExhausted(SpareThreads::Begin(3)));
  EXPECT_EQ(refused.made(), 1);
  EXPECT_EQ(SpareThreads::waiting(), 0);
  EXPECT_TRUE(SpareThreads::Begin(2).ok());
  EXPECT_TRUE(SpareThreads::Begin(3).ok());
  EXPECT_EQ(refused.made(), 4) << "those that wait are not begun again";
  EXPECT_EQ(SpareThreads::waiting(), 3);
}

}  // namespace
}  // namespace voxeld::daemon
