// Core's threads: start, stop within a limit, and a simulation's steps.
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "daemon/core/core_impl.h"

namespace voxeld::daemon {
namespace {

constexpr int kAsideNice = 10;

}  // namespace

Core::Impl::Impl(CoreOptions options, sync::Clock& clock)
    : options_(std::move(options)),
      clock_(clock),
      started_ns_(clock.Now()),
      loop_(std::make_shared<Loop>(clock)),
      retired_(options_.threads ? std::make_shared<Loop>(clock) : loop_),
      aside_(std::make_shared<Loop>(clock)),
      store_(options_.limits),
      published_(store_.snapshot()),
      budget_(std::make_shared<Budget>(options_.limits.max_memory_bytes)),
      scene_watch_(published_) {}

void Core::Impl::Launch(std::string name, std::function<void()> body) {
  {
    sync::MutexLock lock(running_->mutex);
    running_->names.insert(name);
  }
  std::thread thread([body = std::move(body), name, running = running_]() mutable {
    body();
    body = nullptr;  // what it keeps alive ends before the thread counts as ended
    sync::MutexLock lock(running->mutex);
    running->names.erase(name);
    running->changed.NotifyAll();
  });
  threads_.push_back({std::move(name), std::move(thread)});
}

std::set<std::string> Core::Impl::AwaitEnd(const std::set<std::string>& names,
                                           sync::TimeNs deadline) {
  sync::MutexLock lock(running_->mutex);
  for (;;) {
    std::set<std::string> left;
    std::set_intersection(names.begin(), names.end(), running_->names.begin(),
                          running_->names.end(), std::inserter(left, left.end()));
    if (left.empty() || clock_.Now() >= deadline) return left;
    clock_.WaitUntil(running_->mutex, running_->changed, deadline);
  }
}

sync::TimeNs Core::Impl::CoreTurn() {
  loop_->RunPosted();
  return RunDue();
}

void Core::Impl::Retire(std::shared_ptr<const void> what) {
  retired_->Post([what = std::move(what)] {});
}

void Core::Impl::RunCore() {
  while (!loop_->closed()) loop_->Wait(CoreTurn());
  while (loop_->RunPosted()) {
  }
  EndSessions();
}

void Core::Impl::EndSessions() {
  for (auto& [id, session] : sessions_) {
    if (session.sink != nullptr) {
      session.sink->OnEnded(absl::UnavailableError(
          "the daemon has stopped; what it had not answered was not applied"));
    }
    session.intake->Close();
    for (const std::function<void()>& done : std::exchange(session.when_closed, {})) done();
  }
}

sync::TimeNs Core::Impl::PipelineTurn(Host& host) {
  host.work->RunPosted();
  return host.pipeline->Step();
}

void Core::Impl::RunPipeline(Host& host) {
  while (!host.work->closed()) host.work->Wait(PipelineTurn(host));
  host.pipeline->Stop();
  while (host.work->RunPosted()) {
  }
}

absl::Status Core::Impl::StartPipelines() {
  // On each pipeline's own thread, where there is one; here it is only waited for.
  struct Answers {
    sync::Mutex mutex;
    sync::CondVar changed;
    size_t left VOXELD_GUARDED_BY(mutex) = 0;
    absl::Status first_error VOXELD_GUARDED_BY(mutex);
  };
  auto answers = std::make_shared<Answers>();
  {
    sync::MutexLock lock(answers->mutex);
    answers->left = displays_.size();
  }
  for (const auto& slot : displays_) {
    slot->host->work->Post(
        [pipeline = slot->host->pipeline.get(), snapshot = store_.snapshot(), answers] {
          const absl::Status status = pipeline->Start();
          pipeline->Show(snapshot);
          sync::MutexLock lock(answers->mutex);
          if (answers->first_error.ok() && !status.ok()) {
            answers->first_error = absl::Status(
                status.code(),
                absl::StrCat("display \"", pipeline->info().name, "\": ", status.message()));
          }
          --answers->left;
          answers->changed.NotifyAll();
        });
    if (!options_.threads) slot->host->work->RunPosted();
  }
  sync::MutexLock lock(answers->mutex);
  while (answers->left > 0) answers->changed.Wait(answers->mutex);
  return answers->first_error;
}

absl::Status Core::Impl::Start(std::shared_ptr<Impl> self) {
  if (phase_ != Phase::kNew) {
    return absl::FailedPreconditionError("the core has been started before; make a new one");
  }
  UpdateViews();
  phase_ = Phase::kRunning;
  if (options_.threads) {
    Launch("retired", [retired = retired_] {
      while (!retired->closed()) {
        retired->RunPosted();
        retired->Wait(sync::kNever);
      }
      retired->RunPosted();
    });
    Launch("aside", [aside = aside_] {
      // On Linux this applies to this thread only. What is drawn meanwhile has priority.
      setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kAsideNice);
      while (!aside->closed()) {
        aside->RunPosted();
        aside->Wait(sync::kNever);
      }
      aside->RunPosted();
    });
    Launch("core", [self = std::move(self)] { self->RunCore(); });
    for (const auto& slot : displays_) {
      Launch(absl::StrCat("display \"", slot->info.name, "\""),
             [host = slot->host] { RunPipeline(*host); });
    }
  }
  absl::Status status = StartPipelines();
  if (!status.ok()) Stop(5 * sync::kSecond).IgnoreError();
  return status;
}

