#include "tools/voxelctl/markers/marker_scene.h"

#include "absl/strings/str_cat.h"

namespace voxeld::voxelctl {

std::string MarkerScene::IdOf(const Key& key, size_t piece) {
  return absl::StrCat(key.first, " ", key.second, "#", piece);
}

void MarkerScene::Remove(std::map<Key, size_t>::iterator at, Changes* changes) {
  for (size_t piece = 0; piece < at->second; ++piece) {
    changes->remove.push_back(IdOf(at->first, piece));
  }
  up_.erase(at);
}

MarkerScene::Changes MarkerScene::Apply(const std::string& topic,
                                        const foxglove::SceneUpdate& update) {
  Changes changes;
  ++tally_.updates;
  for (const foxglove::SceneEntityDeletion& deletion : update.deletions()) {
    ++tally_.deletions;
    if (deletion.type() == foxglove::SceneEntityDeletion::ALL) {
      for (auto at = up_.lower_bound({topic, ""}); at != up_.end() && at->first.first == topic;) {
        Remove(at++, &changes);
      }
    } else if (const auto at = up_.find({topic, deletion.id()}); at != up_.end()) {
      Remove(at, &changes);
    }
  }
  for (const foxglove::SceneEntity& entity : update.entities()) {
    ++tally_.entities;
    markers::Pieces made = markers::PiecesOf(entity);
    if (!made.left_out.empty()) tally_.left_out.insert(made.left_out);
    const Key key{topic, entity.id()};
    size_t& count = up_[key];
    for (size_t piece = made.pieces.size(); piece < count; ++piece) {
      changes.remove.push_back(IdOf(key, piece));
    }
    count = made.pieces.size();
    for (size_t piece = 0; piece < count; ++piece) {
      changes.put.emplace_back(IdOf(key, piece), std::move(made.pieces[piece]));
    }
  }
  return changes;
}

}  // namespace voxeld::voxelctl
