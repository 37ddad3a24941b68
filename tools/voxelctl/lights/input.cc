#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/text/printable.h"
#include "display/sync/clock.h"
#include "tools/lights/intake.h"
#include "tools/lights/receiver.h"
#include "tools/voxelctl/connection/session_end.h"
#include "tools/voxelctl/lights/choose_lights.h"
#include "tools/voxelctl/lights/lights.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

constexpr sync::TimeNs kRoomEvery = sync::kMillisecond;  // polling interval while a picture waits
constexpr sync::TimeNs kTellEvery = sync::kSecond;
constexpr std::chrono::seconds kOpenTime(15);
constexpr const char* kMalformed = "malformed";

const char* NameOf(lights::Protocol protocol) {
  switch (protocol) {
    case lights::Protocol::kDdp:
      return "DDP";
    case lights::Protocol::kE131:
      return "E1.31";
    case lights::Protocol::kArtNet:
      return "Art-Net";
    case lights::Protocol::kOpc:
      break;
  }
  return "Open Pixel Control";
}

nlohmann::ordered_json TallyJson(const lights::Intake& intake, const lights::Receiver& receiver,
                                 const client::Tally& session) {
  const lights::IntakeTally& in = intake.tally();
  const lights::ReceiverTally peers = receiver.tally();
  return {{"event", "tally"},
          {"messages", in.messages},
          {"set", in.set},
          {"shows", in.shows},
          {"ended", in.ended},
          {"other", in.other},
          {"outside", in.outside},
          {"outranked", in.outranked},
          {"stale", in.stale},
          {"malformed", in.malformed},
          {"malformed_last", std::string(intake.malformed().message())},
          {"split", in.split},
          {"beyond", in.beyond},
          {"unused", in.unused},
          {"unmapped", in.unmapped},
          {"lost", in.lost},
          {"bytes", in.bytes},
          {"pictures", in.pictures},
          {"superseded", in.superseded},
          {"waiting", intake.waiting() ? 1 : 0},
          {"committed", in.taken},
          {"accepted", session.accepted},
          {"refused", session.refused},
          {"connections", peers.connections},
          {"connections_refused", peers.refused},
          {"connections_cut_off", peers.cut_off},
          {"connections_open", peers.open}};
}

std::string TallyText(const lights::Intake& intake) {
  const lights::IntakeTally& in = intake.tally();
  std::string text =
      absl::StrCat(Counted(in.messages, "message"), ", ", Counted(in.pictures, "picture"), ": ",
                   in.taken, " put up, ", in.superseded, " superseded");
  for (const auto& [count, what] :
       {std::pair{in.lost, "lost"}, std::pair{in.malformed, kMalformed},
        std::pair{in.outside, "for lights that are not there"},
        std::pair{in.outranked, "of lower priority"}, std::pair{in.stale, "late"},
        std::pair{in.beyond, "with values for lights that are not there"},
        std::pair{in.split, "that end within a light"},
        std::pair{in.unused,
                  "with values behind the universe's channels (--universe-channels 512?)"},
        std::pair{in.unmapped, "for channels from 2 on (--per-channel N?)"}}) {
    if (count > 0) absl::StrAppend(&text, ", ", count, " ", what);
    if (count > 0 && what == kMalformed) {
      absl::StrAppend(&text, count == 1 ? " (" : " (the last: ",
                      EscapeForTerminal(intake.malformed().message()), ")");
    }
  }
  return text;
}

}  // namespace

