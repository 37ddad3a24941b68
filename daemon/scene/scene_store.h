// The truth about the scene: applies commits one after another,
// each making one immutable snapshot or none.
//
// Single-threaded but for Abandon; the snapshots that it gives away may be used anywhere.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "daemon/scene/commit_applier.h"
#include "daemon/scene/operation.h"
#include "daemon/scene/snapshot.h"

namespace voxeld::daemon {

struct CommitResult {
  bool applied = false;    // false: a strict commit with a refusal; nothing was changed
  bool abandoned = false;  // not applied because of Abandon
  uint64_t applied_operations = 0, refused_operations = 0;
  std::vector<Issue> issues;           // the first max_issues_per_commit
  std::optional<Issue> first_refusal;  // though it may not be among them
  uint64_t more_issues = 0;            // that there would have been beyond them
  bool hidden = false;                 // see CommitApplier::hidden
};

class SceneStore {
 public:
  explicit SceneStore(const Limits& limits);
  SceneStore(const SceneStore&) = delete;
  SceneStore& operator=(const SceneStore&) = delete;

  // The newest; number 1 is the empty scene (0 is none).
  const SnapshotPtr& snapshot() const { return snapshot_; }

  // What is made from now on, layers too, has greater numbers than this.
  void SkipNumbers(uint64_t greatest) { next_number_ = std::max(next_number_, greatest + 1); }

  // What coordinates are checked against from now on.
  void SetViews(std::vector<DisplayView> views) { views_ = std::move(views); }

  // How much the scene may grow in the commits that follow; without it, by any amount.
  void SetMemoryRoom(const MemoryRoom& room) { room_ = room; }

  // Applies `operations`, which have passed CheckAlone, as one commit.
  // With `strict` any refusal, or `refused_before` > 0 (what was refused on arrival),
  // refuses it whole. Call Expire(now) first.
  CommitResult Apply(const Author& author, std::vector<Operation> operations, sync::TimeNs now,
                     bool strict = false, uint64_t refused_before = 0);

  // Any thread. From now on no commit is applied, and one under way is given up between two of its
  // operations: for a daemon that must end in time.
  void Abandon() { abandoned_ = true; }

  // Removes what has outlived its lifetime by `now`; one snapshot for each moment at which
  // something ended, in order of time. True if there is a new snapshot.
  bool Expire(sync::TimeNs now);
  // kNever if nothing will.
  sync::TimeNs next_expiry() const;

  struct Removed {
    uint64_t entities = 0, layers = 0;
    std::vector<uint64_t> owners;  // whose layers were affected; ascending, each once
  };
  // Clears every layer for which `matches` holds, and removes the layers themselves unless
  // keep_state. A new snapshot only if that changed something.
  Removed RemoveLayers(const std::function<bool(const OwnedName&, const Layer&)>& matches,
                       bool keep_state);

  // Hides all layers of an owner, or shows them as they say of themselves. A new snapshot only if that changed
  // something.
  void Suppress(uint64_t owner, bool suppressed);
  // The layers that `session` last wrote get `writer` in the place of theirs: it has ended, or was taken up. A new
  // snapshot only if that changed something.
  void HandOver(uint64_t session, const WriterPtr& writer);

  // Drops the objects of an owner who has no session any more, unless layers of theirs are left.
  void ForgetOwner(uint64_t owner);

 private:
  void Publish(Draft draft);

  const Limits limits_;
  std::vector<DisplayView> views_;
  MemoryRoom room_;
  std::atomic<bool> abandoned_ = false;
  uint64_t next_number_ = 1;
  SnapshotPtr snapshot_;
};

}  // namespace voxeld::daemon
