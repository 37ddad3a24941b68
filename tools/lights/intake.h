// What comes in, kept account of and put together to pictures: the values of all lights, and when they are to be shown.
// It knows no sockets and reads no clock.
//
// Lights are numbered from 0. A DDP packet says from which byte on it sets them. Open Pixel Control's channel 0 is every
// channel: a message sets the lights from the first on; channel n those from (n − 1) · a_channel on. DMX universes follow one
// another: each brings the next `universe_channels` values, three a light, so that a light may lie across two of them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "display/sync/clock.h"
#include "tools/lights/datagram.h"
#include "tools/lights/opc_reader.h"

namespace voxeld::lights {

struct IntakeOptions {
  Protocol protocol = Protocol::kOpc;
  size_t lights = 0;
  int32_t first_universe = 1;  // E1.31, Art-Net
  // Of a universe, values that are lights'; 1 to 512. 510 are 170 whole lights.
  size_t universe_channels = 510;
  size_t a_channel = 0;  // Open Pixel Control; 0: as many as there are
  // How long what came without a word that it is to be shown waits for the rest of its picture, which may come in more
  // packets. Part of a picture that comes a second time ends the first.
  sync::TimeNs gather_ns = 4 * sync::kMillisecond;
};

// Every message is one of these, and of one alone: `messages` is the sum of the eight that follow it.
struct IntakeTally {
  uint64_t messages = 0;
  uint64_t set = 0;        // set lights
  uint64_t shows = 0;      // said that what came is to be shown
  uint64_t ended = 0;      // said that their sender will send no more
  uint64_t other = 0;      // of no concern here: settings, previews, questions
  uint64_t outside = 0;    // for a universe, or a channel, in which no light is
  uint64_t outranked = 0;  // E1.31: another source of higher priority has the universe
  uint64_t stale = 0;      // E1.31: behind one that came before (§6.7.2)
  uint64_t malformed = 0;

  // Of messages with lights: those with values that were not used.
  uint64_t split = 0;   // DDP, Open Pixel Control: they end within a light
  uint64_t beyond = 0;  // there are no such lights
  uint64_t unused = 0;  // E1.31, Art-Net: behind the universe's channels, and not 0
  // Open Pixel Control: for a channel from 2 on, and a_channel does not say which lights it has; these are outside too.
  uint64_t unmapped = 0;

  uint64_t lost = 0;        // numbers that no message had; not among them
  uint64_t bytes = 0;       // of them
  uint64_t pictures = 0;    // that were to be shown: taken, superseded, and the one that waits
  uint64_t taken = 0;       // by Take
  uint64_t superseded = 0;  // by a newer one, before it was taken
};

// How many universes the lights take.
int32_t UniversesOf(const IntakeOptions& options);

// Bound to one thread.
class Intake {
 public:
  // E1.31: a source is forgotten when it has sent nothing for so long (§6.7.1).
  static constexpr sync::TimeNs kSourceLife = 2'500 * sync::kMillisecond;

  explicit Intake(const IntakeOptions& options);

  // A datagram; the error is why it is malformed. An answer that it asks for: the datagram itself, of Kind::kAsk.
  absl::StatusOr<Datagram> AddDatagram(std::span<const uint8_t> packet, sync::TimeNs now);
  void AddMessage(const OpcReader::Message& message, sync::TimeNs now);

  // When the picture that is being put together will be one to show; kNever: nothing has come.
  sync::TimeNs due() const { return due_; }
  // The picture is one from `due()` on.
  void Tick(sync::TimeNs now);

  // The newest picture that was not taken: values of all lights, three a light, until the next Add.
  std::optional<std::span<const uint8_t>> Take();
  bool waiting() const { return waiting_; }

  const IntakeTally& tally() const { return tally_; }
  // The last that was malformed; Ok: none was.
  const absl::Status& malformed() const { return malformed_; }

 private:
  struct Source {
    uint8_t priority = 0;
    std::optional<uint8_t> sequence;
    sync::TimeNs heard_ns = 0;
  };
  using SourceKey = std::array<uint8_t, 16>;

  void AddLights(const Datagram& packet, sync::TimeNs now);
  // Whether the packet's source has its universe and the packet is in its order.
  bool TakesFrom(const Datagram& packet, sync::TimeNs now);
  // Of a message that set lights from `first_byte` on and has `count` values: no more than `most` of them can be lights'.
  void CountUnused(size_t first_byte, size_t count, size_t most);
  void CountLost(std::optional<uint8_t> sequence, int32_t of, int numbers);
  // Part `part` of a picture; false if none of it is a light's. Without `more` it is to be shown at once, else when its
  // time has come, at `until` the latest.
  enum class More : uint8_t { kNo, kPerhaps, kTold };
  bool Set(int64_t part, size_t first_byte, std::span<const uint8_t> values, More more,
           sync::TimeNs until);
  void Show();

  const IntakeOptions options_;
  std::vector<uint8_t> values_;   // as they come in
  std::vector<uint8_t> picture_;  // as they are to be shown
  sync::TimeNs due_ = sync::kNever;
  std::set<int64_t> parts_;  // that have come of the picture
  bool waiting_ = false;
  std::map<int32_t, std::map<SourceKey, Source>> sources_;  // of universes, E1.31
  std::map<int32_t, uint8_t> sequences_;                    // of universes; DDP: of 0
  uint16_t sync_universe_ = 0;                              // E1.31: that pictures wait for
  bool synchronised_ = false;                               // Art-Net: sync packets come
  sync::TimeNs sync_heard_ns_ = 0;
  IntakeTally tally_;
  absl::Status malformed_;
};

}  // namespace voxeld::lights
