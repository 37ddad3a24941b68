#include "daemon/state/restore.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"

namespace voxeld::daemon::state {
namespace {

constexpr size_t kEntitiesAtOnce = 4096;

class Reader {
 public:
  Reader(const wire::TwoClocks& now, const Limits& limits, gpu::BulkPool* pool, text::Fonts* fonts)
      : now_(now), limits_(limits), pool_(pool), fonts_(fonts) {}

  // Takes a row, in the order of StateFile::Read: owners, objects, layers, entities.
  void Take(const RowKey& key, std::string_view bytes) {
    switch (key.kind) {
      case RowKind::kOwner:
        return TakeOwner(key, bytes);
      case RowKind::kObject:
        return TakeObject(key, bytes);
      case RowKind::kLayer:
        return TakeLayer(key, bytes);
      case RowKind::kEntity:
        return TakeEntity(key, bytes);
    }
    LeaveOut(key, absl::DataLossError("a row of no kind"));
  }

  RestoredState Finish() {
    PutLayers();
    PutObjects();
    for (RestoredScene::Step& step : entities_) out_.scene.steps.push_back(std::move(step));
    return std::move(out_);
  }

 private:
  void LeaveOut(const RowKey& key, const absl::Status& why) {
    if (++out_.left_out > RestoredState::kMostSaid) return;
    const char* kind = key.kind == RowKind::kOwner    ? "owner"
                       : key.kind == RowKind::kObject ? "object"
                       : key.kind == RowKind::kLayer  ? "layer"
                                                      : "entity";
    out_.why.push_back(absl::StrCat(kind, " ", key.owner, "/", absl::CHexEscape(key.name), "/",
                                    absl::CHexEscape(key.id), ": ", why.message()));
  }

  bool Known(const RowKey& key) {
    if (out_.scene.owners.contains(key.owner)) return true;
    LeaveOut(key, absl::DataLossError("its owner is not there"));
    return false;
  }

  void TakeOwner(const RowKey& key, std::string_view bytes) {
    absl::StatusOr<OwnerRecord> record = wire::DecodeKeptOwner(bytes);
    if (!record.ok()) return LeaveOut(key, record.status());
    out_.scene.owners.emplace(key.owner, *std::move(record));
  }

  void TakeObject(const RowKey& key, std::string_view bytes) {
    if (!Known(key)) return;
    auto row = wire::DecodeKeptObject(key.name, bytes, limits_, pool_, fonts_);
    if (!row.ok()) return LeaveOut(key, row.status());
    ++out_.objects;
    objects_[key.owner].emplace(key.name, *std::move(row));
  }

  void TakeLayer(const RowKey& key, std::string_view bytes) {
    if (!Known(key)) return;
    auto row = wire::DecodeKeptLayer(bytes, limits_);
    if (!row.ok()) return LeaveOut(key, row.status());
    ++out_.layers;
    out_.scene.greatest_number = std::max(out_.scene.greatest_number, row->number);
    layers_.emplace(OwnedName{key.owner, key.name}, *std::move(row));
  }

  void TakeEntity(const RowKey& key, std::string_view bytes) {
    const auto layer = layers_.find({key.owner, key.name});
    if (layer == layers_.end()) {
      return LeaveOut(key, absl::DataLossError("its layer is not there"));
    }
    auto operation = wire::DecodeKeptEntity(key.name, key.id, bytes, now_, limits_, pool_, fonts_);
    if (!operation.ok()) return LeaveOut(key, operation.status());
    if (!operation->has_value()) {
      ++out_.expired;
      return;
    }
    ++out_.entities;
    const OwnedName place{key.owner, key.name};
    if (entities_.empty() || place != place_ ||
        entities_.back().operations.size() >= kEntitiesAtOnce) {
      entities_.push_back({key.owner, layer->second.client_name, {}});
      place_ = place;
    }
    entities_.back().operations.push_back(**std::move(operation));
  }

  // Restores layers in the order of their creation, in which they are blended.
  void PutLayers() {
    std::vector<std::pair<OwnedName, wire::KeptLayerRow*>> order;
    order.reserve(layers_.size());
    for (auto& [key, row] : layers_) order.emplace_back(key, &row);
    std::sort(order.begin(), order.end(),
              [](const auto& a, const auto& b) { return a.second->number < b.second->number; });
    for (auto& [key, row] : order) {
      RestoredScene::Step& step = out_.scene.steps.emplace_back();
      step.owner = key.owner;
      step.client_name = row->client_name;
      step.operations.push_back(std::move(row->operation));
    }
  }

  // Restores objects that others refer to first.
  void PutObjects() {
    for (auto& of_owner : objects_) {
      const uint64_t owner = of_owner.first;
      auto& objects = of_owner.second;
      std::set<std::string> begun;
      std::vector<Operation> operations;
      // The path of references from an object to the one being restored, with the number of
      // completed references of each. It is explicit because chains may be arbitrarily long.
      std::vector<std::pair<wire::KeptObjectRow*, size_t>> path;
      const auto begin = [&](const std::string& name) {
        const auto found = objects.find(name);
        if (found == objects.end() || !begun.insert(name).second) return;
        path.emplace_back(&found->second, 0);
      };
      for (const auto& [name, row] : objects) {
        begin(name);
        while (!path.empty()) {
          auto& [object, done] = path.back();
          if (done < object->refers_to.size()) {
            begin(object->refers_to[done++]);
            continue;
          }
          operations.push_back(std::move(object->operation));
          path.pop_back();
        }
      }
      out_.scene.steps.push_back({owner, "", std::move(operations)});
    }
  }

  const wire::TwoClocks& now_;
  const Limits& limits_;
  gpu::BulkPool* const pool_;
  text::Fonts* const fonts_;
  RestoredState out_;
  std::map<uint64_t, std::map<std::string, wire::KeptObjectRow>> objects_;
  std::map<OwnedName, wire::KeptLayerRow> layers_;
  std::vector<RestoredScene::Step> entities_;
  OwnedName place_;  // of the last step of entities_
};

}  // namespace

absl::StatusOr<RestoredState> ReadState(StateFile& file, const wire::TwoClocks& now,
                                        const Limits& limits, gpu::BulkPool* pool,
                                        text::Fonts* fonts) {
  // Content that arrived in one message may exceed today's limit on messages.
  Limits roomy = limits;
  roomy.max_message_bytes = std::max<uint64_t>(roomy.max_message_bytes, uint64_t{2} << 30);
  Reader reader(now, roomy, pool, fonts);
  absl::Status status =
      file.Read([&](const RowKey& key, std::string_view bytes) { reader.Take(key, bytes); });
  if (!status.ok()) return status;
  return reader.Finish();
}

}  // namespace voxeld::daemon::state
