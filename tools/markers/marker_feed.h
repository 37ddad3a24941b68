// Where updates of robots' scenes come from: a server of Foxglove's, a ROS master and its publishers.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "scene_update.pb.h"

namespace voxeld::markers {

struct FeedUpdate {
  std::string topic;  // empty: there is no update, only what stands below
  foxglove::SceneUpdate update;
  uint64_t malformed = 0;          // what came with it and could not be read
  std::string malformed_last;      // and why
  std::set<std::string> left_out;  // what of it is not drawn
  std::vector<std::string> news;   // of the source, each a line for people
};

// For one thread, but for Interrupt.
class MarkerFeed {
 public:
  virtual ~MarkerFeed() = default;

  // Blocks until there is something. InvalidArgument is a message that could not be read: the next call goes on. Any other
  // status is the feed's end, that after Interrupt among them.
  virtual absl::StatusOr<FeedUpdate> Next() = 0;

  // Channels or topics that are followed, and what is there but is not.
  virtual size_t subscribed() const = 0;
  virtual std::vector<std::string> passed_over() const = 0;

  // What else is counted, by name.
  virtual std::vector<std::pair<std::string, uint64_t>> counts() const { return {}; }

  // Thread-safe: Next ends.
  virtual void Interrupt() = 0;
};

}  // namespace voxeld::markers
