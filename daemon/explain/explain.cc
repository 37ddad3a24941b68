#include "daemon/explain/explain.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "daemon/explain/stage.h"
#include "daemon/scene/draft.h"

namespace voxeld::daemon {
namespace {

constexpr uint64_t kEverythingNumber = std::numeric_limits<uint64_t>::max();

gpu::Affine Inverse(const gpu::Affine& map) {
  gpu::Affine inverse;
  const double determinant = gpu::Determinant(map);
  for (int row = 0; row < 3; ++row) {
    double offset = 0;
    for (int col = 0; col < 3; ++col) {
      inverse.m[row * 4 + col] = gpu::Cofactor(map, col, row) / determinant;
      offset -= inverse.m[row * 4 + col] * map.m[col * 4 + 3];
    }
    inverse.m[row * 4 + 3] = offset;
  }
  return inverse;
}

// Returns: a white box around all voxels of the display.
EntityPtr Everything(const gpu::Target& target) {
  const display::VoxelGrid& grid = target.geometry.grid;
  const float cells[3] = {float(grid.nx), float(grid.ny), float(grid.nz)};
  auto box = std::make_shared<GeometryData>();
  box->record.kind = gpu::PrimitiveKind::kBox;
  box->record.fill = gpu::Fill::kSolid;
  for (int axis = 0; axis < 3; ++axis) {
    box->record.params[axis] = cells[axis] / 2;
    box->record.params[3 + axis] = cells[axis] + 2;
    box->min[axis] = -1;
    box->max[axis] = cells[axis] + 1;
  }
  auto entity = std::make_shared<Entity>();
  entity->number = kEverythingNumber;
  entity->data.content = GeometryPtr(std::move(box));
  entity->data.transform = Inverse(target.view);
  return entity;
}

// Returns: the layers in the order in which they are composited.
std::vector<std::pair<OwnedName, LayerPtr>> FromTheBottom(const Snapshot& scene) {
  std::vector<std::pair<OwnedName, LayerPtr>> layers;
  scene.layers.ForEach(
      [&](const OwnedName& key, const LayerPtr& layer) { layers.emplace_back(key, layer); });
  std::sort(layers.begin(), layers.end(), [](const auto& a, const auto& b) {
    return std::tie(a.second->order, a.second->number) <
           std::tie(b.second->order, b.second->number);
  });
  return layers;
}

class Inquiry {
 public:
  Inquiry(const SnapshotPtr& scene, const OwnedName& layer, const std::string& id,
          const gpu::Target& target, Stage& voxels, const std::function<bool()>& cancelled)
      : scene_(scene),
        key_(layer),
        id_(id),
        target_(target),
        voxels_(voxels),
        cancelled_(cancelled),
        layer_(*scene->FindLayer(layer)),
        entity_(scene->FindEntity(layer, id)) {}

  absl::StatusOr<Explanation> Run() {
    Explanation e;
    e.voxels = Place();
    const bool erases = entity_->data.erase || layer_.blend == gpu::BlendMode::kErase;
    absl::Status status;
    const auto count = [&](const Snapshot& scene, uint64_t* out) {
      status = Draw(voxels_, scene);
      if (status.ok()) *out = Lit();
      return status.ok();
    };
    const auto is = [&](Visibility visibility) {
      e.visibility = visibility;
      return e;
    };
    if (!count(Covering(), &e.covered)) return status;
    if (e.covered == 0) return is(Outside(e.voxels) ? Visibility::kOutside : Visibility::kNothing);
    if (!erases) {
      if (!count(Alone(Cut::kNone), &e.lit)) return status;
      if (e.lit == 0) return is(Visibility::kBlack);
      if (!count(Alone(Cut::kClip), &e.left)) return status;
      if (e.left == 0) return is(Visibility::kClipped);
      if (!layer_.mask.empty()) {
        if (!count(Alone(Cut::kClipAndMask), &e.left)) return status;
        if (e.left == 0) return is(Visibility::kMasked);
      }
    }
    if (layer_.suppressed) return is(Visibility::kOwnerHidden);
    if (!layer_.visible) return is(Visibility::kLayerHidden);
    if (layer_.opacity == 0) return is(Visibility::kTransparent);

    Snapshot whole = *scene_;
    whole.uses = {};
    const absl::StatusOr<uint64_t> difference = DifferenceIn(whole);
    if (!difference.ok()) return difference.status();
    e.seen = *difference;
    if (e.seen == 0) {
      if (absl::Status found = FindCover(whole, &e); !found.ok()) return found;
      return is(Visibility::kCovered);
    }
    const absl::StatusOr<bool> shown = IsInPictures(whole);
    if (!shown.ok()) return shown.status();
    if (!*shown) return is(Visibility::kNoLight);
    return is(erases ? Visibility::kErases : Visibility::kSeen);
  }

