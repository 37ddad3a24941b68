// visualization_msgs/Marker as foxglove.SceneUpdate: what each is, and what several after one another come to.
//
// Pure. Frames (header.frame_id, frame_locked) and stamps are not looked at.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>

#include "absl/status/statusor.h"
#include "scene_update.pb.h"
#include "tools/ros/messages.h"

namespace voxeld::ros1 {

// "NS/ID", which names a marker within its topic.
std::string EntityId(const Marker& marker);

// A marker that is to be shown. A point of POINTS is a line from it to itself, as thick as scale.x: a ball; CUBE_LIST is triangles. Of
// a MESH_RESOURCE there is a model, by its URL. InvalidArgument names the marker, what is wrong and what would be right: numbers that are not
// finite, an orientation whose length is more than a tenth from 1 (all zeros are none), points that make no whole arrow, line or triangle, as
// many cubes or spheres as markers::kMostPieces, text that is not UTF-8, a lifetime below 0, a type that there is not.
absl::StatusOr<foxglove::SceneEntity> EntityOf(const Marker& marker);

// What markers of one topic come to that nobody has taken yet. Whatever is told again, or taken away, stands in for what was told before.
class PendingMarkers {
 public:
  // Of Add, in bytes that waiting takes, about. Beyond, as beyond markers::kMostPieces, markers are left out, and told.
  static constexpr size_t kMostBytes = size_t{256} << 20;

  struct Taken {
    foxglove::SceneUpdate update;  // deletions are of what was there before
    uint64_t malformed = 0;        // markers that could not be read
    std::string malformed_last;    // and why
    std::set<std::string> left_out;
  };

  // By the marker's action. One that could not be read takes away what it was before.
  void Add(const Marker& marker);
  // All that is told of a whole message that could not be read.
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
  std::set<std::string> deletions_;          // of none that is in entities_
  bool all_deleted_ = false;                 // before the rest
  int64_t pieces_ = 0;                       // of entities_
  size_t bytes_ = 0;
  uint64_t malformed_ = 0;
  std::string malformed_last_;
  std::set<std::string> left_out_;
};

}  // namespace voxeld::ros1
