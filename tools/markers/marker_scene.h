// What is up of the entities that updates tell of. Pure: it says what to put and what to remove.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "display/sync/clock.h"
#include "scene_update.pb.h"
#include "tools/markers/markers.h"

namespace voxeld::markers {

struct MarkerTally {
  uint64_t updates = 0, entities = 0, deletions = 0;
  uint64_t malformed = 0;          // messages that are no updates
  std::string malformed_last;      // and why
  std::set<std::string> left_out;  // what is not drawn, each once
};

class MarkerScene {
 public:
  struct Changes {
    std::vector<std::string> remove;  // ids within the layer, before
    std::vector<std::pair<std::string, Piece>> put;
  };
  // Entities that are up at once; further ones are left out, and told.
  static constexpr size_t kMostEntities = 100'000;

  // Entities of different topics are different ones, whatever their ids. A deletion is of what was before it in its topic. What
  // has had its time by `now` is forgotten: the server takes it away.
  Changes Apply(const std::string& topic, const foxglove::SceneUpdate& update, sync::TimeNs now);

  size_t size() const { return up_.size(); }

  MarkerTally& tally() { return tally_; }

 private:
  using Key = std::pair<std::string, std::string>;  // topic, entity
  static std::string IdOf(const Key& key, size_t piece);
  struct Up {
    size_t pieces = 0;
    sync::TimeNs until = sync::kNever;
  };
  void Remove(std::map<Key, Up>::iterator at, Changes* changes);
  void Forget(sync::TimeNs now);

  std::map<Key, Up> up_;
  sync::TimeNs next_end_ = sync::kNever;  // the first of `until`, or before it
  MarkerTally tally_;
};

}  // namespace voxeld::markers
