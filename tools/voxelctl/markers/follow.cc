#include "tools/voxelctl/markers/follow.h"

#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "display/sync/clock.h"
#include "tools/markers/foxglove_client.h"
#include "tools/voxelctl/connection/session_end.h"
#include "tools/voxelctl/markers/marker_scene.h"
#include "tools/voxelctl/text/escape.h"

namespace voxeld::voxelctl {
namespace {

constexpr std::chrono::seconds kOpenTime(15);
constexpr sync::TimeNs kTellEvery = sync::kSecond, kRoomEvery = sync::kMillisecond;

absl::Status Escaped(const absl::Status& status) {
  return {status.code(), EscapeForTerminal(status.message())};
}

class Follower {
 public:
  Follower(const MarkersOptions& options, client::Session& session, markers::FoxgloveClient& source,
           const SessionEnd& end, Interrupt& interrupt, Console& console)
      : layer_(session.GetLayer(options.layer)),
        session_(session),
        source_(source),
        end_(end),
        interrupt_(interrupt),
        console_(console) {}

  absl::Status Run() {
    while (!interrupt_.requested() && !end_.ended()) {
      absl::StatusOr<markers::FoxgloveMessage> message = source_.Next();
      if (message.ok()) {
        if (absl::Status status = Take(*message); !status.ok()) return status;
      } else if (absl::IsInvalidArgument(message.status())) {
        Malformed(message.status());
      } else {
        return interrupt_.requested() ? absl::OkStatus() : message.status();
      }
      if (clock_.Now() >= tell_at_) Tell();
    }
    return end_.ended() ? end_.status() : absl::OkStatus();
  }

  void Tell() {
    tell_at_ = clock_.Now() + kTellEvery;
    const MarkerTally& tally = scene_.tally();
    if (!console_.json()) return console_.Progress(Text());
    console_.Data(nlohmann::ordered_json{{"event", "tally"},
                                         {"channels", source_.subscribed()},
                                         {"passed_over", source_.passed_over()},
                                         {"updates", tally.updates},
                                         {"entities", tally.entities},
                                         {"deletions", tally.deletions},
                                         {"malformed", tally.malformed},
                                         {"malformed_last", tally.malformed_last},
                                         {"refused", session_.GetTally().refused_operations},
                                         {"refused_first", Refused()},
                                         {"left_out", tally.left_out}}
                      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) +
                  "\n");
  }

  std::string Text() {
    const MarkerTally& tally = scene_.tally();
    std::string text = absl::StrFormat("%d channels, %d updates, %d entities", source_.subscribed(),
                                       tally.updates, tally.entities);
    if (tally.malformed > 0) {
      absl::StrAppend(&text, ", ", tally.malformed, " not read (",
                      EscapeForTerminal(tally.malformed_last), ")");
    }
    if (const std::string refused = Refused(); !refused.empty()) {
      absl::StrAppend(&text, ", ", session_.GetTally().refused_operations, " refused (",
                      EscapeForTerminal(refused), ")");
    }
    if (!tally.left_out.empty()) {
      absl::StrAppend(&text, ", not drawn: ", absl::StrJoin(tally.left_out, ", "));
    }
    if (source_.subscribed() == 0 && !source_.passed_over().empty()) {
      absl::StrAppend(
          &text, "; passed over: ", EscapeForTerminal(absl::StrJoin(source_.passed_over(), ", ")));
    }
    return text;
  }

 private:
  // What the server said of the first that it refused; nothing: it refused none.
  std::string Refused() const {
    const client::Tally tally = session_.GetTally();
    if (tally.refused_operations == 0 || tally.issues.empty()) return "";
    return client::DescribeIssue(tally.issues.front());
  }

  void Malformed(const absl::Status& status) {
    ++scene_.tally().malformed;
    scene_.tally().malformed_last = std::string(status.message());
  }

  absl::Status Take(const markers::FoxgloveMessage& message) {
    const absl::StatusOr<foxglove::SceneUpdate> update =
        markers::ParseSceneUpdate(message.payload, message.encoding);
    if (!update.ok()) {
      Malformed(update.status());
      return absl::OkStatus();
    }
    // Whoever sends faster than it is shown waits.
    while (!session_.HasRoom() && !end_.ended()) {
      if (interrupt_.WaitUntil(clock_, clock_.Now() + kRoomEvery)) return absl::OkStatus();
    }
    MarkerScene::Changes changes = scene_.Apply(message.topic, *update, clock_.Now());
    for (const std::string& id : changes.remove) {
      if (absl::Status status = layer_.Remove(id); !status.ok()) return status;
    }
    for (auto& [id, piece] : changes.put) {
      const absl::Status status =
          layer_.Put(id, std::move(piece.shape), std::move(piece.look)).status();
      if (absl::IsInvalidArgument(status)) {
        Malformed(status);
        if (absl::Status gone = layer_.Remove(id); !gone.ok()) return gone;  // what it was
      } else if (!status.ok()) {
        return status;
      }
    }
    return session_.Commit().status();
  }

  MarkerScene scene_;
  client::Layer layer_;
  client::Session& session_;
  markers::FoxgloveClient& source_;
  const SessionEnd& end_;
  Interrupt& interrupt_;
  Console& console_;
  sync::SystemClock clock_;
  sync::TimeNs tell_at_ = 0;
};

}  // namespace

absl::Status FollowMarkers(const MarkersOptions& options, Connection& connection,
                           Interrupt& interrupt, Console& console) {
  const absl::StatusOr<markers::FoxgloveUrl> url = markers::ParseFoxgloveUrl(options.url);
  if (!url.ok()) return Escaped(url.status());
  absl::StatusOr<std::unique_ptr<markers::FoxgloveClient>> source =
      markers::FoxgloveClient::Open({.url = *url, .topics = options.topics});
  if (!source.ok()) return Escaped(source.status());

  SessionEnd end;
  client::Options asked;
  asked.client_name = "voxelctl markers";
  asked.outcomes = false;
  asked.on_connection = [&](const client::ConnectionChange& change) {
    end.Told(change);
    if (end.ended()) (*source)->Interrupt();
  };
  absl::StatusOr<std::unique_ptr<client::Session>> session =
      connection.OpenLastingSession(std::move(asked));
  if (!session.ok()) return session.status();
  const int listener = interrupt.AddListener([&] {
    (*session)->Interrupt();
    (*source)->Interrupt();
  });
  const absl::Cleanup no_listener = [&] { interrupt.RemoveListener(listener); };
  if (absl::Status open = (*session)->WaitOpened(kOpenTime); !open.ok()) return Escaped(open);
  if (console.json()) {
    console.Data(nlohmann::ordered_json{{"event", "ready"}, {"source", options.url}}.dump() + "\n");
  } else {
    console.Say(absl::StrCat("follows ", EscapeForTerminal(options.url), "; Ctrl-C ends it"));
  }
  Follower follower(options, **session, **source, end, interrupt, console);
  absl::Status status = follower.Run();
  console.EndProgress();
  const client::Tally tally = (*session)->GetTally();
  if (status.ok() && tally.refused > 0 && !tally.issues.empty()) {
    status = absl::FailedPreconditionError(client::DescribeIssue(tally.issues.front()));
  }
  const absl::Status closed = (*session)->Close();
  if (status.ok()) status = closed;
  if (console.json()) {
    follower.Tell();
  } else {
    console.Say(follower.Text());
  }
  return Escaped(status);
}

}  // namespace voxeld::voxelctl
