#include "daemon/state/keeper.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/scene/scene_changes.h"
#include "daemon/state/kept_view.h"
#include "daemon/wire/kept.h"

namespace voxeld::daemon::state {
namespace {

// Bytes of changes that are held in memory at once.
constexpr size_t kChunkBytes = 4u << 20;
// Cost of a row in addition to its bytes.
constexpr size_t kRowBytes = 64;

class Collector final : public SceneChangeVisitor {
 public:
  explicit Collector(const wire::TwoClocks& now) : now_(now) {}

  std::vector<Change> Take() {
    held_ = 0;
    return std::exchange(changes_, {});
  }
  uint64_t rows() const { return rows_; }
  uint64_t bytes() const { return bytes_; }
  uint64_t left_out() const { return left_out_; }

  bool Put(RowKey key, std::string bytes) {
    bytes_ += bytes.size();
    return Add({Change::What::kPut, std::move(key), std::move(bytes)});
  }
  bool Remove(RowKey key) { return Add({Change::What::kRemove, std::move(key), {}}); }

  bool OnObject(const OwnedName& key, const Object& object) override {
    return Put({RowKind::kObject, key.owner, key.name, ""}, wire::EncodeKept(object));
  }
  bool OnRemovedObject(const OwnedName& key) override {
    return Remove({RowKind::kObject, key.owner, key.name, ""});
  }
  bool OnLayer(const OwnedName& key, const Layer& layer) override {
    return Put({RowKind::kLayer, key.owner, key.name, ""}, wire::EncodeKept(key, layer));
  }
  bool OnRemovedLayer(const OwnedName& key) override {
    return Add({Change::What::kRemoveLayer, {RowKind::kLayer, key.owner, key.name, ""}, {}});
  }
  bool OnEntity(const OwnedName& layer, const std::string& id, const Entity& entity) override {
    RowKey key{RowKind::kEntity, layer.owner, layer.name, id};
    absl::StatusOr<std::string> bytes = wire::EncodeKept(entity, now_);
    if (bytes.ok()) return Put(std::move(key), *std::move(bytes));
    ++left_out_;
    return Remove(std::move(key));
  }
  bool OnRemovedEntity(const OwnedName& layer, const std::string& id) override {
    return Remove({RowKind::kEntity, layer.owner, layer.name, id});
  }

 private:
  bool Add(Change change) {
    held_ += change.bytes.size() + kRowBytes;
    ++rows_;
    changes_.push_back(std::move(change));
    return held_ < kChunkBytes;
  }

