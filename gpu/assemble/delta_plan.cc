#include "gpu/assemble/delta_plan.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>

#include "absl/container/flat_hash_map.h"
#include "absl/strings/str_cat.h"

namespace voxeld::gpu {
namespace {

absl::Status Refused(const char* kind, uint64_t id, absl::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat("delta: ", kind, " ", id, " ", what));
}

// What a drawable refers to.
struct Links {
  uint64_t geometry, layer;
};

// Follows what exists while the steps go by, without touching the scene.
class Planner final : public DeltaVisitor {
 public:
  explicit Planner(const Scene& scene) : scene_(scene) {}

  absl::Status OnGeometry(const GeometryView& g) override {
    if (GeometryExists(g.record.id)) return Refused("geometry", g.record.id, "exists; ids are new");
    geometries_[g.record.id] = true;
    plan_.steps.emplace_back(g);
    return absl::OkStatus();
  }
  absl::Status OnDrawable(const DrawableRecord& d) override {
    if (absl::Status status = CheckLinks(d.id, {d.geometry, d.layer}); !status.ok()) return status;
    drawables_[d.id] = Links{d.geometry, d.layer};
    plan_.steps.emplace_back(d);
    return absl::OkStatus();
  }
  absl::Status OnLayer(const LayerRecord& l) override {
    layers_[l.id] = true;
    plan_.steps.emplace_back(std::make_unique<const LayerRecord>(l));
    return absl::OkStatus();
  }
  absl::Status OnDrop(Op op, uint64_t id) override {
    if (op == Op::kDropGeometry) {
      if (!GeometryExists(id)) return Refused("geometry", id, "is dropped but does not exist");
      geometries_[id] = false;
    } else if (op == Op::kDropLayer) {
      if (!LayerExists(id)) return Refused("layer", id, "is dropped but does not exist");
      layers_[id] = false;
    } else {
      if (!DrawableExists(id)) return Refused("drawable", id, "is dropped but does not exist");
      drawables_[id] = std::nullopt;
    }
    plan_.steps.emplace_back(DropStep{op, id});
    return absl::OkStatus();
  }
  absl::Status OnReset() override {
    forgotten_ = true;
    geometries_.clear();
    layers_.clear();
    drawables_.clear();
    plan_.steps.clear();  // what came before makes no difference
    plan_.steps.emplace_back(ResetStep{});
    return absl::OkStatus();
  }

  absl::StatusOr<DeltaPlan> Finish() {
    // Changes to the scene's counts.
    absl::flat_hash_map<uint64_t, int64_t> geometry_uses, layer_uses;
    for (const auto& [id, links] : drawables_) {
      if (const Drawable* before = forgotten_ ? nullptr : scene_.FindDrawable(id)) {
        --geometry_uses[before->record.geometry];
        --layer_uses[before->record.layer];
      }
      if (!links) continue;
      if (absl::Status status = CheckLinks(id, *links); !status.ok()) return status;
      ++geometry_uses[links->geometry];
      ++layer_uses[links->layer];
    }
    for (const auto& [id, exists] : geometries_) {
      if (exists) continue;
      const int64_t before = forgotten_ ? 0 : std::max<int64_t>(0, scene_.GeometryUses(id));
      const int64_t uses = before + geometry_uses[id];
      if (uses != 0) {
        return Refused("geometry", id,
                       absl::StrCat("is dropped while ", uses, " drawables use it"));
      }
      plan_.geometries_to_erase.push_back(id);
    }
    for (const auto& [id, exists] : layers_) {
      if (exists) continue;
      const int64_t before = forgotten_ ? 0 : std::max<int64_t>(0, scene_.LayerUses(id));
      const int64_t uses = before + layer_uses[id];
      if (uses != 0) {
        return Refused("layer", id,
                       absl::StrCat("is dropped while ", uses, " drawables are in it"));
      }
      plan_.layers_to_erase.push_back(id);
    }
    return std::move(plan_);
  }

 private:
  bool GeometryExists(uint64_t id) const {
    const auto it = geometries_.find(id);
    return it != geometries_.end() ? it->second : !forgotten_ && scene_.GeometryUses(id) >= 0;
  }
  bool LayerExists(uint64_t id) const {
    const auto it = layers_.find(id);
    return it != layers_.end() ? it->second : !forgotten_ && scene_.LayerUses(id) >= 0;
  }
  bool DrawableExists(uint64_t id) const {
    const auto it = drawables_.find(id);
    return it != drawables_.end() ? it->second.has_value()
                                  : !forgotten_ && scene_.FindDrawable(id) != nullptr;
  }

  absl::Status CheckLinks(uint64_t drawable, const Links& links) const {
    if (!GeometryExists(links.geometry)) {
      return Refused("drawable", drawable,
                     absl::StrCat("uses geometry ", links.geometry, ", which does not exist"));
    }
    if (!LayerExists(links.layer)) {
      return Refused("drawable", drawable,
                     absl::StrCat("is in layer ", links.layer, ", which does not exist"));
    }
    return absl::OkStatus();
  }

  const Scene& scene_;
  DeltaPlan plan_;
  bool forgotten_ = false;  // by a reset
  // What the delta says of an id, over what the scene holds.
  absl::flat_hash_map<uint64_t, bool> geometries_, layers_;
  absl::flat_hash_map<uint64_t, std::optional<Links>> drawables_;
};

}  // namespace

absl::StatusOr<DeltaPlan> PlanDelta(std::span<const std::byte> delta, const Scene& scene,
                                    BulkSource* bulk) {
  Planner planner(scene);
  if (absl::Status status = ReadDelta(delta, planner, bulk); !status.ok()) return status;
  return planner.Finish();
}

}  // namespace voxeld::gpu
