// A second implementation of the scene's rules: maps that are searched from end to end, without
// stored counts. It judges the store, and shares only its types (operations, sizes of records),
// none of its code.
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
  uint64_t max_bytes = UINT64_MAX, max_entities = UINT64_MAX;  // as set by an operator
};

// An expected Issue. If two reasons apply at once, either may be reported.
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
  bool applied = false;  // false: strict, and an operation was refused
  uint64_t applied_operations = 0, refused_operations = 0;
  std::vector<Refusal> refusals;  // reported one by one
  bool hidden = false;            // it changed only layers that were and are hidden
};

// The amounts that count against quotas.
struct PlainCount {
  uint64_t entities = 0, layers = 0, objects = 0, bytes = 0;
  uint64_t drawables = 0;  // an instance counts as its drawables
};

class PlainScene {
 public:
  // Without a display, nothing is out of range.
  PlainScene(const Limits& limits, bool displays) : limits_(limits), displays_(displays) {}

  std::map<uint64_t, PlainOwner> owners;

  // Returns the reason for which an operation is refused whatever the scene is.
  static std::optional<Reason> WrongAlone(const Operation& operation, const Limits& limits);

  PlainVerdict Apply(const PlainAuthor& author, const std::vector<Operation>& operations,
                     sync::TimeNs now, uint64_t refused_before);
  void Expire(sync::TimeNs now);
  // Removes the layers that `session` last wrote, or hands them over.
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

  // Returns everything that the rules determine, as text: equal scenes give equal texts.
  std::string Fingerprint() const;
  // The drawing that is required of an engine: the layers in order of creation with their
  // drawables; those that show, and those that do not. `seen` leaves out empty layers.
  struct Picture {
    std::string shown, hidden, seen;
    void Add(bool shows, const std::string& layer, std::vector<std::string> drawables);
    bool operator==(const Picture&) const = default;
  };
  Picture Draw() const;

 private:
  class Commit;

  // Returns whether the content has drawn positions outside the range, in the coordinates to which
  // `outer` maps.
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

// Returns one layer or one drawable of a Picture as text, from what an engine was told or what the
// model knows.
std::string LayerText(int32_t order, uint32_t opacity, gpu::BlendMode blend,
                      const gpu::Affine& transform, const gpu::ClipPlane* planes, uint32_t count,
                      const gpu::Region* region);
std::string DrawableText(uint32_t priority, bool erase, const gpu::Affine& transform,
                         const gpu::GeometryRecord& record, std::span<const float> positions);

}  // namespace voxeld::daemon::model
