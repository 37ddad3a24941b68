// How much a stream may send: the client's side of the credit protocol.
#pragma once

#include <algorithm>
#include <cstdint>

namespace voxeld::bench {

class Credit {
 public:
  // Sets the total credit since the stream began, as Opened or a later response reported it. A
  // server that only ever reports 0 does not limit the stream.
  void Told(uint64_t credit_bytes) { credit_ = std::max(credit_, credit_bytes); }
  void Sent(uint64_t bytes) { sent_ += bytes; }

  // Returns whether a message may be sent: some credit is left, though the message may exceed it.
  bool MaySend() const { return MaySendAfter(0); }
  // Returns whether another message may be sent after `bytes` more bytes.
  bool MaySendAfter(uint64_t bytes) const { return credit_ == 0 || sent_ + bytes < credit_; }

  uint64_t sent() const { return sent_; }
  uint64_t credit() const { return credit_; }

 private:
  uint64_t credit_ = 0, sent_ = 0;
};

}  // namespace voxeld::bench
