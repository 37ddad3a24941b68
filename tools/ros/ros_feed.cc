#include "tools/ros/ros_feed.h"

#include <ros/callback_queue.h>
#include <ros/master.h>
#include <ros/network.h>
#include <ros/ros.h>
#include <ros/spinner.h>
#include <ros/this_node.h>
#include <xmlrpcpp/XmlRpcException.h>

#include <exception>
#include <optional>
#include <set>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "display/sync/clock.h"
#include "display/sync/mutex.h"
#include "tools/ros/marker_array.h"
#include "tools/ros/raw_message.h"

namespace voxeld::ros1 {
namespace {

constexpr sync::TimeNs kLookEvery = sync::kSecond, kCloseTime = 3 * sync::kSecond;
constexpr const char* kNodeName = "voxeld";

void AddAll(const Marker& marker, PendingMarkers* to) { to->Add(marker); }
void AddAll(const MarkerArray& array, PendingMarkers* to) {
  for (const Marker& marker : array.markers) to->Add(marker);
}

// Runs a call that may throw roscpp's exceptions, and converts them to a status.
absl::Status Guarded(const std::function<void()>& call) {
  try {
    call();
    return absl::OkStatus();
  } catch (const std::exception& error) {
    return absl::InvalidArgumentError(error.what());
  } catch (const XmlRpc::XmlRpcException& error) {
    return absl::InvalidArgumentError(error.getMessage());
  }
}

}  // namespace

class RosFeed::Impl {
 public:
  Impl(const RosOptions& options, std::function<void()> on_shutdown)
      : options_(options), on_shutdown_(std::move(on_shutdown)) {}

  absl::Status Init() {
    std::string host;
    uint32_t port = 0;
    if (!ros::network::splitURI(options_.master, host, port) || host.empty() || port == 0 ||
        port > 65535) {
      return absl::InvalidArgumentError(absl::StrCat(
          options_.master, " is no address of a ROS master, such as http://localhost:11311"));
    }
    return Guarded([&] {
      ros::M_string remappings(options_.remappings.begin(), options_.remappings.end());
      remappings["__master"] = options_.master;
      ros::init(remappings, kNodeName,
                ros::init_options::AnonymousName | ros::init_options::NoSigintHandler |
                    ros::init_options::NoRosout);
      // Errors of roscpp's calls are reported here, so its own logging is turned off.
      ros::console::set_logger_level(ROSCONSOLE_DEFAULT_NAME, ros::console::levels::Fatal);
      ros::console::notifyLoggerLevelsChanged();
      ros::master::setRetryTimeout(ros::WallDuration(1));
      for (const std::string& topic : options_.topics) wanted_.insert(ros::names::resolve(topic));
    });
  }

  // Runs until Interrupt.
  void Run() {
    while (!stopped()) {
      Look();
      if (node_ && !ros::ok() && !stopped()) on_shutdown_();
      sync::MutexLock lock(mutex_);
      const sync::TimeNs next = clock_.Now() + kLookEvery;
      while (!stopped_ && clock_.Now() < next) clock_.WaitUntil(mutex_, changed_, next);
    }
    (void)Guarded([&] {
      if (spinner_) spinner_->stop();
      subscriptions_.clear();
      node_.reset();
      ros::shutdown();
    });
    sync::MutexLock lock(mutex_);
    ended_ = true;
    changed_.NotifyAll();
  }

  absl::StatusOr<markers::FeedUpdate> Next() {
    sync::MutexLock lock(mutex_);
    for (;;) {
      if (stopped_) return absl::CancelledError("interrupted");
      markers::FeedUpdate out;
      out.news = std::exchange(news_, {});
      if (TakePending(&out) || !out.news.empty()) return out;
      changed_.Wait(mutex_);
    }
  }

  bool WaitEnded(sync::TimeNs within) {
    const sync::TimeNs deadline = clock_.Now() + within;
    sync::MutexLock lock(mutex_);
    while (!ended_ && clock_.Now() < deadline) clock_.WaitUntil(mutex_, changed_, deadline);
    return ended_;
  }

  void Interrupt() {
    sync::MutexLock lock(mutex_);
    stopped_ = true;
    changed_.NotifyAll();
  }

