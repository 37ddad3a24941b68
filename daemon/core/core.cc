#include "daemon/core/core.h"

#include <memory>
#include <utility>

#include "daemon/core/core_impl.h"
#include "daemon/scene/draft.h"

namespace voxeld::daemon {
namespace {

// Posts `work(reply)`; once the core has stopped the reply is the answer instead,
// in the caller's thread.
template <typename T, typename Work>
void Ask(Loop& loop, Core::Reply<T> reply, Work work) {
  auto shared = std::make_shared<const Core::Reply<T>>(std::move(reply));
  auto task = [shared, work = std::move(work)]() mutable { work(*shared); };
  if (!loop.Post(std::move(task))) (*shared)(absl::UnavailableError("the daemon has stopped"));
}

// The scene and what is staged, and a quarter for places between blocks.
CoreOptions WithBulk(CoreOptions options) {
  if (options.bulk != nullptr) return options;
  const Limits& limits = options.limits;
  const uint64_t kept = AddSaturating(limits.max_scene_bytes, limits.max_uncommitted_bytes_total);
  options.bulk = gpu::BulkPool::Create({.limit_bytes = AddSaturating(kept, kept / 4)});
  return options;
}

}  // namespace

Core::Core(CoreOptions options, sync::Clock& clock)
    : impl_(std::make_shared<Impl>(WithBulk(std::move(options)), clock)) {}

Core::~Core() { Stop(5 * sync::kSecond).IgnoreError(); }

const Limits& Core::limits() const { return impl_->options().limits; }

gpu::BulkPool& Core::bulk() const { return *impl_->options().bulk; }

absl::Status Core::AddDisplay(std::unique_ptr<display::Display> display,
                              const gpu::EngineOptions& engine, const DisplaySetup& setup) {
  return impl_->AddDisplay(std::move(display), engine, setup);
}

std::vector<Issue> Core::Restore(RestoredScene scene) { return impl_->Restore(std::move(scene)); }

void Core::OnDurable(uint64_t snapshot) {
  impl_->loop().Post([impl = impl_.get(), snapshot] { impl->OnDurable(snapshot); });
}

absl::Status Core::Start() { return impl_->Start(impl_); }

absl::Status Core::Stop(sync::TimeNs limit) { return impl_->Stop(limit); }

sync::TimeNs Core::Step() { return impl_->Step(); }

sync::TimeNs Core::Turn(size_t thread) { return impl_->ThreadTurn(thread); }

bool Core::Ready(size_t thread) const { return impl_->Ready(thread); }

const std::shared_ptr<Budget>& Core::budget() const { return impl_->budget(); }

void Core::OpenSession(OpenOptions options, uint64_t open_bytes, std::shared_ptr<SessionSink> sink,
                       Reply<SessionInfo> reply) {
  Ask(impl_->loop(), std::move(reply),
      [impl = impl_.get(), options = std::move(options), open_bytes,
       sink = std::move(sink)](const Reply<SessionInfo>& answer) mutable {
        answer(impl->OpenSession(std::move(options), open_bytes, std::move(sink)));
      });
}

void Core::CloseSession(SessionId session, uint64_t incarnation, bool gone,
                        std::function<void()> done) {
  auto shared = std::make_shared<std::function<void()>>(std::move(done));
  const bool posted = impl_->loop().Post([impl = impl_.get(), session, incarnation, gone, shared] {
    impl->CloseSession(session, incarnation, gone, std::move(*shared));
  });
  if (!posted && *shared) (*shared)();
}

void Core::GiveBack(SessionId session, std::vector<Receipt> receipts) {
  impl_->loop().Post([impl = impl_.get(), session, receipts = std::move(receipts)] {
    for (const Receipt& receipt : receipts) impl->GiveBack(session, receipt);
  });
}

void Core::CountAsleep() {
  impl_->loop().Post([impl = impl_.get()] { impl->CountAsleep(); });
}

void Core::CountOverrun() {
  impl_->loop().Post([impl = impl_.get()] { impl->CountOverrun(); });
}

SceneWatch& Core::scene_watch() { return impl_->scene_watch(); }

void Core::ListEntities(EntityQuery query, Reply<EntityPage> reply) {
  Ask(impl_->loop(), std::move(reply),
      [impl = impl_.get(), query = std::move(query)](const Reply<EntityPage>& answer) {
        impl->ListEntities(query, answer);
      });
}

void Core::GetEntity(EntityKey key, Reply<EntityInfo> reply) {
  Ask(impl_->loop(), std::move(reply),
      [impl = impl_.get(), key = std::move(key)](const Reply<EntityInfo>& answer) {
        impl->GetEntity(key, answer);
      });
}

void Core::ClearLayer(uint64_t owner, std::string layer, bool keep_state,
                      std::optional<std::string> principal, Reply<Cleared> reply) {
  Ask(impl_->loop(), std::move(reply),
      [impl = impl_.get(), owner, layer = std::move(layer), keep_state,
       principal = std::move(principal)](const Reply<Cleared>& answer) {
        impl->ClearLayer(owner, layer, keep_state, principal, answer);
      });
}

void Core::ListOwners(Reply<std::vector<OwnerInfo>> reply) {
  Ask(impl_->loop(), std::move(reply),
      [impl = impl_.get()](const Reply<std::vector<OwnerInfo>>& answer) {
        answer(impl->ListOwners());
      });
}

void Core::ControlOwner(OwnerControl control, Reply<OwnerInfo> reply) {
  Ask(impl_->loop(), std::move(reply),
      [impl = impl_.get(), control](const Reply<OwnerInfo>& answer) {
        answer(impl->ControlOwner(control));
      });
}

void Core::GetStats(Reply<Stats> reply) {
  Ask(impl_->loop(), std::move(reply),
      [impl = impl_.get()](const Reply<Stats>& answer) { impl->GetStats(answer); });
}

void Core::ListDisplays(Reply<std::vector<DisplayDescription>> reply) {
  Ask(impl_->loop(), std::move(reply),
      [impl = impl_.get()](const Reply<std::vector<DisplayDescription>>& answer) {
        impl->ListDisplays(answer);
      });
}

void Core::GetDisplay(std::string name, Reply<DisplayDescription> reply) {
  Ask(impl_->loop(), std::move(reply),
      [impl = impl_.get(), name = std::move(name)](const Reply<DisplayDescription>& answer) {
        impl->GetDisplay(name, answer);
      });
}

void Core::UpdateDisplay(std::string name, DisplayUpdate update, Reply<DisplayDescription> reply) {
  Ask(impl_->loop(), std::move(reply),
      [impl = impl_.get(), name = std::move(name), update = std::move(update)](
          const Reply<DisplayDescription>& answer) { impl->UpdateDisplay(name, update, answer); });
}

CaptureId Core::Capture(std::string name, sync::TimeNs timeout, uint64_t at_least_snapshot,
                        Reply<display::DecodedVolume> reply) {
  const CaptureId id = impl_->NewCapture();
  Ask(impl_->loop(), std::move(reply),
      [impl = impl_.get(), name = std::move(name), id, timeout,
       at_least_snapshot](const Reply<display::DecodedVolume>& answer) {
        impl->Capture(name, id, timeout, at_least_snapshot, answer);
      });
  return id;
}

void Core::CancelCapture(std::string name, CaptureId id) {
  impl_->loop().Post([impl = impl_.get(), name = std::move(name), id] {  // stopped: it has ended
    impl->CancelCapture(name, id);
  });
}

void Core::GetShownScene(std::string name, Reply<ShownScene> reply) {
  Ask(impl_->loop(), std::move(reply),
      [impl = impl_.get(), name = std::move(name)](const Reply<ShownScene>& answer) {
        impl->GetShownScene(name, answer);
      });
}

WatchId Core::WatchVolumes(std::string name, display::Display::Watcher watcher) {
  const WatchId id = impl_->NewCapture();
  const bool posted = impl_->loop().Post([impl = impl_.get(), name = std::move(name), id, watcher] {
    impl->Watch(name, id, watcher);
  });
  if (!posted) watcher(absl::UnavailableError("the daemon is shutting down"));
  return id;
}

void Core::UnwatchVolumes(std::string name, WatchId id) {
  impl_->loop().Post([impl = impl_.get(), name = std::move(name), id] { impl->Unwatch(name, id); });
}

}  // namespace voxeld::daemon