absl::Status Core::Impl::Stop(sync::TimeNs limit) {
  const Phase before = std::exchange(phase_, Phase::kStopped);
  if (before == Phase::kStopped) return absl::OkStatus();
  for (const auto& slot : displays_) slot->host->work->Close();
  if (before == Phase::kNew || !options_.threads) {
    for (const auto& slot : displays_) {
      slot->host->pipeline->Stop();
      slot->host->work->RunPosted();
    }
    loop_->Close();
    while (loop_->RunPosted()) {
    }
    EndSessions();
    return absl::OkStatus();
  }

  // Displays first: the core's thread hands on what they still owe.
  // It gets the last quarter for itself. What takes longer than a quarter to draw is given up.
  const sync::TimeNs now = clock_.Now();
  std::set<std::string> displays;
  for (const NamedThread& t : threads_) {
    if (t.name != "core" && t.name != "retired" && t.name != "aside") displays.insert(t.name);
  }
  if (!AwaitEnd(displays, now + limit / 4).empty()) *abandoned_ = true;
  std::set<std::string> left = AwaitEnd(displays, now + limit / 4 * 3);
  // The displays have released their engines. Second engines abandon their calls.
  *abandoned_ = true;
  store_.Abandon();
  loop_->Close();
  left.merge(AwaitEnd({"core"}, now + limit));
  // Stop succeeds even if a large scene is still being freed, or prepared for a display that has stopped.
  aside_->Close();
  retired_->Close();
  const std::set<std::string> freeing = AwaitEnd({"retired", "aside"}, now + limit);
  for (NamedThread& t : threads_) {
    if (left.contains(t.name) || freeing.contains(t.name)) {
      t.thread.detach();
    } else {
      t.thread.join();
    }
  }
  threads_.clear();
  if (left.empty()) return absl::OkStatus();
  return absl::DeadlineExceededError(
      absl::StrCat("had not ended ", limit / sync::kMillisecond,
                   " ms after being asked to: ", absl::StrJoin(left, ", ")));
}

sync::TimeNs Core::Impl::Step() {
  for (;;) {
    bool any = loop_->RunPosted();
    sync::TimeNs next = RunDue();
    for (const auto& slot : displays_) {
      any = slot->host->work->RunPosted() || any;
      next = std::min(next, slot->host->pipeline->Step());
      any = slot->host->work->RunPosted() || any;
    }
    any = loop_->RunPosted() || any;
    if (!any) return next;
  }
}

sync::TimeNs Core::Impl::ThreadTurn(size_t thread) {
  return thread == 0 ? CoreTurn() : PipelineTurn(*displays_[thread - 1]->host);
}

bool Core::Impl::Ready(size_t thread) const {
  return thread == 0 ? loop_->Ready() : displays_[thread - 1]->host->work->Ready();
}

}  // namespace voxeld::daemon