 private:
  enum class Cut { kNone, kClip, kClipAndMask };

  Bounds Place() const {
    uint64_t no_number = 0;
    const Bounds own = Draft(scene_, no_number).BoundsOf(key_.owner, entity_->data.content);
    return MapBounds(
        gpu::Compose(gpu::Compose(target_.view, layer_.transform), entity_->data.transform), own);
  }

  bool Outside(const Bounds& voxels) const {
    const display::VoxelGrid& grid = target_.geometry.grid;
    const int32_t cells[3] = {grid.nx, grid.ny, grid.nz};
    for (int axis = 0; axis < 3; ++axis) {
      if (voxels.max[axis] < 0 || voxels.min[axis] > cells[axis]) return true;
    }
    return false;
  }

  // Returns: the scene with all definitions and no layers.
  Snapshot Empty() const {
    Snapshot scene = *scene_;
    scene.layers = {};
    scene.uses = {};
    return scene;
  }

  // Returns: the layer with this entity only, without anything that hides it.
  Layer Bare(Cut cut) const {
    Layer layer = layer_;
    layer.entities = {};
    layer.visible = true;
    layer.suppressed = false;
    layer.opacity = 255;
    layer.blend = gpu::BlendMode::kOver;
    if (cut == Cut::kNone) {
      layer.clip = {};
      layer.region.reset();
    }
    if (cut != Cut::kClipAndMask) layer.mask.clear();
    layer.entities.Put(id_, entity_);
    return layer;
  }

  Snapshot Alone(Cut cut) const {
    Snapshot scene = Empty();
    scene.layers.Put(key_, std::make_shared<Layer>(Bare(cut)));
    const OwnedName mask{key_.owner, layer_.mask};
    if (cut == Cut::kClipAndMask && mask != key_) {
      if (const Layer* found = scene_->FindLayer(mask)) {
        Layer unseen = *found;
        unseen.visible = false;
        scene.layers.Put(mask, std::make_shared<Layer>(std::move(unseen)));
      }
    }
    return scene;
  }

  // Returns: a scene that is white wherever the entity is, regardless of its colour.
  Snapshot Covering() const {
    Layer own = Bare(Cut::kNone);
    own.visible = false;
    if (entity_->data.erase) {
      Entity put = *entity_;
      put.data.erase = false;
      own.entities.Put(id_, std::make_shared<Entity>(std::move(put)));
    }
    Layer everything;
    everything.number = kEverythingNumber;
    everything.writer = layer_.writer;
    everything.mask = key_.name;
    everything.entities.Put("", Everything(target_));
    Snapshot scene = Empty();
    scene.layers.Put(key_, std::make_shared<Layer>(std::move(own)));
    scene.layers.Put({key_.owner, key_.name + "'"}, std::make_shared<Layer>(std::move(everything)));
    return scene;
  }

  uint64_t Lit() const {
    const std::vector<std::byte>& rgb = voxels_.pictures();
    uint64_t lit = 0;
    for (size_t i = 0; i + 2 < rgb.size(); i += 3) {
      lit += (rgb[i] | rgb[i + 1] | rgb[i + 2]) != std::byte{0} ? 1 : 0;
    }
    return lit;
  }

  Snapshot Without(const Snapshot& with) const {
    Snapshot scene = with;
    Layer layer = *with.FindLayer(key_);
    layer.entities.Erase(id_);
    scene.layers.Put(key_, std::make_shared<Layer>(std::move(layer)));
    return scene;
  }

