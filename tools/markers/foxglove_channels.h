// What a Foxglove server says of its channels, and which message is of which. Knows no socket.
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

  // `topics` empty: all.
  explicit FoxgloveChannels(std::vector<std::string> topics) : topics_(std::move(topics)) {}

  // A message of text. What is to be answered; empty: nothing. InvalidArgument for what is not of the protocol.
  absl::StatusOr<std::string> Told(std::string_view text);
  // A binary one. Nothing: it is of no concern. InvalidArgument as above.
  absl::StatusOr<std::optional<FoxgloveMessage>> Data(std::string_view bytes) const;

  // As FoxgloveClient has them.
  const std::vector<std::string>& passed_over() const { return passed_over_; }
  size_t subscribed() const { return channels_.size(); }

 private:
  struct Channel {
    std::string topic;
    Encoding encoding = Encoding::kProtobuf;
  };

  const std::vector<std::string> topics_;
  std::map<uint32_t, Channel> channels_;  // by subscription
  std::vector<std::string> passed_over_;
};

}  // namespace voxeld::markers
