// The scene as its rules say, written down a second time: maps that are searched from end to end,
// nothing kept that can be counted. For judging the store; shares its words only (operations,
// sizes of records), none of its code.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "daemon/scene/operation.h"

namespace voxeld::daemon::model {

struct PlainEntity {
  EntityData data;
  uint64_t sequence = 0;
  sync::TimeNs expires_ns = 0;  // 0: never
};

struct PlainLayer {
  uint64_t created = 0;  // ascending over all layers ever
  bool visible = true;
  uint32_t opacity = 255;
  int32_t order = 0;
  gpu::BlendMode blend = gpu::BlendMode::kOver;
  gpu::Affine transform;
  Clip clip;
  std::optional<gpu::Region> region;
  uint64_t writer = 0;  // the session
  bool orphaned = false;
  std::string client_name;
  std::map<std::string, PlainEntity> entities;
};

struct PlainOwner {
  std::map<std::string, PlainLayer> layers;
  std::map<std::string, std::vector<ObjectPart>> objects;
  bool hidden = false;
  uint64_t max_bytes = UINT64_MAX, max_entities = UINT64_MAX;  // as an operator set them
};

// An Issue that is to come. Where two reasons hold at once either may be told.
struct Refusal {
  uint64_t sequence = 0;
  Reason reason = Reason::kUnspecified;
  Reason or_else = Reason::kUnspecified;
  bool Matches(const Issue& issue) const {
    return issue.sequence == sequence && (issue.reason == reason || issue.reason == or_else);
  }
};

struct PlainAuthor {
  uint64_t owner = 0, session = 0;
  std::string client_name;
  bool strict = false;
};

struct PlainVerdict {
  bool applied = false;  // false: strict, and something was refused
  uint64_t applied_operations = 0, refused_operations = 0;
  std::vector<Refusal> refusals;  // told one by one
  bool hidden = false;  // it acted on layers that were and are hidden, and on nothing else
};

// What counts against quotas.
struct PlainCount {
  uint64_t entities = 0, layers = 0, objects = 0, bytes = 0;
  uint64_t drawables = 0;  // an instance counts as what it draws
};

class PlainScene {
 public:
  // Without a display nothing is too far out.
  PlainScene(const Limits& limits, bool displays) : limits_(limits), displays_(displays) {}

  std::map<uint64_t, PlainOwner> owners;

  // What is wrong with an operation whatever the scene is.
  static std::optional<Reason> WrongAlone(const Operation& operation, const Limits& limits);

  PlainVerdict Apply(const PlainAuthor& author, const std::vector<Operation>& operations,
                     sync::TimeNs now, uint64_t refused_before);
  void Expire(sync::TimeNs now);
  // The layers that `session` last wrote go, or change hands.
  void RemoveLayersOf(uint64_t session);
  void HandOver(uint64_t session, const std::string& client_name, bool orphaned);
  bool HasLayers(uint64_t session) const;

  PlainCount Count(const PlainOwner& owner) const;
  PlainCount CountAll() const;
  static uint64_t ContentBytes(const Content& content);
  static uint64_t ObjectBytes(const std::string& name, const std::vector<ObjectPart>& parts);
  static uint64_t EntityBytes(const std::string& layer, const std::string& id,
                              const EntityData& data);
  uint64_t LayerBytes(const PlainLayer& layer, const std::string& name) const;  // its entities'

  // All that the rules speak of, as text: equal scenes, equal texts.
  std::string Fingerprint() const;
  // What an engine is to draw: the layers in order of creation with their drawables; those that
  // show, and those that do not. `seen` leaves out layers in which nothing is.
  struct Picture {
    std::string shown, hidden, seen;
    void Add(bool shows, const std::string& layer, std::vector<std::string> drawables);
    bool operator==(const Picture&) const = default;
  };
  Picture Draw() const;

 private:
  class Commit;

  // Positions that something draws, in the coordinates that `outer` leads to.
  bool Reaches(const PlainOwner& owner, const Content& content, const gpu::Affine& outer,
               double limit) const;
  bool TooFar(const PlainOwner& owner, const Content& content, const gpu::Affine& in_layer,
              const gpu::Affine& layer) const;
  uint64_t Drawables(const PlainOwner& owner, const Content& content) const;
  uint32_t Depth(const PlainOwner& owner, const std::string& object) const;
  static bool Uses(const PlainOwner& owner, const std::string& object, const std::string& child);
  static void DrawContent(const PlainOwner& owner, const PlainEntity& entity,
                          const Content& content, const gpu::Affine& map,
                          std::vector<std::string>& out);

  const Limits limits_;
  const bool displays_;
  uint64_t layers_made_ = 0;
};

// One layer and one drawable of a Picture, from what an engine was told or the model knows.
std::string LayerText(int32_t order, uint32_t opacity, gpu::BlendMode blend,
                      const gpu::Affine& transform, const gpu::ClipPlane* planes, uint32_t count,
                      const gpu::Region* region);
std::string DrawableText(uint32_t priority, bool erase, const gpu::Affine& transform,
                         const gpu::GeometryRecord& record, std::span<const float> positions);

}  // namespace voxeld::daemon::model