absl::Status Input(const InputOptions& options, const Connector& connect, Interrupt& interrupt,
                   Console& console) {
  const absl::StatusOr<std::unique_ptr<Connection>> connected = connect();
  if (!connected.ok()) return connected.status();
  Connection& connection = **connected;
  const absl::StatusOr<LightMap> map = ChooseLights(options.lights, connection);
  if (!map.ok()) return map.status();
  sync::SystemClock clock;
  lights::IntakeOptions wanted;
  wanted.protocol = options.protocol;
  wanted.lights = map->lights;
  wanted.first_universe = options.first_universe;
  wanted.universe_channels = static_cast<size_t>(options.universe_channels);
  wanted.a_channel = static_cast<size_t>(options.a_channel);
  wanted.gather_ns = static_cast<sync::TimeNs>(options.gather_ms * sync::kMillisecond);
  lights::Intake intake(wanted);
  absl::StatusOr<std::unique_ptr<lights::Receiver>> opened = lights::Receiver::Open(
      {.listen = options.listen, .multicast = options.multicast}, wanted, intake, clock);
  if (!opened.ok()) {
    return {opened.status().code(), EscapeForTerminal(opened.status().message())};
  }
  lights::Receiver& receiver = **opened;

  SessionEnd ending;
  client::Options asked;
  asked.client_name = absl::StrCat("voxelctl input ", NameOf(options.protocol));
  asked.flow = client::Flow::kLatest;
  asked.outcomes = false;
  asked.on_connection = [&ending](const client::ConnectionChange& change) { ending.Told(change); };
  absl::StatusOr<std::unique_ptr<client::Session>> session =
      connection.OpenLastingSession(std::move(asked));
  if (!session.ok()) return session.status();
  const int listener = interrupt.AddListener([&] {
    (*session)->Interrupt();
    receiver.Wake();
  });
  const absl::Cleanup no_listener = [&] { interrupt.RemoveListener(listener); };
  if (absl::Status open = (*session)->WaitOpened(kOpenTime); !open.ok()) {
    return {open.code(), EscapeForTerminal(open.message())};
  }
  const client::Layer layer = (*session)->GetLayer(options.lights.layer);
  if (console.json()) {
    console.Data(nlohmann::ordered_json{{"event", "ready"},
                                        {"protocol", NameOf(options.protocol)},
                                        {"listen", receiver.address()},
                                        {"groups", receiver.tally().groups},
                                        {"lights", map->lights}}
                     .dump() +
                 "\n");
  } else {
    console.Say(absl::StrCat("takes ", NameOf(options.protocol), " on ", receiver.address(),
                             " for ", map->where, "; Ctrl-C ends it"));
  }

  const auto tell = [&] {
    if (!console.json()) return console.Progress(TallyText(intake));
    console.Data(TallyJson(intake, receiver, (*session)->GetTally()).dump() + "\n");
  };
  sync::TimeNs tell_at = clock.Now() + kTellEvery;
  absl::Status status;
  while (status.ok() && !interrupt.requested() && !ending.ended()) {
    const sync::TimeNs now = clock.Now();
    const sync::TimeNs next =
        std::min({intake.due(), tell_at, intake.waiting() ? now + kRoomEvery : sync::kNever});
    receiver.Run(std::max<sync::TimeNs>(0, next - now));
    intake.Tick(clock.Now());
    if (intake.waiting() && (*session)->HasRoom()) {
      status =
          layer.Put("lights", map->Picture(*intake.Take()), {.transform = map->transform}).status();
      if (status.ok()) status = (*session)->Commit().status();
    }
    if (clock.Now() >= tell_at) {
      tell();
      tell_at = clock.Now() + kTellEvery;
    }
  }
  console.EndProgress();
  if (status.ok() && ending.ended()) status = ending.status();
  const client::Tally tally = (*session)->GetTally();
  if (status.ok() && tally.refused > 0 && !tally.issues.empty()) {
    status = absl::FailedPreconditionError(client::DescribeIssue(tally.issues.front()));
  }
  const absl::Status closed = (*session)->Close();
  if (status.ok()) status = closed;
  if (console.json()) {
    tell();
  } else {
    console.Say(TallyText(intake));
  }
  return {status.code(), EscapeForTerminal(status.message())};
}

}  // namespace voxeld::voxelctl
