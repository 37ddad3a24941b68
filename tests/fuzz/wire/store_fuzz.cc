// Bytes from clients, decoded and applied: two clients send requests to one scene, and time passes.
// A refused operation changes nothing and has a reason; the scene's counts match its contents; an
// engine receives every change, and so does a watcher; the persistent part can be read again.

#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "daemon/core/budget.h"
#include "daemon/core/intake.h"
#include "daemon/scene/engine_delta.h"
#include "daemon/scene/scene_changes.h"
#include "daemon/scene/scene_store.h"
#include "daemon/text/fonts.h"
#include "daemon/wire/decode.h"
#include "daemon/wire/kept.h"
#include "daemon/wire/memory_source.h"
#include "gpu/delta.h"
#include "tests/fuzz/exchanges.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/script.h"

namespace voxeld::fuzz {
namespace {

using namespace voxeld::daemon;  // NOLINT(google-build-using-namespace)

Limits SmallLimits() {
  Limits limits;
  limits.max_message_bytes = 64 << 10;
  limits.max_entities_per_owner = 200;
  limits.max_entities = 300;
  limits.max_layers_per_owner = 12;
  limits.max_layers = 20;
  limits.max_bytes_per_owner = 128 << 10;
  limits.max_scene_bytes = 192 << 10;
  limits.max_vertices_per_entity = 2048;
  limits.max_indices_per_entity = 4096;
  limits.max_id_bytes = 32;
  limits.max_operations_per_commit = 128;
  limits.max_issues_per_commit = 16;
  limits.max_uncommitted_bytes = 256 << 10;
  limits.max_instance_depth = 4;
  limits.max_parts_per_object = 16;
  limits.max_expression_nodes = 128;
  limits.max_expression_depth = 16;
  limits.max_boundary_points = 64;
  limits.max_texture_texels = 64 << 10;
  return limits;
}

// Limits that a server may have after a reload.
Limits TinyLimits() {
  Limits limits = SmallLimits();
  limits.max_vertices_per_entity = 2;
  limits.max_indices_per_entity = 2;
  limits.max_parts_per_object = 1;
  limits.max_clip_planes = 1;
  limits.max_clip_cylinders = 0;
  return limits;
}

// The memory and assets that requests may name: memory 1, and the asset whose digest is all zeros.
class Named final : public wire::MemorySource, public wire::AssetSource {
 public:
  absl::StatusOr<wire::MappedRange> Find(uint64_t memory, uint64_t offset,
                                         uint64_t size) const override {
    if (memory != 1) return absl::NotFoundError("is none; name 1");
    return Range(offset, size);
  }
  absl::StatusOr<wire::MappedRange> FindAsset(std::string_view digest, uint64_t offset,
                                              uint64_t size) override {
    if (digest != std::string(kDigestBytes, '\0')) return absl::NotFoundError("is not here");
    return Range(offset, size);
  }

 private:
  absl::StatusOr<wire::MappedRange> Range(uint64_t offset, uint64_t size) const {
    if (offset > bytes_->size() || size > bytes_->size() - offset) {
      return absl::OutOfRangeError("ends before");
    }
    return wire::MappedRange{std::string_view(*bytes_).substr(offset, size), bytes_};
  }
  const std::shared_ptr<const std::string> bytes_ = std::make_shared<std::string>(1024, '\x3e');
};

// The contents of an engine, according to the deltas.
class Engine final : public gpu::DeltaVisitor {
 public:
  void Follow(const SnapshotPtr& snapshot) {
    const size_t size = scene_.Plan(snapshot);
    if (size == 0) return;
    std::vector<std::byte> delta(size);
    gpu::DeltaWriter writer(delta);
    scene_.Write(writer);
    EXPECT_THAT_HOLDS(writer.size() == size && !writer.overrun(), writer.size(), " of ", size);
    const absl::Status status = gpu::ReadDelta(delta, *this);
    EXPECT_THAT_HOLDS(status.ok(), status.ToString());
    for (const auto& [id, drawable] : drawables_) {
      EXPECT_THAT_HOLDS(geometries_.contains(drawable.geometry), "a drawable without its geometry");
      EXPECT_THAT_HOLDS(layers_.contains(drawable.layer), "a drawable without its layer");
    }
    EXPECT_THAT_HOLDS(scene_.geometries() == geometries_.size());
  }

