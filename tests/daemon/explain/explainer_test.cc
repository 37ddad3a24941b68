#include "daemon/explain/explainer.h"

#include <gtest/gtest.h>

#include <future>
#include <vector>

namespace voxeld::daemon {
namespace {

TEST(ExplainerThread, OneAfterAnotherAndNoMoreThanMayWait) {
  std::promise<void> begun, go_on;
  std::vector<int> done;
  std::promise<void> last;
  ExplainerThread thread(2);
  ASSERT_TRUE(thread.Post([&](const std::atomic<bool>&) {
    begun.set_value();
    go_on.get_future().wait();
    done.push_back(0);
  }));
  begun.get_future().wait();
  EXPECT_TRUE(thread.Post([&](const std::atomic<bool>&) { done.push_back(1); }));
  EXPECT_TRUE(thread.Post([&](const std::atomic<bool>&) {
    done.push_back(2);
    last.set_value();
  }));
  EXPECT_FALSE(thread.Post([&](const std::atomic<bool>&) { done.push_back(3); }));
  go_on.set_value();
  last.get_future().wait();
  EXPECT_EQ(done, std::vector<int>({0, 1, 2}));
}

TEST(ExplainerThread, EndsWhatIsUnderWayAndDropsTheRest) {
  std::promise<void> begun;
  bool later = false, told = false;
  {
    ExplainerThread thread(2);
    ASSERT_TRUE(thread.Post([&](const std::atomic<bool>& stopping) {
      begun.set_value();
      while (!stopping) std::this_thread::yield();
      told = true;
    }));
    begun.get_future().wait();
    ASSERT_TRUE(thread.Post([&](const std::atomic<bool>&) { later = true; }));
  }
  EXPECT_TRUE(told);
  EXPECT_FALSE(later);
}

}  // namespace
}  // namespace voxeld::daemon