  // Returns: the number of voxels that change if the entity is removed from `with`.
  absl::StatusOr<uint64_t> DifferenceIn(const Snapshot& with) const {
    if (absl::Status status = Draw(voxels_, with); !status.ok()) return status;
    const std::vector<std::byte> there = voxels_.pictures();
    if (absl::Status status = Draw(voxels_, Without(with)); !status.ok()) return status;
    const std::vector<std::byte>& gone = voxels_.pictures();
    uint64_t different = 0;
    for (size_t i = 0; i + 2 < gone.size(); i += 3) {
      different += std::equal(&gone[i], &gone[i] + 3, &there[i]) ? 0 : 1;
    }
    return different;
  }

  // Returns: whether the entity changes the display's slice images.
  absl::StatusOr<bool> IsInPictures(const Snapshot& with) const {
    auto display = Stage::Make(target_, cancelled_);
    if (!display.ok()) return display.status();
    if (absl::Status status = Draw(**display, with); !status.ok()) return status;
    const std::vector<std::byte> there = (*display)->pictures();
    if (absl::Status status = Draw(**display, Without(with)); !status.ok()) return status;
    return there != (*display)->pictures();
  }

  static absl::Status Draw(Stage& stage, const Snapshot& scene) {
    return stage.Draw(std::make_shared<Snapshot>(scene));
  }

  // Returns: the least `n` from 1 to `most` for which the entity changes nothing in `scene(n)`.
  // Requires: it changes nothing in scene(most). The binary search assumes that an entity that is
  // covered stays covered as further covers are added, which is mostly true.
  template <typename Scene>
  absl::StatusOr<size_t> FirstThatCovers(size_t most, const Scene& scene) const {
    size_t low = 1;
    while (low < most) {
      const size_t middle = low + (most - low) / 2;
      const absl::StatusOr<uint64_t> difference = DifferenceIn(scene(middle));
      if (!difference.ok()) return difference.status();
      if (*difference == 0) {
        most = middle;
      } else {
        low = middle + 1;
      }
    }
    return low;
  }

  // Finds the layer that covers the entity, and the entity if that is its own layer.
  absl::Status FindCover(const Snapshot& whole, Explanation* e) const {
    const auto layers = FromTheBottom(whole);
    const auto own =
        std::find_if(layers.begin(), layers.end(), [&](const auto& l) { return l.first == key_; });
    const auto below = static_cast<size_t>(own - layers.begin());
    // Tries its own layer alone, then with all layers below, then adds those above one by one.
    // Masks stay in the scene but invisible.
    const auto first_layers = [&](size_t n) {
      Snapshot scene = whole;
      for (size_t i = 0; i < layers.size(); ++i) {
        if (i <= below + n - 1 && (n > 1 || i == below)) continue;
        Layer unseen = *layers[i].second;
        unseen.visible = false;
        scene.layers.Put(layers[i].first, std::make_shared<Layer>(std::move(unseen)));
      }
      return scene;
    };
    const absl::StatusOr<size_t> layer = FirstThatCovers(layers.size() - below, first_layers);
    if (!layer.ok()) return layer.status();
    e->by_layer = layers[below + *layer - 1].first;
    if (*layer > 1) return absl::OkStatus();

    // Collects the entities that may cover it, lowest first.
    std::vector<std::pair<std::string, EntityPtr>> others;
    layer_.entities.ForEach([&](const std::string& id, const EntityPtr& entity) {
      if (id != id_ && entity->data.priority >= entity_->data.priority)
        others.emplace_back(id, entity);
    });
    if (others.empty()) return absl::OkStatus();
    std::sort(others.begin(), others.end(), [](const auto& a, const auto& b) {
      return std::tie(a.second->data.priority, a.second->number) <
             std::tie(b.second->data.priority, b.second->number);
    });
    const Snapshot alone = first_layers(1);
    const auto first_entities = [&](size_t n) {
      Snapshot scene = alone;
      Layer some = layer_;
      some.entities = {};
      some.entities.Put(id_, entity_);
      for (size_t i = 0; i < n; ++i) some.entities.Put(others[i].first, others[i].second);
      scene.layers.Put(key_, std::make_shared<Layer>(std::move(some)));
      return scene;
    };
    const absl::StatusOr<size_t> entity = FirstThatCovers(others.size(), first_entities);
    if (!entity.ok()) return entity.status();
    e->by_entity = others[*entity - 1].first;
    return absl::OkStatus();
  }

