#include "tools/voxelctl/markers/follow.h"

#include <memory>
#include <utility>

#include "tools/markers/foxglove_client.h"
#include "tools/markers/marker_feed.h"
#include "tools/markers/markers.h"
#include "tools/voxelctl/feed/show_feed.h"

namespace voxeld::voxelctl {
namespace {

class FoxgloveFeed final : public markers::MarkerFeed {
 public:
  explicit FoxgloveFeed(std::unique_ptr<markers::FoxgloveClient> client)
      : client_(std::move(client)) {}

  absl::StatusOr<markers::FeedUpdate> Next() override {
    absl::StatusOr<markers::FoxgloveMessage> message = client_->Next();
    if (!message.ok()) return message.status();
    absl::StatusOr<foxglove::SceneUpdate> update =
        markers::ParseSceneUpdate(message->payload, message->encoding);
    if (!update.ok()) return update.status();
    markers::FeedUpdate out;
    out.topic = std::move(message->topic);
    out.update = *std::move(update);
    return out;
  }

  size_t subscribed() const override { return client_->subscribed(); }
  std::vector<std::string> passed_over() const override { return client_->passed_over(); }
  void Interrupt() override { client_->Interrupt(); }

 private:
  const std::unique_ptr<markers::FoxgloveClient> client_;
};

}  // namespace

absl::Status FollowMarkers(const MarkersOptions& options, const Connector& connect,
                           Interrupt& interrupt, Console& console) {
  const absl::StatusOr<std::unique_ptr<Connection>> connected = connect();
  if (!connected.ok()) return connected.status();
  Connection& connection = **connected;
  const absl::StatusOr<markers::FoxgloveUrl> url = markers::ParseFoxgloveUrl(options.url);
  if (!url.ok()) return Escaped(url.status());
  absl::StatusOr<std::unique_ptr<markers::FoxgloveClient>> source =
      markers::FoxgloveClient::Open({.url = *url, .topics = options.topics});
  if (!source.ok()) return Escaped(source.status());
  FoxgloveFeed feed(*std::move(source));
  return ShowFeed(
      {.source = options.url, .layer = options.layer, .client_name = "voxelctl markers"}, feed,
      connection, interrupt, console);
}

}  // namespace voxeld::voxelctl
