#include "daemon/play/worker.h"

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "tests/daemon/play/no_threads.h"

namespace voxeld::daemon::play {
namespace {

// An event for which a thread waits until another one reports it.
class Event {
 public:
  void Set() {
    const sync::MutexLock lock(mutex_);
    set_ = true;
    changed_.NotifyAll();
  }
  void Await() {
    const sync::MutexLock lock(mutex_);
    while (!set_) changed_.Wait(mutex_);
  }

 private:
  sync::Mutex mutex_;
  sync::CondVar changed_;
  bool set_ VOXELD_GUARDED_BY(mutex_) = false;
};

TEST(Worker, DoesInOrderOnOneThreadOfItsOwn) {
  std::vector<int> done;
  std::vector<std::thread::id> threads;
  Event last;
  Worker worker;
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(worker
                    .Post([&, i] {
                      done.push_back(i);
                      threads.push_back(std::this_thread::get_id());
                      if (i == 9) last.Set();
                    })
                    .ok());
  }
  last.Await();
  EXPECT_EQ(done, (std::vector<int>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9}));
  EXPECT_EQ(threads, std::vector<std::thread::id>(10, threads[0]));
  EXPECT_NE(threads[0], std::this_thread::get_id());
}

// When the worker is destroyed, a task under way, such as one on a disk that does not answer, is
// waited for; waiting tasks are discarded before that.
TEST(Worker, DropsWhatHasNotBegunAtItsEnd) {
  Event began, dropped, ended;
  bool finished = false, done = false;
  std::optional<Worker> worker(std::in_place);
  ASSERT_TRUE(worker
                  ->Post([&] {
                    began.Set();
                    ended.Await();
                    finished = true;
                  })
                  .ok());
  began.Await();
  std::shared_ptr<void> owned(nullptr, [&](void*) { dropped.Set(); });
  ASSERT_TRUE(worker->Post([&done, owned] { done = true; }).ok());
  owned.reset();
  EXPECT_EQ(worker->waiting(), 1u);
  std::thread end([&] { worker.reset(); });
  dropped.Await();
  ended.Set();
  end.join();
  EXPECT_TRUE(finished);
  EXPECT_FALSE(done);
}

TEST(Worker, NeedsNoThreadBeforeTheFirst) {
  Event done;
  bool wrong = false;
  Worker worker;
  {
    const NoThreads none;
    const Worker idle;
    const absl::Status status = worker.Post([&] { wrong = true; });
    EXPECT_TRUE(absl::IsResourceExhausted(status)) << status;
    EXPECT_EQ(worker.waiting(), 0u);
  }
  EXPECT_TRUE(worker.Post([&] { done.Set(); }).ok()) << "there is one now";
  done.Await();
  EXPECT_FALSE(wrong);
}

}  // namespace
}  // namespace voxeld::daemon::play