  const SnapshotPtr& scene_;
  const OwnedName& key_;
  const std::string& id_;
  const gpu::Target& target_;
  Stage& voxels_;
  const std::function<bool()>& cancelled_;
  const Layer& layer_;
  const EntityPtr entity_;
};

}  // namespace

absl::StatusOr<Explanation> Explain(const SnapshotPtr& scene, const OwnedName& layer,
                                    const std::string& id, const gpu::Target& target,
                                    const std::function<bool()>& cancelled) {
  if (scene->FindEntity(layer, id) == nullptr) {
    return absl::NotFoundError(absl::StrFormat("no entity \"%s\" in layer \"%s\" of owner %d",
                                               absl::CEscape(id), absl::CEscape(layer.name),
                                               layer.owner));
  }
  const display::VoxelGrid& grid = target.geometry.grid;
  const double voxels = double(grid.nx) * grid.ny * grid.nz;
  if (voxels > double(kMostExplainedVoxels)) {
    return absl::ResourceExhaustedError(
        absl::StrFormat("the display has %dx%dx%d voxels; an explanation is given of at most %d",
                        grid.nx, grid.ny, grid.nz, kMostExplainedVoxels));
  }
  auto stage = Stage::Make(VoxelsOf(target), cancelled);
  if (!stage.ok()) return stage.status();
  return Inquiry(scene, layer, id, target, **stage, cancelled).Run();
}

std::string Describe(const Explanation& e) {
  switch (e.visibility) {
    case Visibility::kSeen:
      return absl::StrFormat("it is seen: %d voxels are other than without it", e.seen);
    case Visibility::kOutside:
      return absl::StrFormat(
          "it lies outside the display: from (%.4g, %.4g, %.4g) to (%.4g, %.4g, %.4g) in voxels; "
          "move it, or the "
          "layer, or give the display another view",
          e.voxels.min[0], e.voxels.min[1], e.voxels.min[2], e.voxels.max[0], e.voxels.max[1],
          e.voxels.max[2]);
    case Visibility::kNothing:
      return "it covers no voxel: it may be smaller than a voxel, be flattened by its transforms, "
             "or have nothing "
             "where its formula or boundary says";
    case Visibility::kErases:
      return absl::StrFormat("it erases, and that is seen: %d voxels are other than without it",
                             e.seen);
    case Visibility::kBlack:
      return absl::StrFormat("it is black: it covers %d voxels and lights none", e.covered);
    case Visibility::kClipped:
      return absl::StrFormat(
          "its layer's clip or region leaves none of the %d voxels that it lights", e.lit);
    case Visibility::kMasked:
      return absl::StrFormat("its layer's mask leaves none of the %d voxels that it lights", e.lit);
    case Visibility::kOwnerHidden:
      return "its owner is hidden by an operator";
    case Visibility::kLayerHidden:
      return "its layer is not visible";
    case Visibility::kTransparent:
      return "its layer's opacity is 0";
    case Visibility::kCovered:
      if (!e.by_entity.empty()) {
        return absl::StrCat("entity \"", absl::CEscape(e.by_entity),
                            "\" of its layer, of the same or a higher priority, covers the last of "
                            "it, or looks alike "
                            "there");
      }
      return absl::StrCat("layer \"", absl::CEscape(e.by_layer.name), "\" of owner ",
                          e.by_layer.owner, " covers the last of it, or looks alike there");
    case Visibility::kNoLight:
      return absl::StrFormat(
          "it changes %d voxels, and no pixel: the display has no light there, or tone and dither "
          "leave none of it",
          e.seen);
  }
  return "";
}

}  // namespace voxeld::daemon
