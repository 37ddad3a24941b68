#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <nlohmann/json.hpp>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "display/sync/clock.h"
#include "tools/voxelctl/lights/choose_lights.h"
#include "tools/voxelctl/lights/lights.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

constexpr int kLookUpMs = 100;  // interval at which an interrupt is checked
constexpr sync::TimeNs kSettleLimit = 60 * sync::kSecond;

// Fills `bytes`, or as much of it as the input still has. Returns the number of bytes
// read.
absl::StatusOr<size_t> ReadWhole(int descriptor, std::vector<uint8_t>& bytes,
                                 const Interrupt& interrupt) {
  size_t have = 0;
  while (have < bytes.size()) {
    if (interrupt.requested()) return absl::CancelledError("interrupted");
    pollfd waiting = {descriptor, POLLIN, 0};
    if (poll(&waiting, 1, kLookUpMs) == 0) continue;
    const ssize_t count = read(descriptor, bytes.data() + have, bytes.size() - have);
    if (count == 0) break;
    if (count > 0) {
      have += static_cast<size_t>(count);
    } else if (errno != EINTR && errno != EAGAIN) {
      return absl::UnavailableError(
          absl::StrCat("standard input cannot be read: ", std::strerror(errno)));
    }
  }
  return have;
}

}  // namespace

absl::Status Pipe(const PipeOptions& options, const Connector& connect, Interrupt& interrupt,
                  int descriptor, Console& console) {
  const absl::StatusOr<std::unique_ptr<Connection>> connected = connect();
  if (!connected.ok()) return connected.status();
  Connection& connection = **connected;
  const absl::StatusOr<LightMap> map = ChooseLights(options.lights, connection);
  if (!map.ok()) return map.status();
  client::Options asked;
  asked.client_name = "voxelctl pipe";
  asked.on_disconnect = options.keep ? client::OnDisconnect::kKeep : client::OnDisconnect::kClear;
  absl::StatusOr<std::unique_ptr<SceneSession>> session = connection.OpenSession(asked);
  if (!session.ok()) return session.status();
  client::Session& client = (*session)->client();
  const client::Layer layer = client.GetLayer(options.lights.layer);

  sync::SystemClock clock;
  std::vector<uint8_t> picture(map->lights * 3);
  uint64_t pictures = 0;
  sync::TimeNs due = clock.Now();
  absl::Status status;
  while (status.ok()) {
    const absl::StatusOr<size_t> have = ReadWhole(descriptor, picture, interrupt);
    if (!have.ok()) {
      status = have.status();
      break;
    }
    if (*have < picture.size()) {
      if (*have > 0) {
        status = absl::InvalidArgumentError(
            absl::StrCat("standard input ended within a picture: ", *have, " bytes of ",
                         picture.size(), " (", map->lights, " lights of 3)"));
      }
      break;
    }
    if (options.fps > 0) {
      if (interrupt.WaitUntil(clock, due)) status = absl::CancelledError("interrupted");
      due += static_cast<sync::TimeNs>(static_cast<double>(sync::kSecond) / options.fps);
    }
    if (status.ok()) status = client.WaitForRoom(std::chrono::hours(24 * 365));
    if (status.ok()) {
      status = layer.Put("lights", map->Picture(picture), {.transform = map->transform}).status();
    }
    if (status.ok()) status = client.Commit().status();
    if (status.ok()) {
      ++pictures;
      console.Progress(absl::StrCat("showing  ", Counted(pictures, "picture")));
    }
  }
  console.EndProgress();
  const absl::Status settled = (*session)->WaitSettled(kSettleLimit);
  const client::Tally tally = client.GetTally();
  if (status.ok() && tally.issue_count > 0) {
    status = absl::FailedPreconditionError(IssueForTerminal(tally.issues.front()));
  }
  if (status.ok()) status = settled;
  if (console.json()) {
    console.Data(nlohmann::ordered_json{{"pictures", pictures},
                                        {"accepted", tally.accepted},
                                        {"refused", tally.refused}}
                     .dump() +
                 "\n");
  } else {
    console.Say(absl::StrCat(
        Counted(pictures, "picture"), " of ", map->where,
        options.keep && pictures > 0 ? "; the last stays up until `voxelctl clear`" : ""));
  }
  const absl::Status closed = (*session)->Close();
  if (status.ok()) status = closed;
  return {status.code(), EscapeForTerminal(status.message())};
}

}  // namespace voxeld::voxelctl
