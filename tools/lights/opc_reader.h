// Open Pixel Control as it comes in: a stream of bytes, cut into messages.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace voxeld::lights {

// Of one connection. Every sequence of bytes is a sequence of messages, the last one perhaps not whole, so nothing
// can be wrong with it. It holds 65,539 bytes at most. Bound to one thread.
class OpcReader {
 public:
  struct Message {
    uint8_t channel = 0, command = 0;
    std::span<const uint8_t> data;  // until the next call
  };

  // Calls `each` for every message that `bytes` complete.
  void Add(std::span<const uint8_t> bytes, const std::function<void(const Message&)>& each);

  // Whether a message has begun that is not whole.
  bool amid() const { return !held_.empty(); }

 private:
  std::vector<uint8_t> held_;
};

}  // namespace voxeld::lights
