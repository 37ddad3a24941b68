// Markers of ROS 1: a node that subscribes to visualization_msgs/MarkerArray and Marker.
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
      topics;  // names as ROS resolves them; empty: all of the two types that have a publisher
  std::map<std::string, std::string> remappings;  // as roslaunch gives them: "__name" to a name
};

// One in a process, and once. The master is asked each second, by a thread of its own, which topics there are; one that is away, or
// another in its place, is waited for and told (FeedUpdate::news), and everything is subscribed to anew. Messages are taken as they
// come; those of a topic that nobody has taken yet become one update. Of a message that is longer than kMostMessageBytes, or that is cut
// short, nothing is taken.
class RosFeed final : public markers::MarkerFeed {
 public:
  static constexpr size_t kMostMessageBytes = size_t{64} << 20;

  // Does not wait for the master. `on_shutdown` is called from a thread of the feed when the master has this node end.
  // InvalidArgument: an address, a name.
  static absl::StatusOr<std::unique_ptr<RosFeed>> Open(const RosOptions& options,
                                                       std::function<void()> on_shutdown);
  ~RosFeed() override;
  RosFeed(const RosFeed&) = delete;
  RosFeed& operator=(const RosFeed&) = delete;

  absl::StatusOr<markers::FeedUpdate> Next() override;
  size_t subscribed() const override;
  std::vector<std::string> passed_over() const override;
  // "messages" that came; those "joined" to others that still waited.
  std::vector<std::pair<std::string, uint64_t>> counts() const override;
  void Interrupt() override;

  // Takes the node from the master. False: the master did not answer in a few seconds, and threads are left that only the process's
  // end, without destructors (std::_Exit), ends.
  bool Close();

 private:
  class Impl;
  explicit RosFeed(std::shared_ptr<Impl> impl);
  std::shared_ptr<Impl> impl_;  // the thread's as well
  std::thread thread_;
};

}  // namespace voxeld::ros1