  absl::Status OnGeometry(const gpu::GeometryView& g) override {
    geometries_.insert(g.record.id);
    return absl::OkStatus();
  }
  absl::Status OnDrawable(const gpu::DrawableRecord& d) override {
    drawables_[d.id] = {d.geometry, d.layer};
    return absl::OkStatus();
  }
  absl::Status OnLayer(const gpu::LayerRecord& l) override {
    layers_.insert(l.id);
    return absl::OkStatus();
  }
  absl::Status OnDrop(gpu::Op op, uint64_t id) override {
    const size_t dropped = op == gpu::Op::kDropGeometry   ? geometries_.erase(id)
                           : op == gpu::Op::kDropDrawable ? drawables_.erase(id)
                                                          : layers_.erase(id);
    EXPECT_THAT_HOLDS(dropped == 1, "dropped what is not there");
    return absl::OkStatus();
  }
  absl::Status OnReset() override {
    geometries_.clear(), drawables_.clear(), layers_.clear();
    return absl::OkStatus();
  }

 private:
  struct Drawable {
    uint64_t geometry = 0, layer = 0;
  };
  EngineScene scene_;
  std::set<uint64_t> geometries_, layers_;
  std::map<uint64_t, Drawable> drawables_;
};

// The knowledge of a watcher of the scene.
class Watcher final : public SceneChangeVisitor {
 public:
  void Follow(const SnapshotPtr& before, const SnapshotPtr& after) {
    changed.clear();
    SceneChanges changes({}, before, after);
    EXPECT_THAT_HOLDS(changes.Next(*this));
    size_t entities = 0;
    for (const auto& [key, layer] : layers_) entities += layer.size();
    EXPECT_THAT_HOLDS(layers_.size() == after->layers.size() && entities == after->entities);
  }
  bool OnObject(const OwnedName&, const Object&) override { return true; }
  bool OnRemovedObject(const OwnedName&) override { return true; }
  bool OnLayer(const OwnedName& key, const Layer&) override {
    layers_[key];
    return true;
  }
  bool OnRemovedLayer(const OwnedName& key) override {
    EXPECT_THAT_HOLDS(layers_.erase(key) == 1);
    return true;
  }
  bool OnEntity(const OwnedName& layer, const std::string& id, const Entity&) override {
    EXPECT_THAT_HOLDS(layers_.contains(layer), "an entity before its layer");
    layers_[layer].insert(id);
    changed.emplace_back(layer, id);
    return true;
  }
  bool OnRemovedEntity(const OwnedName& layer, const std::string& id) override {
    EXPECT_THAT_HOLDS(layers_[layer].erase(id) == 1);
    return true;
  }

  std::vector<std::pair<OwnedName, std::string>> changed;

 private:
  std::map<OwnedName, std::set<std::string>> layers_;
};

void CheckIssue(const Issue& issue) {
  EXPECT_THAT_HOLDS(issue.reason != Reason::kUnspecified, issue.message);
  ExpectSays(absl::InvalidArgumentError(issue.message));
  EXPECT_THAT_HOLDS(!issue.message.empty());
}

void CheckTallies(const Snapshot& snapshot) {
  std::map<uint64_t, OwnerTally> tallies;
  uint64_t entities = 0, layers = 0;
  snapshot.layers.ForEach([&](const OwnedName& key, const LayerPtr& layer) {
    ++layers;
    ++tallies[key.owner].layers;
    uint64_t bytes = Draft::LayerBytes(key);
    layer->entities.ForEach([&](const std::string& id, const EntityPtr& entity) {
      ++entities;
      EXPECT_THAT_HOLDS(entity->bytes == Draft::EntityBytes(key, id, entity->data));
      bytes += entity->bytes;
      if (const auto* ref = std::get_if<InstanceRef>(&entity->data.content)) {
        EXPECT_THAT_HOLDS(snapshot.FindObject({key.owner, ref->object}) != nullptr,
                          "an instance of nothing");
      }
    });
    tallies[key.owner].bytes += bytes;
  });
  snapshot.objects.ForEach([&](const OwnedName& key, const ObjectPtr& object) {
    tallies[key.owner].bytes += object->bytes;
  });
  EXPECT_THAT_HOLDS(entities == snapshot.entities, entities, " entities, ", snapshot.entities);
  EXPECT_THAT_HOLDS(layers == snapshot.total.layers);
  uint64_t bytes = 0;
  for (const auto& [owner, tally] : tallies) {
    const OwnerTally* told = snapshot.owners.Find(owner);
    EXPECT_THAT_HOLDS(told != nullptr && told->layers == tally.layers && told->bytes == tally.bytes,
                      "owner ", owner, ": ", tally.bytes, " bytes");
    bytes += tally.bytes;
  }
  EXPECT_THAT_HOLDS(bytes == snapshot.total.bytes);
}

// Checks that what is stored of an entity is the same when it is read again.
void CheckKept(const Entity& entity, const OwnedName& layer, const std::string& id,
               sync::TimeNs now, const Limits& limits, text::Fonts* fonts) {
  const wire::TwoClocks clocks{.monotonic_ns = now, .unix_ns = 1'700'000'000'000'000'000};
  const absl::StatusOr<std::string> kept = wire::EncodeKept(entity, clocks);
  EXPECT_THAT_HOLDS(kept.ok(), kept.status().ToString());
  const auto read = wire::DecodeKeptEntity(layer.name, id, *kept, clocks, limits, nullptr, fonts);
  EXPECT_THAT_HOLDS(read.ok(), read.status().ToString());
  if (!read->has_value()) {
    EXPECT_THAT_HOLDS(entity.expires_ns <= now, "what has time left is gone");
    return;
  }
  const auto* upsert = std::get_if<Upsert>(&(*read)->op);
  EXPECT_THAT_HOLDS(upsert != nullptr && upsert->layer == layer.name && upsert->id == id);
  Entity again = entity;
  again.data = upsert->entity;
  again.data.lifetime_ns = entity.data.lifetime_ns;
  const absl::StatusOr<std::string> twice = wire::EncodeKept(again, clocks);
  EXPECT_THAT_HOLDS(twice.ok() && *twice == *kept, "what is kept is another when it is read");
}

struct Client {
  Author author;
  uint64_t sequence = 0;
  bool strict = false;
  std::vector<Operation> staged;
  uint64_t refused = 0;
};

class Session {
 public:
  Session() : limits_(SmallLimits()), store_(limits_) {
    store_.SetViews({{"cube", gpu::Affine{}}});
    for (uint64_t i = 0; i < 2; ++i) {
      clients_[i].author.owner = i + 1;
      auto writer = std::make_shared<Writer>();
      writer->session = i + 1;
      clients_[i].author.writer = std::move(writer);
      clients_[i].author.may_erase = i == 0;
    }
    Follow(store_.snapshot());
  }

