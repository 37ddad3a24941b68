// Sources of updates of robots' scenes: a Foxglove server, or a ROS master and its publishers.
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
  std::string topic;  // empty: there is no update, only the fields below
  foxglove::SceneUpdate update;
  uint64_t malformed = 0;          // parts of the message that could not be read
  std::string malformed_last;      // the reason for the last of them
  std::set<std::string> left_out;  // parts that are not drawn
  std::vector<std::string> news;   // about the source, each a line for people
};

// Bound to one thread, except Interrupt.
class MarkerFeed {
 public:
  virtual ~MarkerFeed() = default;

  // Blocks until there is something. Errors: InvalidArgument means that a message could not be
  // read, and the next call continues. Any other status, including that after Interrupt, is the end
  // of the feed.
  virtual absl::StatusOr<FeedUpdate> Next() = 0;

  // Return how many channels or topics are followed, and which exist but are not followed.
  virtual size_t subscribed() const = 0;
  virtual std::vector<std::string> passed_over() const = 0;

  // Returns further counters, by name.
  virtual std::vector<std::pair<std::string, uint64_t>> counts() const { return {}; }

  // Makes Next return. Thread-safe.
  virtual void Interrupt() = 0;
};

}  // namespace voxeld::markers