  size_t subscribed() const {
    sync::MutexLock lock(mutex_);
    return subscribed_;
  }
  std::vector<std::string> passed_over() const {
    sync::MutexLock lock(mutex_);
    return {passed_over_.begin(), passed_over_.end()};
  }
  std::vector<std::pair<std::string, uint64_t>> counts() const {
    sync::MutexLock lock(mutex_);
    return {{"messages", messages_}, {"joined", joined_}};
  }

 private:
  struct Subscription {
    std::string type;
    ros::Subscriber subscriber;
  };

  bool stopped() const {
    sync::MutexLock lock(mutex_);
    return stopped_;
  }

  void News(std::string line) {
    sync::MutexLock lock(mutex_);
    news_.push_back(std::move(line));
    changed_.NotifyAll();
  }

  // Calls the master once, without waiting for one that is unreachable.
  bool Ask(const char* method, const std::string& argument, XmlRpc::XmlRpcValue* payload) {
    XmlRpc::XmlRpcValue arguments, answer;
    arguments[0] = ros::this_node::getName();
    arguments[1] = argument;
    return ros::master::execute(method, arguments, answer, *payload, false);
  }

  void Look() {
    std::vector<std::pair<std::string, std::string>> topics;
    bool there = false;
    const absl::Status status = Guarded([&] {
      XmlRpc::XmlRpcValue payload;
      there = Ask("getPublishedTopics", "", &payload);
      for (int i = 0; there && i < payload.size(); ++i) {
        topics.emplace_back(std::string(payload[i][0]), std::string(payload[i][1]));
      }
    });
    there = there && status.ok();
    if (there != there_) {
      if (!there) {
        News(absl::StrCat("waits for the ROS master at ", options_.master));
      } else if (there_.has_value()) {
        News(absl::StrCat("the ROS master at ", options_.master, " is there"));
      }
      there_ = there;
    }
    if (!there) return;
    const absl::Status done = Guarded([&] {
      Start();
      Follow(topics);
    });
    if (!done.ok()) News(absl::StrCat("the ROS master: ", std::string(done.message())));
  }

  void Start() {
    if (!node_) {
      node_ = std::make_unique<ros::NodeHandle>();
      spinner_ = std::make_unique<ros::AsyncSpinner>(1, &queue_);
      spinner_->start();
      return;
    }
    // A restarted master does not know this node.
    XmlRpc::XmlRpcValue payload;
    if (!subscriptions_.empty() && !Ask("lookupNode", ros::this_node::getName(), &payload)) {
      subscriptions_.clear();
    }
  }

  void Follow(const std::vector<std::pair<std::string, std::string>>& topics) {
    for (const auto& [name, type] : topics) {
      if (!wanted_.empty() && !wanted_.contains(name)) continue;
      const bool array = type == "visualization_msgs/MarkerArray";
      if (!array && type != "visualization_msgs/Marker") {
        if (wanted_.empty()) continue;
        sync::MutexLock lock(mutex_);
        passed_over_.insert(absl::StrCat(name, " (", type, ")"));
        continue;
      }
      const auto at = subscriptions_.find(name);
      if (at != subscriptions_.end()) {
        if (at->second.type == type) continue;
        subscriptions_.erase(at);
      }
      ros::Subscriber subscriber = array ? Subscribe<MarkerArray>(name) : Subscribe<Marker>(name);
      if (!subscriber) continue;  // the master became unreachable meanwhile
      subscriptions_[name] = {type, subscriber};
      News(absl::StrCat("follows ", name, " (", type, ")"));
    }
    sync::MutexLock lock(mutex_);
    subscribed_ = subscriptions_.size();
  }

  template <typename Message>
  ros::Subscriber Subscribe(const std::string& topic) {
    ros::SubscribeOptions options;
    // The queue is unlimited, so no message is lost before it is counted; they are read
    // immediately.
    constexpr uint32_t kUnlimited = 0;
    options.init<RawMessage<Message>>(
        topic, kUnlimited, [this, topic](const boost::shared_ptr<const RawMessage<Message>>& raw) {
          Take<Message>(topic, raw->bytes);
        });
    options.callback_queue = &queue_;
    return node_->subscribe(options);
  }

