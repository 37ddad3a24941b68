// A SceneStore with one author, and helpers to look inside.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "daemon/scene/scene_store.h"
#include "tests/daemon/fakes/operations.h"

namespace voxeld::daemon::testing {

inline Author MakeAuthor(uint64_t owner, uint64_t session) {
  return {owner, std::make_shared<const Writer>(Writer{session, "client"})};
}

class StoreFixture {
 public:
  explicit StoreFixture(Limits limits = {}) : store(limits), limits_(limits) {}

  // Makes one commit by `author`, with operations numbered consecutively; those that CheckAlone
  // refuses are left out and listed first.
  template <typename... Ops>
  CommitResult Commit(const Author& author, Ops... ops) {
    std::vector<Operation> all = Sequence(last_sequence, std::move(ops)...);
    last_sequence += all.size();
    return CommitAll(author, std::move(all));
  }
  template <typename... Ops>
  CommitResult Commit(Ops... ops) {
    return Commit(me, std::move(ops)...);
  }
  // Orphans the layers that the session last wrote, as when it has ended.
  void Orphan(uint64_t session) {
    store.HandOver(session, std::make_shared<const Writer>(Writer{session, "client", true}));
  }
  CommitResult CommitAll(const Author& author, std::vector<Operation> all) {
    std::vector<Issue> alone;
    std::vector<Operation> passed;
    for (Operation& op : all) {
      if (auto issue = CheckAlone(op, limits_)) {
        alone.push_back(*std::move(issue));
      } else {
        passed.push_back(std::move(op));
      }
    }
    CommitResult result = store.Apply(author, std::move(passed), now, strict, alone.size());
    result.issues.insert(result.issues.begin(), alone.begin(), alone.end());
    return result;
  }

  // Returns "layer: id id; layer: …" of all owners, in order.
  std::string Scene() const {
    std::string text;
    store.snapshot()->layers.ForEach([&](const OwnedName& key, const LayerPtr& layer) {
      text += (text.empty() ? "" : "; ") + key.name + ":";
      layer->entities.ForEach([&](const std::string& id, const EntityPtr&) { text += " " + id; });
    });
    return text;
  }
  EntityPtr Get(const std::string& layer, const std::string& id) const {
    return store.snapshot()->FindEntity({me.owner, layer}, id);
  }
  const Layer* GetLayer(const std::string& layer) const {
    return store.snapshot()->FindLayer({me.owner, layer});
  }
  OwnerTally Tally(uint64_t owner = 1) const {
    const OwnerTally* tally = store.snapshot()->owners.Find(owner);
    return tally == nullptr ? OwnerTally() : *tally;
  }

  SceneStore store;
  Author me = MakeAuthor(1, 11);
  sync::TimeNs now = sync::kSecond;
  bool strict = false;
  uint64_t last_sequence = 0;

 private:
  const Limits limits_;
};

// Compares a snapshot's indices and totals with those computed from its layers and objects alone.
// Returns an empty text if they agree.
std::string CheckIndices(const Snapshot& snapshot);

}  // namespace voxeld::daemon::testing