  const wire::TwoClocks now_;
  std::vector<Change> changes_;
  size_t held_ = 0;
  uint64_t rows_ = 0, bytes_ = 0, left_out_ = 0;
};

// Returns: the records of owners that have layers in the view.
OwnerRecords KeptOwners(const Snapshot& view, const OwnerRecords& all) {
  OwnerRecords kept;
  view.layers.ForEach([&](const OwnedName& key, const LayerPtr&) {
    const auto found = all.find(key.owner);
    if (found != all.end()) kept.emplace(*found);
  });
  return kept;
}

}  // namespace

Keeper::Keeper(std::unique_ptr<StateFile> file, KeeperOptions options, sync::Clock& clock)
    : file_(std::move(file)), options_(std::move(options)), clock_(clock) {
  {
    sync::MutexLock lock(mutex_);
    figures_.trouble = file_->quarantined();
  }
  thread_ = std::thread([this] { Run(); });
}

Keeper::~Keeper() { (void)Stop(); }

void Keeper::Knows(const SnapshotPtr& snapshot, OwnerRecords owners) {
  sync::MutexLock lock(mutex_);  // makes the values visible to the thread
  written_ = KeptView(snapshot);
  written_owners_ = std::move(owners);
}

void Keeper::SetOnDurable(std::function<void(uint64_t)> on_durable) {
  sync::MutexLock lock(mutex_);
  on_durable_ = std::move(on_durable);
}

void Keeper::Offer(SnapshotPtr snapshot, std::shared_ptr<const OwnerRecords> owners, bool at_once) {
  sync::MutexLock lock(mutex_);
  offered_ = {std::move(snapshot), std::move(owners)};
  const sync::TimeNs due = clock_.Now() + (at_once ? 0 : options_.interval_ns);
  // While writing fails, the retry interval applies.
  if (last_.ok() || due_ == sync::kNever) due_ = std::min(due_, due);
  changed_.NotifyAll();
}

absl::Status Keeper::Stop() {
  {
    sync::MutexLock lock(mutex_);
    stop_ = true;
    changed_.NotifyAll();
  }
  if (thread_.joinable()) thread_.join();
  file_.reset();
  sync::MutexLock lock(mutex_);
  return last_;
}

StateFigures Keeper::figures() const {
  sync::MutexLock lock(mutex_);
  return figures_;
}

void Keeper::Run() {
  for (;;) {
    Target target;
    {
      sync::MutexLock lock(mutex_);
      while (!stop_ && clock_.Now() < due_) clock_.WaitUntil(mutex_, changed_, due_);
      if (stop_ && offered_.snapshot == nullptr) return;
      target = std::exchange(offered_, {});
      due_ = sync::kNever;
    }
    if (target.snapshot == nullptr) continue;
    absl::Status status = Write(target);
    if (absl::IsDataLoss(status)) {
      // The complete scene is in memory, so write all of it to a new file.
      written_ = nullptr;
      written_owners_.clear();
      const absl::Status anew = file_->StartAnew(std::string(status.message()));
      if (anew.ok()) status = Write(target);
    }
    std::function<void(uint64_t)> tell;
    {
      sync::MutexLock lock(mutex_);
      Report(status);
      if (!status.ok()) {
        if (stop_) return;
        if (offered_.snapshot == nullptr) offered_ = target;
        due_ = clock_.Now() + options_.retry_ns;
        continue;
      }
      figures_.durable_snapshot = target.snapshot->number;
      tell = on_durable_;
    }
    if (tell) tell(target.snapshot->number);
  }
}

absl::Status Keeper::Write(const Target& target) {
  const SnapshotPtr view = KeptView(target.snapshot);
  OwnerRecords owners = KeptOwners(*view, *target.owners);
  const sync::TimeNs now = clock_.Now();
  Collector collector({now, options_.unix_ns(now)});
  SceneChanges changes({.objects = true}, written_, view);
  bool owners_told = false, told = false;
  // If the file's content is unknown, empty it first.
  bool emptied = written_ != nullptr;
  std::vector<Change> first;
  const auto next = [&]() -> std::vector<Change> {
    if (!emptied) {
      emptied = true;
      return {{Change::What::kRemoveAll, {}, {}}};
    }
    if (!owners_told) {
      owners_told = true;
      for (const auto& [number, record] : written_owners_) {
        if (!owners.contains(number)) collector.Remove({RowKind::kOwner, number, "", ""});
      }
      for (const auto& [number, record] : owners) {
        const auto was = written_owners_.find(number);
        if (was == written_owners_.end() || was->second != record) {
          collector.Put({RowKind::kOwner, number, "", ""}, wire::EncodeKept(record));
        }
      }
      std::vector<Change> taken = collector.Take();
      if (!taken.empty()) return taken;
    }
    std::vector<Change> taken;
    while (!told && taken.empty()) {
      told = changes.Next(collector);
      taken = collector.Take();
    }
    return taken;
  };
  // An empty difference needs no transaction.
  if (emptied) {
    first = next();
    if (first.empty()) {
      written_ = view;
      return absl::OkStatus();
    }
  }
  const absl::Status status = file_->Apply([&] {
    if (!first.empty()) return std::exchange(first, {});
    return next();
  });
  if (!status.ok()) return status;
  written_ = view;
  written_owners_ = std::move(owners);
  sync::MutexLock lock(mutex_);
  ++figures_.transactions;
  figures_.rows += collector.rows();
  figures_.bytes += collector.bytes();
  if (collector.left_out() > 0 && options_.log != nullptr) {
    options_.log->Warn("entities are too large to be kept",
                       {{"entities", absl::StrCat(collector.left_out())}});
  }
  return absl::OkStatus();
}

void Keeper::Report(const absl::Status& status) {
  const std::string trouble = !status.ok() ? std::string(status.message()) : file_->quarantined();
  if (!status.ok()) ++figures_.failures;
  if (options_.log != nullptr && trouble != figures_.trouble) {
    if (!status.ok()) {
      options_.log->Error("state cannot be kept; it is tried again", {{"why", trouble}});
    } else if (!trouble.empty()) {
      options_.log->Error("the state file was damaged; what the scene has is in a new one",
                          {{"put_aside", trouble}});
    } else {
      options_.log->Info("state is kept again");
    }
  }
  figures_.trouble = trouble;
  last_ = status;
}

}  // namespace voxeld::daemon::state
