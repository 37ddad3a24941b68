// The truth about the scene: applies commits, each making one immutable snapshot or none. Commits of different owners
// can be under way at the same time, each in slices; a commit takes its place in the order of snapshots when it
// is finished.
//
// Single-threaded but for Abandon; the snapshots that it gives away may be used anywhere.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "absl/status/status.h"
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
  // The applied operations. The scene has moved their contents out, but freeing a million of them still takes 50 ms.
  std::vector<Operation> spent;
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

  // How much the scene may grow from now on beside what commits under way have added; without it, by any amount.
  // `promised` of it is worked out here.
  void SetMemoryRoom(const MemoryRoom& room) { room_ = room; }

  // Applies `operations`, which have passed CheckAlone, as one commit.
  // With `strict` any refusal, or `refused_before` > 0 (what was refused on arrival),
  // refuses it whole. Call Expire(now) first.
  CommitResult Apply(const Author& author, std::vector<Operation> operations, sync::TimeNs now,
                     bool strict = false, uint64_t refused_before = 0);

  // The same in slices: Begin, Continue until it returns true, Finish. A PendingCommit must not outlive the store.
  // Destroying one that is not finished leaves the scene as it was. While an owner has a pending commit, the
  // scene of that owner may change only in that entities expire, layers are removed or hidden, and layers get another
  // writer.
  class PendingCommit;
  std::unique_ptr<PendingCommit> Begin(Author author, std::vector<Operation> operations,
                                       sync::TimeNs now, bool strict = false,
                                       uint64_t refused_before = 0);
  // Rebases the commit onto the newest snapshot and applies up to `operations` more. A group, and the definition of an
  // object, count as many operations as they have parts. Returns: true if there is nothing left to apply, or after Abandon.
  bool Continue(PendingCommit& pending, uint64_t operations);
  // Ends a commit for which Continue has returned true.
  CommitResult Finish(std::unique_ptr<PendingCommit> pending);
  // Sets what an operator may change while the commit is being applied.
  static void SetQuotas(PendingCommit& pending, bool suppressed, uint64_t max_bytes,
                        uint64_t max_entities);

  // FailedPrecondition, as CheckView has it, if the scene, or what a commit under way has made of it, does not fit `view`.
  absl::Status CheckNewView(const DisplayView& view);

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
  // Puts the commit on top of the newest snapshot.
  void Rebase(PendingCommit& pending);
  // Returns: what all pending commits except `pending` have added.
  OwnerTally PromisedBeside(const PendingCommit& pending) const;

  const Limits limits_;
  std::vector<DisplayView> views_;
  MemoryRoom room_;
  std::atomic<bool> abandoned_ = false;
  uint64_t next_number_ = 1;
  SnapshotPtr snapshot_;
  std::set<PendingCommit*> pending_;
};

class SceneStore::PendingCommit {
 public:
  PendingCommit(SceneStore& store, Author author, std::vector<Operation> operations,
                sync::TimeNs now, bool strict, uint64_t refused_before);
  ~PendingCommit();
  PendingCommit(const PendingCommit&) = delete;
  PendingCommit& operator=(const PendingCommit&) = delete;

 private:
  friend class SceneStore;

  SceneStore& store_;
  Author author_;
  std::vector<Operation> operations_;
  const bool strict_;
  const uint64_t refused_before_;
  size_t next_ = 0;
  Draft draft_;
  CommitApplier applier_;
};

}  // namespace voxeld::daemon
