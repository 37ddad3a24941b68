// Counts received light data and assembles it into pictures: the values of all lights, and when
// they are to be shown. It uses no sockets and reads no clock.
//
// Lights are numbered from 0. A DDP packet says from which byte on it sets them. Open Pixel
// Control's channel 0 means every channel: a message sets the lights from the first on; channel n
// sets those from (n − 1) · a_channel on. DMX universes follow one another: each holds the next
// `universe_channels` values, three per light, so a light may span two of them.
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
  // How many values of a universe belong to lights; 1 to 512. 510 are 170 whole lights.
  size_t universe_channels = 510;
  size_t a_channel = 0;  // lights per channel of Open Pixel Control; 0: all
  // How long values that came without a request to show them wait for the rest of their picture,
  // which may come in more packets. A part that comes a second time completes the picture before
  // it.
  sync::TimeNs gather_ns = 4 * sync::kMillisecond;
};

// Every message is counted under exactly one of these: `messages` is the sum of the eight counters
// after it.
struct IntakeTally {
  uint64_t messages = 0;
  uint64_t set = 0;        // set lights
  uint64_t shows = 0;      // requested that the received values be shown
  uint64_t ended = 0;      // said that their sender will send no more
  uint64_t other = 0;      // not for lights: settings, previews, queries
  uint64_t outside = 0;    // for a universe or a channel without lights
  uint64_t outranked = 0;  // E1.31: another source of higher priority has the universe
  uint64_t stale = 0;      // E1.31: older than one that was already received (§6.7.2)
  uint64_t malformed = 0;

  // Messages that set lights but have unused values.
  uint64_t split = 0;   // DDP, Open Pixel Control: ends within a light
  uint64_t beyond = 0;  // values for lights that do not exist
  uint64_t unused = 0;  // E1.31, Art-Net: beyond the universe's channels, and not 0
  // Open Pixel Control: for a channel from 2 on while a_channel does not say which lights it has;
  // also counted as outside.
  uint64_t unmapped = 0;

  uint64_t lost = 0;        // sequence numbers that were missing; not part of `messages`
  uint64_t bytes = 0;       // of all messages
  uint64_t pictures = 0;    // that were to be shown: taken, superseded, and the one that waits
  uint64_t taken = 0;       // by Take
  uint64_t superseded = 0;  // by a newer one, before they were taken
};

// Returns how many universes the lights need.
int32_t UniversesOf(const IntakeOptions& options);

// Bound to one thread.
class Intake {
 public:
  // E1.31: a source is forgotten when it has sent nothing for this long (§6.7.1).
  static constexpr sync::TimeNs kSourceLife = 2'500 * sync::kMillisecond;

  explicit Intake(const IntakeOptions& options);

  // Adds a datagram. Returns: the datagram; if it is of Kind::kAsk, it needs an answer. Errors: why
  // it is malformed.
  absl::StatusOr<Datagram> AddDatagram(std::span<const uint8_t> packet, sync::TimeNs now);
  void AddMessage(const OpcReader::Message& message, sync::TimeNs now);

  // Returns when the picture that is being assembled becomes due; kNever if nothing has been
  // received.
  sync::TimeNs due() const { return due_; }
  // Completes the picture if it is due.
  void Tick(sync::TimeNs now);

  // Returns the newest picture that was not taken: the values of all lights, three per light, valid
  // until the next Add.
  std::optional<std::span<const uint8_t>> Take();
  bool waiting() const { return waiting_; }

  const IntakeTally& tally() const { return tally_; }
  // Returns the last malformed packet's error; Ok if there was none.
  const absl::Status& malformed() const { return malformed_; }

 private:
  struct Source {
    uint8_t priority = 0;
    std::optional<uint8_t> sequence;
    sync::TimeNs heard_ns = 0;
  };
  using SourceKey = std::array<uint8_t, 16>;

  void AddLights(const Datagram& packet, sync::TimeNs now);
  // Returns whether the packet's source owns its universe and the packet is in sequence.
  bool TakesFrom(const Datagram& packet, sync::TimeNs now);
  // Counts the unused values of a message that set lights from `first_byte` on with `count` values;
  // at most `most` of them can belong to lights.
  void CountUnused(size_t first_byte, size_t count, size_t most);
  void CountLost(std::optional<uint8_t> sequence, int32_t of, int numbers);
  // Sets part `part` of a picture. Returns false if no value belongs to a light. Without `more` the
  // picture is shown immediately, otherwise when it is due, at `until` at the latest.
  enum class More : uint8_t { kNo, kPerhaps, kTold };
  bool Set(int64_t part, size_t first_byte, std::span<const uint8_t> values, More more,
           sync::TimeNs until);
  void Show();

  const IntakeOptions options_;
  std::vector<uint8_t> values_;   // as they are received
  std::vector<uint8_t> picture_;  // as they are to be shown
  sync::TimeNs due_ = sync::kNever;
  std::set<int64_t> parts_;  // parts of the picture that were received
  bool waiting_ = false;
  std::map<int32_t, std::map<SourceKey, Source>> sources_;  // per universe, E1.31
  std::map<int32_t, uint8_t> sequences_;                    // per universe; DDP: under 0
  // Art-Net: sync packets are being received.
  uint16_t sync_universe_ = 0;  // E1.31: the one that pictures wait for
  bool synchronised_ = false;
  sync::TimeNs sync_heard_ns_ = 0;
  IntakeTally tally_;
  absl::Status malformed_;
};

}  // namespace voxeld::lights
