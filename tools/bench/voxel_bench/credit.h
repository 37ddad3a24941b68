// How much a stream may send: the client's side of the contract's credits.
#pragma once

#include <algorithm>
#include <cstdint>

namespace voxeld::bench {

class Credit {
 public:
  // What Opened or a later answer said, in all since the stream began. A server that never says
  // anything but 0 does not pace.
  void Told(uint64_t credit_bytes) { credit_ = std::max(credit_, credit_bytes); }
  void Sent(uint64_t bytes) { sent_ += bytes; }

  // Whether a message may go out: some credit is left, though the message may exceed it.
  bool MaySend() const { return MaySendAfter(0); }
  // Whether one may still go out when `bytes` more have been sent.
  bool MaySendAfter(uint64_t bytes) const { return credit_ == 0 || sent_ + bytes < credit_; }

  uint64_t sent() const { return sent_; }
  uint64_t credit() const { return credit_; }

 private:
  uint64_t credit_ = 0, sent_ = 0;
};

}  // namespace voxeld::bench
