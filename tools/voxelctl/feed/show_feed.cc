#include "tools/voxelctl/feed/show_feed.h"

#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"
#include "display/sync/clock.h"
#include "tools/markers/marker_scene.h"
#include "tools/voxelctl/connection/session_end.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

using markers::FeedUpdate;
using markers::MarkerScene;
using markers::MarkerTally;

constexpr std::chrono::seconds kOpenTime(15);
constexpr sync::TimeNs kTellEvery = sync::kSecond, kRoomEvery = sync::kMillisecond;

std::string JsonLine(const nlohmann::ordered_json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

class Follower {
 public:
  Follower(const FeedShowing& showing, client::Session& session, markers::MarkerFeed& feed,
           const SessionEnd& end, Interrupt& interrupt, Console& console)
      : channel_(showing.channel),
        layer_(session.GetLayer(showing.layer)),
        session_(session),
        feed_(feed),
        end_(end),
        interrupt_(interrupt),
        console_(console) {}

  absl::Status Run() {
    while (!interrupt_.requested() && !end_.ended()) {
      absl::StatusOr<FeedUpdate> update = feed_.Next();
      if (update.ok()) {
        if (absl::Status status = Take(*update); !status.ok()) return status;
      } else if (absl::IsInvalidArgument(update.status())) {
        Malformed(1, std::string(update.status().message()));
      } else if (!interrupt_.requested() && !end_.ended()) {
        return update.status();
      }
      if (clock_.Now() >= tell_at_) Tell();
    }
    return end_.ended() ? end_.status() : absl::OkStatus();
  }

  void Tell() {
    tell_at_ = clock_.Now() + kTellEvery;
    if (!console_.json()) return console_.Progress(Text());
    const MarkerTally& tally = scene_.tally();
    nlohmann::ordered_json json{{"event", "tally"},
                                {"channels", feed_.subscribed()},
                                {"passed_over", feed_.passed_over()},
                                {"updates", tally.updates},
                                {"entities", tally.entities},
                                {"deletions", tally.deletions},
                                {"malformed", tally.malformed},
                                {"malformed_last", tally.malformed_last},
                                {"refused", session_.GetTally().refused_operations},
                                {"refused_first", Refused()},
                                {"left_out", tally.left_out}};
    for (const auto& [name, count] : feed_.counts()) json[name] = count;
    console_.Data(JsonLine(json));
  }

  std::string Text() {
    const MarkerTally& tally = scene_.tally();
    std::string text =
        absl::StrCat(Counted(feed_.subscribed(), channel_), ", ", Counted(tally.updates, "update"),
                     ", ", Counted(tally.entities, "entity", "entities"));
    for (const auto& [name, count] : feed_.counts()) {
      if (count > 0) absl::StrAppend(&text, ", ", count, " ", name);
    }
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
    const std::vector<std::string> passed_over = feed_.passed_over();
    if (feed_.subscribed() == 0 && !passed_over.empty()) {
      absl::StrAppend(&text,
                      "; passed over: ", EscapeForTerminal(absl::StrJoin(passed_over, ", ")));
    }
    return text;
  }

 private:
  // Returns the server's message about the first refusal; empty if there was none.
  std::string Refused() const {
    const client::Tally tally = session_.GetTally();
    if (tally.refused_operations == 0 || tally.issues.empty()) return "";
    return client::DescribeIssue(tally.issues.front());
  }

  void Malformed(uint64_t count, std::string last) {
    if (count == 0) return;
    scene_.tally().malformed += count;
    scene_.tally().malformed_last = std::move(last);
  }

  void News(const std::string& line) {
    if (console_.json()) {
      console_.Data(JsonLine({{"event", "news"}, {"text", line}}));
    } else {
      console_.Say(EscapeForTerminal(line));
    }
  }

  absl::Status Take(const FeedUpdate& from) {
    for (const std::string& line : from.news) News(line);
    Malformed(from.malformed, from.malformed_last);
    scene_.tally().left_out.insert(from.left_out.begin(), from.left_out.end());
    if (from.topic.empty()) return absl::OkStatus();
    // A sender that is faster than the display waits.
    while (!session_.HasRoom() && !end_.ended()) {
      if (interrupt_.WaitUntil(clock_, clock_.Now() + kRoomEvery)) return absl::OkStatus();
    }
    if (end_.ended()) return end_.status();
    MarkerScene::Changes changes = scene_.Apply(from.topic, from.update, clock_.Now());
    for (const std::string& id : changes.remove) {
      if (absl::Status status = layer_.Remove(id); !status.ok()) return status;
    }
    for (auto& [id, piece] : changes.put) {
      const absl::Status status =
          layer_.Put(id, std::move(piece.shape), std::move(piece.look)).status();
      if (absl::IsInvalidArgument(status)) {
        Malformed(1, std::string(status.message()));
        // Removes its previous state.
        if (absl::Status gone = layer_.Remove(id); !gone.ok()) return gone;
      } else if (!status.ok()) {
        return status;
      }
    }
    return session_.Commit().status();
  }

  MarkerScene scene_;
  const std::string channel_;
  client::Layer layer_;
  client::Session& session_;
  markers::MarkerFeed& feed_;
  const SessionEnd& end_;
  Interrupt& interrupt_;
  Console& console_;
  sync::SystemClock clock_;
  sync::TimeNs tell_at_ = 0;
};

}  // namespace

absl::Status Escaped(const absl::Status& status) {
  return {status.code(), EscapeForTerminal(status.message())};
}

absl::Status ShowFeed(const FeedShowing& showing, markers::MarkerFeed& feed, Connection& connection,
                      Interrupt& interrupt, Console& console) {
  SessionEnd end;
  client::Options asked;
  asked.client_name = showing.client_name;
  asked.outcomes = false;
  asked.reconnect = showing.reconnect;
  asked.on_connection = [&](const client::ConnectionChange& change) {
    end.Told(change);
    if (end.ended()) feed.Interrupt();
  };
  absl::StatusOr<std::unique_ptr<client::Session>> session =
      connection.OpenLastingSession(std::move(asked));
  if (!session.ok()) return session.status();
  const int listener = interrupt.AddListener([&] {
    (*session)->Interrupt();
    feed.Interrupt();
  });
  const absl::Cleanup no_listener = [&] { interrupt.RemoveListener(listener); };
  if (absl::Status open = (*session)->WaitOpened(kOpenTime); !open.ok()) return Escaped(open);
  if (console.json()) {
    console.Data(JsonLine({{"event", "ready"}, {"source", showing.source}}));
  } else {
    console.Say(absl::StrCat("follows ", EscapeForTerminal(showing.source), "; Ctrl-C ends it"));
  }
  Follower follower(showing, **session, feed, end, interrupt, console);
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