  void Run(Script script) {
    for (int message = 0; message < MostSteps(32) && !script.done(); ++message) {
      const uint8_t what = script.Byte();
      Client& client = clients_[what & 1];
      switch (what >> 1 & 7) {
        case 0:
          now_ += script.Byte() * 100 * sync::kMillisecond;
          store_.Expire(now_);
          EXPECT_THAT_HOLDS(store_.next_expiry() > now_);
          break;
        case 1:
          store_.RemoveLayers(
              [&](const OwnedName& key, const Layer&) { return key.owner == client.author.owner; },
              script.Flag());
          break;
        case 2: {  // an operator's action
          const uint8_t choice = script.Byte();
          client.author.suppressed = (choice & 1) != 0;
          store_.Suppress(client.author.owner, client.author.suppressed);
          client.author.max_entities = (choice & 2) != 0 ? 3 : UINT64_MAX;
          client.author.max_bytes = (choice & 4) != 0 ? 2000 : UINT64_MAX;
          break;
        }
        case 3: {
          const std::string bytes = script.Text();
          const std::string_view slices[] = {bytes};
          // An update has no memory; a server may keep no assets, and have no fonts.
          const bool bare = (what & 0x80) != 0;
          const wire::Sources sources = {.assets = bare ? nullptr : &named_, .budget = &budget_};
          Take(client,
               wire::DecodeUpdate(slices, limits_, nullptr, sources, bare ? nullptr : Fonts()),
               true);
          EXPECT_THAT_HOLDS(budget_.used_bytes() == 0);
          break;
        }
        default:
          Stream(client, script);
          break;
      }
      Follow(store_.snapshot());
    }
  }

 private:
  // Reading fonts takes longer than a thousand inputs.
  static text::Fonts* Fonts() {
    static text::Fonts fonts;
    return &fonts;
  }
  wire::Sources Sources() { return {.memory = &named_, .assets = &named_, .budget = &budget_}; }

  void Stream(Client& client, Script& script) {
    const std::string bytes = script.Text();
    const std::string_view whole[] = {bytes};
    wire::Decoded decoded =
        wire::DecodeStreamRequest(whole, limits_, client.sequence, nullptr, Sources(), Fonts());
    // Divided into pieces, it gives the same.
    const size_t cut = bytes.size() * script.Byte() / 256;
    const std::string first = bytes.substr(0, cut), rest = bytes.substr(cut);
    const std::string_view pieces[] = {first, "", rest};
    const wire::Decoded again =
        wire::DecodeStreamRequest(pieces, limits_, client.sequence, nullptr, Sources(), Fonts());
    EXPECT_THAT_HOLDS(again.status == decoded.status, again.status.ToString());
    EXPECT_THAT_HOLDS(again.operations.size() == decoded.operations.size() &&
                      again.refused.issues.size() == decoded.refused.issues.size() &&
                      again.sequence == decoded.sequence &&
                      again.named_bytes == decoded.named_bytes);
    for (size_t i = 0; i < again.refused.issues.size(); ++i) {
      EXPECT_THAT_HOLDS(again.refused.issues[i].message == decoded.refused.issues[i].message);
    }
    Take(client, std::move(decoded), false);
  }

