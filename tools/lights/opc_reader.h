// Splits a received stream of Open Pixel Control into messages.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace voxeld::lights {

// The reader of one connection. Every sequence of bytes is a sequence of messages, with the last
// one perhaps incomplete, so there are no errors. It holds at most 65,539 bytes. Bound to one
// thread.
class OpcReader {
 public:
  struct Message {
    uint8_t channel = 0, command = 0;
    std::span<const uint8_t> data;  // valid until the next call
  };

  // Calls `each` for every message that `bytes` completes.
  void Add(std::span<const uint8_t> bytes, const std::function<void(const Message&)>& each);

  // Returns whether an incomplete message has begun.
  bool amid() const { return !held_.empty(); }

 private:
  std::vector<uint8_t> held_;
};

}  // namespace voxeld::lights
