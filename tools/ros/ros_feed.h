// A feed of ROS 1 markers: a node that subscribes to visualization_msgs/MarkerArray and Marker.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/markers/marker_feed.h"

namespace voxeld::ros1 {

struct RosOptions {
  std::string master;  // http://HOST:PORT
  std::vector<std::string>
      topics;  // names resolved by ROS; empty: all of the two types that have a publisher
  std::map<std::string, std::string> remappings;  // as roslaunch passes them: "__name" to a name
};

// Requires: created at most once per process. A thread asks the master every second which topics
// exist. If the master is unreachable or was replaced, the feed reports it (FeedUpdate::news),
// waits for it and subscribes to everything again. Messages are received as they come; messages of
// a topic that have not been taken yet are combined into one update. A message that is longer than
// kMostMessageBytes or truncated is dropped completely.
class RosFeed final : public markers::MarkerFeed {
 public:
  static constexpr size_t kMostMessageBytes = size_t{64} << 20;

  // Does not wait for the master. `on_shutdown` is called from a thread of the feed when the master
  // asks this node to end. Errors: InvalidArgument for an invalid address or name.
  static absl::StatusOr<std::unique_ptr<RosFeed>> Open(const RosOptions& options,
                                                       std::function<void()> on_shutdown);
  ~RosFeed() override;
  RosFeed(const RosFeed&) = delete;
  RosFeed& operator=(const RosFeed&) = delete;

  absl::StatusOr<markers::FeedUpdate> Next() override;
  size_t subscribed() const override;
  std::vector<std::string> passed_over() const override;
  // "messages" that were received; "joined", those combined with others that still waited.
  std::vector<std::pair<std::string, uint64_t>> counts() const override;
  void Interrupt() override;

  // Unregisters the node from the master. Returns false if the master did not answer within a few
  // seconds: then threads remain that only the end of the process without destructors (std::_Exit)
  // ends.
  bool Close();

 private:
  class Impl;
  explicit RosFeed(std::shared_ptr<Impl> impl);
  std::shared_ptr<Impl> impl_;  // shared with the thread
  std::thread thread_;
};

}  // namespace voxeld::ros1
