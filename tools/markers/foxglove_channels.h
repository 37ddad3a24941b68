// Tracks the channels of a Foxglove server, and which message belongs to which. It uses no socket.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "tools/markers/markers.h"

namespace voxeld::markers {

struct FoxgloveMessage {
  std::string topic, payload;
  Encoding encoding = Encoding::kProtobuf;
};

// Not thread-safe.
class FoxgloveChannels {
 public:
  static constexpr size_t kMostPassedOver = 100, kMostChannels = 10'000;

  // If `topics` is empty, all topics are used.
  explicit FoxgloveChannels(std::vector<std::string> topics) : topics_(std::move(topics)) {}

  // Processes a text message. Returns: the answer to send; empty if none. Errors: InvalidArgument
  // if the message violates the protocol.
  absl::StatusOr<std::string> Told(std::string_view text);
  // Processes a binary message. Returns: nothing if it is not relevant. Errors: InvalidArgument as
  // above.
  absl::StatusOr<std::optional<FoxgloveMessage>> Data(std::string_view bytes) const;

  // As in FoxgloveClient.
  const std::vector<std::string>& passed_over() const { return passed_over_; }
  size_t subscribed() const { return channels_.size(); }

 private:
  struct Channel {
    std::string topic;
    Encoding encoding = Encoding::kProtobuf;
  };

  const std::vector<std::string> topics_;
  std::map<uint32_t, Channel> channels_;  // by subscription number
  std::vector<std::string> passed_over_;
};

}  // namespace voxeld::markers
