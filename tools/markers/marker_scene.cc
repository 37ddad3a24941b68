#include "tools/markers/marker_scene.h"

#include <algorithm>

#include "absl/strings/str_cat.h"

namespace voxeld::markers {

std::string MarkerScene::IdOf(const Key& key, size_t piece) {
  return absl::StrCat(key.first, " ", key.second, "#", piece);
}

void MarkerScene::Remove(std::map<Key, Up>::iterator at, Changes* changes) {
  for (size_t piece = 0; piece < at->second.pieces; ++piece) {
    changes->remove.push_back(IdOf(at->first, piece));
  }
  up_.erase(at);
}

void MarkerScene::Forget(sync::TimeNs now) {
  if (now < next_end_) return;
  std::erase_if(up_, [now](const auto& entity) { return entity.second.until <= now; });
  next_end_ = sync::kNever;
  for (const auto& [key, up] : up_) next_end_ = std::min(next_end_, up.until);
}

MarkerScene::Changes MarkerScene::Apply(const std::string& topic,
                                        const foxglove::SceneUpdate& update, sync::TimeNs now) {
  Changes changes;
  ++tally_.updates;
  Forget(now);
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
    Pieces made = PiecesOf(entity);
    if (!made.left_out.empty()) tally_.left_out.insert(made.left_out);
    const Key key{topic, entity.id()};
    if (up_.size() >= kMostEntities && !up_.contains(key)) {
      tally_.left_out.insert(absl::StrCat("entities beyond ", kMostEntities));
      continue;
    }
    Up& up = up_[key];
    for (size_t piece = made.pieces.size(); piece < up.pieces; ++piece) {
      changes.remove.push_back(IdOf(key, piece));
    }
    up.pieces = made.pieces.size();
    const auto lifetime =
        made.pieces.empty() ? std::chrono::nanoseconds(0) : made.pieces.front().look.lifetime;
    up.until = lifetime.count() > 0 ? now + lifetime.count() : sync::kNever;
    next_end_ = std::min(next_end_, up.until);
    for (size_t piece = 0; piece < up.pieces; ++piece) {
      changes.put.emplace_back(IdOf(key, piece), std::move(made.pieces[piece]));
    }
    if (up.pieces == 0) up_.erase(key);
  }
  return changes;
}

}  // namespace voxeld::markers
