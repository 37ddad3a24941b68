// Converts visualization_msgs/Marker to foxglove.SceneUpdate, and combines successive markers.
//
// Performs no I/O. Frames (header.frame_id, frame_locked) and stamps are ignored.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>

#include "absl/status/statusor.h"
#include "scene_update.pb.h"
#include "tools/ros/messages.h"

namespace voxeld::ros1 {

// Returns "NS/ID", which identifies a marker within its topic.
std::string EntityId(const Marker& marker);

// Converts a marker that is to be shown. A point of POINTS becomes a line from it to itself with
// the thickness scale.x, which is a ball; CUBE_LIST becomes triangles. A MESH_RESOURCE becomes a
// model, by its URL. Errors: InvalidArgument with the marker, what is wrong and what would be
// right: numbers that are not finite; an orientation whose length differs from 1 by more than a
// tenth (all zeros mean no rotation); points that do not form complete arrows, lines or triangles;
// as many cubes or spheres as markers::kMostPieces; text that is not UTF-8; a negative lifetime; an
// unknown type.
absl::StatusOr<foxglove::SceneEntity> EntityOf(const Marker& marker);

// The combined update of one topic that has not been taken yet. A marker that is added again or
// deleted replaces its earlier state.
class PendingMarkers {
 public:
  // The approximate maximum memory of waiting Add markers, in bytes. Beyond it, and beyond
  // markers::kMostPieces, markers are left out and reported.
  static constexpr size_t kMostBytes = size_t{256} << 20;

  struct Taken {
    foxglove::SceneUpdate update;  // its deletions refer to the state before it
    uint64_t malformed = 0;        // markers that could not be read
    std::string malformed_last;    // the reason for the last of them
    std::set<std::string> left_out;
  };

  // Applies a marker by its action. A marker that could not be read removes its earlier state.
  void Add(const Marker& marker);
  // Counts a whole message that could not be read.
  void AddMalformed(std::string why);

  bool empty() const;
  Taken Take();

 private:
  struct Waiting {
    foxglove::SceneEntity entity;
    size_t bytes = 0;
  };
  void Put(foxglove::SceneEntity entity);
  void Delete(const std::string& id);
  void Drop(const std::string& id);

  std::map<std::string, Waiting> entities_;  // by id
  std::set<std::string> deletions_;          // of entities that are not in entities_
  bool all_deleted_ = false;                 // before everything else
  int64_t pieces_ = 0;                       // in entities_
  size_t bytes_ = 0;
  uint64_t malformed_ = 0;
  std::string malformed_last_;
  std::set<std::string> left_out_;
};

}  // namespace voxeld::ros1