  template <typename Message>
  void Take(const std::string& topic, const std::vector<uint8_t>& bytes) {
    Message message;
    absl::Status status;
    if (bytes.size() > kMostMessageBytes) {
      status = absl::InvalidArgumentError(
          absl::StrCat("it has ", bytes.size(), " bytes; ", kMostMessageBytes, " are the most"));
    } else {
      status = Guarded([&] {
        ros::serialization::IStream stream(const_cast<uint8_t*>(bytes.data()),
                                           static_cast<uint32_t>(bytes.size()));
        ros::serialization::deserialize(stream, message);
      });
    }
    sync::MutexLock lock(mutex_);
    ++messages_;
    PendingMarkers& pending = pending_[topic];
    if (!pending.empty()) ++joined_;
    if (status.ok()) {
      AddAll(message, &pending);
    } else {
      pending.AddMalformed(absl::StrCat("a message of ", topic, ": ", status.message()));
    }
    changed_.NotifyAll();
  }

  // Takes from the topic after the previous one, so that each has its turn.
  bool TakePending(markers::FeedUpdate* out) VOXELD_REQUIRES(mutex_) {
    auto at = pending_.upper_bound(taken_last_);
    for (size_t i = 0; i < pending_.size(); ++i, ++at) {
      if (at == pending_.end()) at = pending_.begin();
      if (at->second.empty()) continue;
      PendingMarkers::Taken taken = at->second.Take();
      taken_last_ = at->first;
      if (taken.update.entities_size() > 0 || taken.update.deletions_size() > 0) {
        out->topic = at->first;
      }
      out->update = std::move(taken.update);
      out->malformed = taken.malformed;
      out->malformed_last = std::move(taken.malformed_last);
      out->left_out = std::move(taken.left_out);
      return true;
    }
    return false;
  }

  const RosOptions options_;
  const std::function<void()> on_shutdown_;
  mutable sync::SystemClock clock_;

  // Used only by the running thread.
  std::set<std::string> wanted_;
  std::optional<bool> there_;
  ros::CallbackQueue queue_;
  std::unique_ptr<ros::NodeHandle> node_;
  std::unique_ptr<ros::AsyncSpinner> spinner_;
  std::map<std::string, Subscription> subscriptions_;  // by topic

  mutable sync::Mutex mutex_;
  sync::CondVar changed_;
  std::map<std::string, PendingMarkers> pending_ VOXELD_GUARDED_BY(mutex_);  // by topic
  std::string taken_last_ VOXELD_GUARDED_BY(mutex_);
  std::vector<std::string> news_ VOXELD_GUARDED_BY(mutex_);
  std::set<std::string> passed_over_ VOXELD_GUARDED_BY(mutex_);
  size_t subscribed_ VOXELD_GUARDED_BY(mutex_) = 0;
  uint64_t messages_ VOXELD_GUARDED_BY(mutex_) = 0, joined_ VOXELD_GUARDED_BY(mutex_) = 0;
  bool stopped_ VOXELD_GUARDED_BY(mutex_) = false, ended_ VOXELD_GUARDED_BY(mutex_) = false;
};

RosFeed::RosFeed(std::shared_ptr<Impl> impl)
    : impl_(std::move(impl)), thread_([impl = impl_] { impl->Run(); }) {}

absl::StatusOr<std::unique_ptr<RosFeed>> RosFeed::Open(const RosOptions& options,
                                                       std::function<void()> on_shutdown) {
  auto impl = std::make_shared<Impl>(options, std::move(on_shutdown));
  if (absl::Status status = impl->Init(); !status.ok()) return status;
  return std::unique_ptr<RosFeed>(new RosFeed(std::move(impl)));
}

RosFeed::~RosFeed() { Close(); }

absl::StatusOr<markers::FeedUpdate> RosFeed::Next() { return impl_->Next(); }
size_t RosFeed::subscribed() const { return impl_->subscribed(); }
std::vector<std::string> RosFeed::passed_over() const { return impl_->passed_over(); }
std::vector<std::pair<std::string, uint64_t>> RosFeed::counts() const { return impl_->counts(); }
void RosFeed::Interrupt() { impl_->Interrupt(); }

bool RosFeed::Close() {
  if (!thread_.joinable()) return true;
  impl_->Interrupt();
  const bool ended = impl_->WaitEnded(kCloseTime);
  if (ended) {
    thread_.join();
  } else {
    thread_.detach();
  }
  return ended;
}

}  // namespace voxeld::ros1
