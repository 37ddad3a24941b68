// Client requests, decoded and validated by themselves: plain data without protobuf. daemon/wire
// creates them from bytes; the core applies them. Everything about a single operation has been
// validated (finite numbers, counts, enums, index ranges, id lengths). The core checks what depends
// on the scene (existence, quotas, cycles, range on the displays).
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "daemon/scene/clip.h"
#include "display/sync/clock.h"
#include "gpu/affine.h"
#include "gpu/curves/cut_need.h"
#include "gpu/delta.h"
#include "gpu/geometry_arrays.h"

namespace voxeld::daemon {

// The reason for a refusal. Values match the protocol's Reason.
enum class Reason : uint8_t {
  kUnspecified = 0,
  kInvalidValue = 1,
  kSizeMismatch = 2,
  kIndexOutOfRange = 3,
  kQuotaExceeded = 4,
  kNotFound = 5,
  kAlreadyExists = 6,
  kInUse = 7,
  kCycle = 8,
  kSingularTransform = 9,
  kOutOfRange = 10,
  kStaleSequence = 11,
  kOutOfOrder = 12,
  kPermissionDenied = 13,
  kUnimplemented = 14,
  kTimedOut = 15,
};

// One operation that was refused, or applied differently than requested. Not fatal.
struct Issue {
  uint64_t sequence = 0;
  std::string layer, id;
  std::string field;  // field path within the request
  Reason reason = Reason::kUnspecified;
  std::string message;   // the fault, the value and the remedy
  bool applied = false;  // not refused, but applied differently than requested
};

// Operations that were refused together, or applied differently than requested: the first
// max_issues_per_commit individually, the rest as counts. Also holds the first refusal, which may
// not be among the individual ones.
struct Refusals {
  std::vector<Issue> issues;
  uint64_t more = 0, more_applied = 0;
  std::optional<Issue> first;

  void Add(Issue issue, uint64_t most) {
    if (!first.has_value() && !issue.applied) first = issue;
    if (issues.size() < most) {
      issues.push_back(std::move(issue));
    } else {
      ++(issue.applied ? more_applied : more);
    }
  }
};

// The limits in force. Each one is a field here, in the configuration and in the protocol.
struct Limits {
  uint64_t max_message_bytes = 16u << 20;
  uint64_t max_entities_per_owner = 1'000'000;
  uint64_t max_layers_per_owner = 1024;
  uint64_t max_bytes_per_owner = uint64_t{1} << 30;
  // For all owners together, including those that have gone.
  uint64_t max_entities = 16'000'000;
  uint64_t max_layers = 65'536;
  uint64_t max_scene_bytes = uint64_t{2} << 30;
  uint64_t max_vertices_per_entity = 16u << 20;
  uint64_t max_indices_per_entity = 48u << 20;
  uint32_t max_id_bytes = 256;
  uint32_t max_operations_per_commit = 1'000'000;
  uint32_t max_issues_per_commit = 1000;  // further issues are counted in one Issue
  uint64_t max_uncommitted_bytes = 256u << 20;
  uint64_t max_uncommitted_bytes_total = uint64_t{4} << 30;  // of all sessions together
  uint32_t max_instance_depth = 8;
  double max_coordinate_voxels = 1073741824.0;  // 2³⁰
  double max_thickness = 4096;                  // in the unit of the thickness
  uint32_t max_sessions = 1024;
  uint32_t max_parts_per_object = 4096;
  // The maximum. A clip box uses six planes, a clip cylinder two planes and the cylinder itself.
  uint32_t max_clip_planes = gpu::kMaxClipPlanes;
  uint32_t max_clip_cylinders = gpu::kMaxClipCylinders;
  uint32_t max_captures = 16;
  int64_t max_linger_ns = 3600 * sync::kSecond;
  uint64_t credit_bytes = 8u << 20;  // sent by one session and not yet applied
  // Memory for all clients together; core/budget.h divides it.
  uint64_t max_memory_bytes = uint64_t{8} << 30;
  uint32_t max_riding_commits = 4096;  // of one session, not applied or lacking outcomes
  uint32_t max_timed_commits = 256;    // of one session, waiting for their presentation time
  int64_t max_present_at_horizon_ns = 60 * sync::kSecond;
  int64_t must_show_timeout_ns = 2 * sync::kSecond;
  uint32_t max_drop_oldest_frames = 64;
  uint64_t max_local_bytes = uint64_t{1} << 30;  // of one session's sealed memory
  uint64_t max_asset_bytes = 256u << 20;         // of one asset
  uint64_t max_assets_bytes = 512u << 20;        // of all assets; 0: assets are disabled
  uint64_t max_assets = 4096;                    // complete and incomplete
  // For the expressions of one shape together: operations, and nesting depth of their text.
  uint32_t max_expression_nodes = 1024;
  uint32_t max_expression_depth = 64;
  uint32_t max_boundary_points = 4096;      // of one shape's boundary
  uint64_t max_texture_texels = 16u << 20;  // of one texture
};

// Immutable content of a primitive: the engine's record (its id unused) and arrays. Engines read
// large arrays in place and receive small ones in a delta. Shared by snapshots.
struct GeometryData {
  gpu::GeometryRecord record;
  gpu::GeometryArrays arrays;  // with the lengths that the record states
  // Bounds in its own coordinates, without thickness.
  double min[3] = {}, max[3] = {};
  // Set if record and arrays do not represent the client's request: the primitive's name in the
  // protocol, and the primitive as it was sent.
  const char* kind = nullptr;
  std::string as_sent;
  gpu::CutNeed need;  // for curves and patches

