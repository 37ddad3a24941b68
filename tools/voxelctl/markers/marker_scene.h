// What is up of the entities that updates tell of. Pure: it says what to put and what to remove.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "scene_update.pb.h"
#include "tools/markers/markers.h"

namespace voxeld::voxelctl {

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
    std::vector<std::pair<std::string, markers::Piece>> put;
  };
  // Entities of different topics are different ones, whatever their ids. A deletion is of what was before it in its topic.
  Changes Apply(const std::string& topic, const foxglove::SceneUpdate& update);

  MarkerTally& tally() { return tally_; }

 private:
  using Key = std::pair<std::string, std::string>;  // topic, entity
  static std::string IdOf(const Key& key, size_t piece);
  void Remove(std::map<Key, size_t>::iterator at, Changes* changes);

  std::map<Key, size_t> up_;  // how many pieces
  MarkerTally tally_;
};

}  // namespace voxeld::voxelctl
