// Tracks which entities of the received updates are in the scene. It performs no I/O: it returns
// what to put and what to remove.
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
  uint64_t malformed = 0;          // messages that are not updates
  std::string malformed_last;      // the reason for the last of them
  std::set<std::string> left_out;  // what is not drawn, each once
};

class MarkerScene {
 public:
  struct Changes {
    std::vector<std::string> remove;  // ids within the layer, removed first
    std::vector<std::pair<std::string, Piece>> put;
  };
  // Maximum number of entities in the scene; further ones are left out and reported.
  static constexpr size_t kMostEntities = 100'000;

  // Applies an update. Entities of different topics are different, whatever their ids. A deletion
  // affects the entities that were received before it in its topic. Entities that have expired by
  // `now` are forgotten: the server removes them.
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
  sync::TimeNs next_end_ = sync::kNever;  // the first of `until`, or earlier
  MarkerTally tally_;
};

}  // namespace voxeld::markers