  uint64_t bytes() const {
    return sizeof(*this) + as_sent.size() + arrays.positions().size_bytes() +
           arrays.indices().size_bytes() + arrays.colors().size_bytes();
  }
};
using GeometryPtr = std::shared_ptr<const GeometryData>;

struct InstanceRef {
  std::string object;
  uint32_t tint = 0x00FFFFFF;  // multiplies all colours (gpu/word.h)
  bool operator==(const InstanceRef&) const = default;
};

// Geometries that form one primitive: the letters of a text. Immutable; shared by snapshots.
struct GroupData {
  struct Part {
    GeometryPtr geometry;
    gpu::Affine transform;
  };
  std::vector<Part> parts;          // several parts may share a geometry
  double min[3] = {}, max[3] = {};  // of all parts, without thickness
  const char* kind = nullptr;       // as in GeometryData
  std::string as_sent;
  uint32_t color = 0x00FFFFFF;

  uint64_t bytes() const;
};
using GroupPtr = std::shared_ptr<const GroupData>;

using Content = std::variant<GeometryPtr, InstanceRef, GroupPtr>;

struct EntityData {
  Content content;
  gpu::Affine transform;
  uint32_t priority = 0;
  bool erase = false;
  int64_t lifetime_ns = 0;
  std::string label;
};

struct ObjectPart {
  Content content;
  gpu::Affine transform;
};

struct ObjectData {
  std::vector<ObjectPart> parts;
};

enum class DisconnectPolicy : uint8_t { kClear, kLinger, kKeep };

// Which draw batches are dropped while commits wait to be applied.
enum class FlowPolicy : uint8_t { kReliable, kLatest, kDropOldest };

struct OpenOptions {
  std::string client_name;
  DisconnectPolicy on_disconnect = DisconnectPolicy::kClear;
  int64_t linger_ns = 0;
  bool strict = false;
  bool no_outcomes = false;
  FlowPolicy flow = FlowPolicy::kReliable;
  uint32_t drop_oldest_frames = 0;        // kDropOldest: the number kept
  std::string resume_token, owner_token;  // empty: a new session, a new owner
  bool resumable = true;                  // false: the token is not sent to the client
  // The client's identity according to its credentials: all its sessions are one owner. Empty: no
  // identity.
  std::string principal;
  bool may_erase = true;  // may write layers that erase, including others' content
};

struct Upsert {
  std::string layer, id;
  EntityData entity;
};
struct Delete {
  enum class What : uint8_t { kId, kPrefix, kAllOfLayer, kAllMine };
  What what = What::kId;
  std::string layer, id_or_prefix;
  uint64_t guard_sequence = 0;
};
struct SetTransform {
  std::string layer, id;
  gpu::Affine transform;
};
struct LayerState {
  std::string layer;
  std::optional<bool> visible;
  std::optional<uint32_t> opacity;
  std::optional<int32_t> order;
  std::optional<gpu::BlendMode> blend;
  std::optional<gpu::Affine> transform;
  std::shared_ptr<const Clip> clip;                  // null: unchanged; empty: remove the clip
  std::optional<std::optional<gpu::Region>> region;  // holds nothing: remove the region
  std::optional<std::string> mask;  // a layer of the same owner; empty: remove the mask
};
struct FrameBegin {
  std::string layer;
};
struct FrameEnd {
  std::string layer;
};
struct DefineObject {
  std::string object;
  std::shared_ptr<const ObjectData> data;
};
struct DeleteObject {
  std::string object;
  bool cascade = false;
};
struct Commit {
  uint64_t frame_id = 0;
  int64_t send_time_ns = 0;  // the client's clock; 0: unknown
  uint64_t client_drops = 0;
  sync::TimeNs present_at_ns = 0;  // 0: immediately
  bool must_show = false;
  bool durable = false;  // request a receipt when it is on the disk
};

struct Operation {
  uint64_t sequence = 0;
  std::variant<Upsert, Delete, SetTransform, LayerState, FrameBegin, FrameEnd, DefineObject,
               DeleteObject, Commit>
      op;
};

}  // namespace voxeld::daemon
