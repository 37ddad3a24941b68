#include "daemon/state/kept_view.h"

#include <set>
#include <utility>

namespace voxeld::daemon::state {

SnapshotPtr KeptView(const SnapshotPtr& snapshot) {
  Snapshot view;
  view.number = snapshot->number;
  std::set<uint64_t> owners;
  snapshot->layers.ForEach([&](const OwnedName& key, const LayerPtr& layer) {
    if (!layer->writer->keep) return;
    view.layers.Put(key, layer);
    owners.insert(key.owner);
  });
  snapshot->objects.ForEach([&](const OwnedName& key, const ObjectPtr& object) {
    if (owners.contains(key.owner)) view.objects.Put(key, object);
  });
  return std::make_shared<const Snapshot>(std::move(view));
}

}  // namespace voxeld::daemon::state
