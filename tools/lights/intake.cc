#include "tools/lights/intake.h"

#include <algorithm>
#include <utility>

namespace voxeld::lights {
namespace {

// Maximum number of sources per universe that are distinguished.
constexpr size_t kMostSources = 16;
// After this time without a sync packet, pictures are shown without one (Art-Net 4, ArtSync; the
// time-out of E1.31 §6.2.4.2).
constexpr sync::TimeNs kSyncLife = 4 * sync::kSecond;

}  // namespace

int32_t UniversesOf(const IntakeOptions& options) {
  return static_cast<int32_t>((options.lights * 3 + options.universe_channels - 1) /
                              options.universe_channels);
}

Intake::Intake(const IntakeOptions& options)
    : options_(options), values_(options.lights * 3), picture_(options.lights * 3) {}

absl::StatusOr<Datagram> Intake::AddDatagram(std::span<const uint8_t> packet, sync::TimeNs now) {
  ++tally_.messages;
  tally_.bytes += packet.size();
  absl::StatusOr<Datagram> read = ReadDatagram(options_.protocol, packet);
  if (!read.ok()) {
    ++tally_.malformed;
    malformed_ = read.status();
    return read;
  }
  switch (read->kind) {
    case Datagram::Kind::kLights:
      AddLights(*read, now);
      break;
    case Datagram::Kind::kShow:
      // A packet of another synchronisation universe does not apply to these values.
      if (options_.protocol == Protocol::kE131 && read->universe != sync_universe_) {
        ++tally_.other;
        break;
      }
      ++tally_.shows;
      synchronised_ = options_.protocol == Protocol::kArtNet;
      sync_heard_ns_ = now;
      if (due_ != sync::kNever) Show();
      break;
    case Datagram::Kind::kEnd: {
      ++tally_.ended;
      const auto universe = sources_.find(read->universe);
      if (universe != sources_.end()) universe->second.erase(read->source);
      break;
    }
    case Datagram::Kind::kAsk:
    case Datagram::Kind::kOther:
      ++tally_.other;
      break;
  }
  return read;
}

void Intake::AddLights(const Datagram& packet, sync::TimeNs now) {
  if (options_.protocol == Protocol::kDdp) {
    CountLost(packet.sequence, 0, 15);
    const bool set = Set(static_cast<int64_t>(packet.first_byte), packet.first_byte, packet.values,
                         packet.push ? More::kNo : More::kPerhaps, now + options_.gather_ns);
    ++(set ? tally_.set : tally_.outside);
    if (set) CountUnused(packet.first_byte, packet.values.size(), packet.values.size());
    if (!set && packet.push && due_ != sync::kNever) Show();
    return;
  }
  const int64_t index = int64_t{packet.universe} - options_.first_universe;
  const size_t channels = options_.universe_channels;
  if (index < 0 || static_cast<uint64_t>(index) * channels >= values_.size()) {
    ++tally_.outside;
    return;
  }
  if (options_.protocol == Protocol::kE131) {
    if (!TakesFrom(packet, now)) return;
    sync_universe_ = packet.sync_universe;
  } else {
    CountLost(packet.sequence, packet.universe, 255);
  }
  // If sync packets are sent, a picture waits for one, but no longer than the maximum interval
  // between them.
  const bool told = (synchronised_ || sync_universe_ != 0) && now - sync_heard_ns_ < kSyncLife;
  const size_t there = values_.size() - static_cast<size_t>(index) * channels;
  const size_t used = std::min(packet.values.size(), channels);
  const auto rest = packet.values.subspan(std::min(used, there));
  // Senders pad universes with zeros.
  if (std::any_of(rest.begin(), rest.end(), [](uint8_t value) { return value != 0; }))
    ++(there <= channels ? tally_.beyond : tally_.unused);
  const bool set = Set(packet.universe, static_cast<size_t>(index) * channels,
                       packet.values.first(used), told ? More::kTold : More::kPerhaps,
                       told ? sync_heard_ns_ + kSyncLife : now + options_.gather_ns);
  ++(set ? tally_.set : tally_.outside);  // not set: a packet without values
}

bool Intake::TakesFrom(const Datagram& packet, sync::TimeNs now) {
  std::map<SourceKey, Source>& sources = sources_[packet.universe];
  std::erase_if(sources,
                [now](const auto& source) { return now - source.second.heard_ns > kSourceLife; });
  if (sources.size() >= kMostSources && !sources.contains(packet.source)) {
    ++tally_.outranked;
    return false;
  }
  Source& source = sources[packet.source];
  source.heard_ns = now;
  source.priority = packet.priority;
  const std::optional<uint8_t> before = std::exchange(source.sequence, packet.sequence);
  if (before.has_value()) {
    // §6.7.2: a packet up to 20 numbers behind is late; farther behind, its sender has restarted.
    const auto ahead = static_cast<int8_t>(*packet.sequence - *before);
    if (ahead <= 0 && ahead > -20) {
      source.sequence = before;
      ++tally_.stale;
      return false;
    }
    if (ahead > 1) tally_.lost += static_cast<uint64_t>(ahead - 1);
  }
  for (const auto& [key, other] : sources) {
    if (other.priority <= packet.priority) continue;
    ++tally_.outranked;
    return false;
  }
  return true;
}

void Intake::CountLost(std::optional<uint8_t> sequence, int32_t of, int numbers) {
  if (!sequence.has_value()) return;
  const auto [at, fresh] = sequences_.try_emplace(of, *sequence);
  if (!fresh) {
    // Numbers run from 1 to `numbers`. An out-of-order packet cannot be distinguished from a
    // restarted sequence.
    const int ahead = (*sequence - at->second + numbers) % numbers;
    if (ahead > 1 && ahead <= numbers / 2) tally_.lost += static_cast<uint64_t>(ahead - 1);
    at->second = *sequence;
  }
}

void Intake::AddMessage(const OpcReader::Message& message, sync::TimeNs now) {
  ++tally_.messages;
  tally_.bytes += display::network::opc::kHeader + message.data.size();
  if (message.command != display::network::opc::kSetPixels) {
    ++tally_.other;
    return;
  }
  const size_t lights = options_.a_channel == 0 ? options_.lights : options_.a_channel;
  const size_t first = message.channel == 0 ? 0 : (message.channel - size_t{1}) * lights;
  std::span<const uint8_t> values = message.data;
  // Values beyond the end of a channel are ignored.
  if (message.channel != 0) values = values.first(std::min(values.size(), lights * 3));
  // A message for all channels is a whole picture; a message for one channel is part of one.
  const bool all = message.channel == 0 || options_.a_channel == 0;
  const bool set = Set(message.channel, first * 3, values, all ? More::kNo : More::kPerhaps,
                       now + options_.gather_ns);
  ++(set ? tally_.set : tally_.outside);
  if (message.channel > 1 && options_.a_channel == 0) ++tally_.unmapped;
  if (set) CountUnused(first * 3, message.data.size(), values.size());
}

void Intake::CountUnused(size_t first_byte, size_t count, size_t most) {
  const size_t there = std::min(most, values_.size() - first_byte);
  if (count > there) {
    ++tally_.beyond;
  } else if (count % 3 != 0) {
    ++tally_.split;
  }
}

bool Intake::Set(int64_t part, size_t first_byte, std::span<const uint8_t> values, More more,
                 sync::TimeNs until) {
  if (values.empty() || first_byte >= values_.size()) return false;
  if (more != More::kTold && parts_.contains(part)) Show();  // this part begins the next picture
  const size_t count = std::min(values.size(), values_.size() - first_byte);
  std::copy_n(values.begin(), count, values_.begin() + static_cast<std::ptrdiff_t>(first_byte));
  if (more == More::kNo) {
    Show();
    return true;
  }
  parts_.insert(part);
  if (due_ == sync::kNever || more == More::kTold) due_ = until;
  return true;
}

void Intake::Tick(sync::TimeNs now) {
  if (due_ != sync::kNever && now >= due_) Show();
}

void Intake::Show() {
  due_ = sync::kNever;
  parts_.clear();
  ++tally_.pictures;
  if (waiting_) ++tally_.superseded;
  waiting_ = true;
  picture_ = values_;
}

std::optional<std::span<const uint8_t>> Intake::Take() {
  if (!std::exchange(waiting_, false)) return std::nullopt;
  ++tally_.taken;
  return std::span<const uint8_t>(picture_);
}

}  // namespace voxeld::lights
