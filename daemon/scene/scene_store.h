// The authoritative scene. Applies commits; each one creates one immutable snapshot or none.
// Commits of different owners can be applied concurrently, each in slices. A commit takes its place
// in the order of snapshots when it is finished.
//
// Single-threaded except for Abandon. The snapshots that it returns may be used by any thread.
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
  std::optional<Issue> first_refusal;  // may not be among `issues`
  uint64_t more_issues = 0;            // number of issues beyond them
  bool hidden = false;                 // see CommitApplier::hidden
  // The applied operations. Their contents have been moved to the scene, but freeing a million of
  // them still takes 50 ms.
  std::vector<Operation> spent;
};

class SceneStore {
 public:
  explicit SceneStore(const Limits& limits);
  SceneStore(const SceneStore&) = delete;
  SceneStore& operator=(const SceneStore&) = delete;

  // Returns: the newest snapshot. Number 1 is the empty scene; 0 is invalid.
  const SnapshotPtr& snapshot() const { return snapshot_; }

  // Makes everything created from now on, including layers, get numbers greater than this.
  void SkipNumbers(uint64_t greatest) { next_number_ = std::max(next_number_, greatest + 1); }

  // Sets the views against which coordinates are checked from now on.
  void SetViews(std::vector<DisplayView> views) { views_ = std::move(views); }

  // Limits the growth of the scene from now on, in addition to what pending commits have added;
  // unlimited by default. Computes `promised` itself.
  void SetMemoryRoom(const MemoryRoom& room) { room_ = room; }

  // Applies `operations` as one commit. Requires: they have passed CheckAlone; Expire(now) was
  // called before. With `strict`, any refusal rejects the whole commit, as does `refused_before` >
  // 0 (the number of refusals on arrival).
  CommitResult Apply(const Author& author, std::vector<Operation> operations, sync::TimeNs now,
                     bool strict = false, uint64_t refused_before = 0);

  // Does the same in slices: Begin, Continue until it returns true, Finish. A PendingCommit must
  // not outlive the store. Destroying an unfinished one leaves the scene unchanged. While an owner
  // has a pending commit, that owner's scene may change only in that entities expire, layers are
  // removed or hidden, and layers get another writer.
  class PendingCommit;
  std::unique_ptr<PendingCommit> Begin(Author author, std::vector<Operation> operations,
                                       sync::TimeNs now, bool strict = false,
                                       uint64_t refused_before = 0);
  // Rebases the commit onto the newest snapshot and applies up to `operations` more. A group, and
  // the definition of an object, count as many operations as they have parts. Returns: true if
  // nothing is left to apply, or after Abandon.
  bool Continue(PendingCommit& pending, uint64_t operations);
  // Ends a commit for which Continue has returned true.
  CommitResult Finish(std::unique_ptr<PendingCommit> pending);
  // Sets what an operator may change while the commit is being applied.
  static void SetQuotas(PendingCommit& pending, bool suppressed, uint64_t max_bytes,
                        uint64_t max_entities);

  // Errors: FailedPrecondition, as from CheckView, if the scene or a pending commit does not fit
  // `view`.
  absl::Status CheckNewView(const DisplayView& view);

  // Prevents all further commits and aborts a running one between two operations, so that the
  // daemon can stop in time. May be called on any thread.
  void Abandon() { abandoned_ = true; }

  // Removes entities whose lifetime has ended by `now`, in one snapshot for each expiry time, in
  // order of time. Returns: whether there is a new snapshot.
  bool Expire(sync::TimeNs now);
  // Returns: kNever if nothing will expire.
  sync::TimeNs next_expiry() const;

  struct Removed {
    uint64_t entities = 0, layers = 0;
    std::vector<uint64_t> owners;  // whose layers were affected; ascending, without duplicates
  };
  // Clears every layer for which `matches` returns true, and removes these layers unless keep_state
  // is set. Creates a snapshot only if something changes.
  Removed RemoveLayers(const std::function<bool(const OwnedName&, const Layer&)>& matches,
                       bool keep_state);

  // Hides all layers of an owner, or restores their own visibility. Creates a snapshot only if
  // something changes.
  void Suppress(uint64_t owner, bool suppressed);
  // Replaces the writer of the layers that `session` wrote last, because the session has ended or
  // was resumed. Creates a snapshot only if something changes.
  void HandOver(uint64_t session, const WriterPtr& writer);

  // Drops the objects of an owner without sessions, unless the owner still has layers.
  void ForgetOwner(uint64_t owner);

 private:
  void Publish(Draft draft);
  // Rebases the commit onto the newest snapshot.
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