  void Take(Client& client, wire::Decoded decoded, bool update) {
    CountExchange(ExchangeKind::kStore, decoded.status.ok() && decoded.refused.issues.empty());
    if (!decoded.status.ok()) {
      ExpectSays(decoded.status);
      EXPECT_THAT_HOLDS(decoded.operations.empty() && !decoded.open.has_value());
      return;
    }
    for (const Issue& issue : decoded.refused.issues) {
      CheckIssue(issue);
      if (!issue.applied) ++client.refused;
    }
    EXPECT_THAT_HOLDS(decoded.refused.issues.size() <= limits_.max_issues_per_commit);
    client.refused += decoded.refused.more;
    if (decoded.open.has_value()) {
      client.strict = decoded.open->strict;
      EXPECT_THAT_HOLDS(decoded.open->client_name.size() <= 128);
    }
    for (Operation& operation : decoded.operations) {
      if (!update) {
        EXPECT_THAT_HOLDS(operation.sequence > client.sequence || operation.sequence == 0 ||
                          operation.sequence == decoded.sequence);
      }
      if (const auto issue = CheckAlone(operation, tiny_)) CheckIssue(*issue);
      if (const auto issue = CheckAlone(operation, limits_)) {
        CheckIssue(*issue);
        ++client.refused;
        if (!std::holds_alternative<Commit>(operation.op)) continue;
      }
      if (std::holds_alternative<Commit>(operation.op)) {
        Apply(client);
      } else if (client.staged.size() < limits_.max_operations_per_commit) {
        client.staged.push_back(std::move(operation));
      }
    }
    if (!update) client.sequence = std::max(client.sequence, decoded.sequence);
  }

  void Apply(Client& client) {
    store_.Expire(now_);
    Follow(store_.snapshot());
    const SnapshotPtr before = store_.snapshot();
    std::vector<Operation> operations = std::exchange(client.staged, {});
    const size_t count = operations.size();
    const uint64_t refused = std::exchange(client.refused, 0);
    const CommitResult result =
        store_.Apply(client.author, std::move(operations), now_, client.strict, refused);
    EXPECT_THAT_HOLDS(!result.abandoned);
    for (const Issue& issue : result.issues) CheckIssue(issue);
    EXPECT_THAT_HOLDS(result.issues.size() <= limits_.max_issues_per_commit);
    EXPECT_THAT_HOLDS(result.first_refusal.has_value() == (result.refused_operations > refused));
    if (!result.applied) {
      EXPECT_THAT_HOLDS(client.strict && result.refused_operations > 0);
      EXPECT_THAT_HOLDS(store_.snapshot() == before, "what was refused has changed something");
    } else {
      EXPECT_THAT_HOLDS(result.applied_operations + result.refused_operations == count + refused,
                        result.applied_operations, " applied, ", result.refused_operations,
                        " refused, of ", count, " and ", refused);
      if (client.strict) EXPECT_THAT_HOLDS(result.refused_operations == 0);
      if (result.applied_operations == 0 && before->entities == store_.snapshot()->entities) {
        EXPECT_THAT_HOLDS(before->total == store_.snapshot()->total);
      }
    }
    Follow(store_.snapshot());
  }

  void Follow(const SnapshotPtr& snapshot) {
    if (snapshot == followed_) return;
    EXPECT_THAT_HOLDS(followed_ == nullptr || snapshot->number > followed_->number);
    CheckTallies(*snapshot);
    EXPECT_THAT_HOLDS(snapshot->total.drawables <= limits_.max_entities &&
                      snapshot->total.layers <= limits_.max_layers &&
                      snapshot->total.bytes <= limits_.max_scene_bytes);
    engine_.Follow(snapshot);
    watcher_.Follow(followed_, snapshot);
    size_t checked = 0;
    for (const auto& [layer, id] : watcher_.changed) {
      const EntityPtr entity = snapshot->FindEntity(layer, id);
      EXPECT_THAT_HOLDS(entity != nullptr);
      if (++checked <= 8) CheckKept(*entity, layer, id, now_, limits_, Fonts());
    }
    followed_ = snapshot;
  }

  const Limits limits_;
  const Limits tiny_ = TinyLimits();
  Budget budget_{2000};  // for reading from assets
  SceneStore store_;
  Named named_;
  sync::TimeNs now_ = sync::kSecond;
  Client clients_[2];
  Engine engine_;
  Watcher watcher_;
  SnapshotPtr followed_;
};

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxeld::fuzz::Session().Run(voxeld::fuzz::Script(data, size));
  return 0;
}
