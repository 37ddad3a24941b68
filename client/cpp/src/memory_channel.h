// Memory that a server on this machine reads instead of payloads on a stream.
#pragma once

#include <cstdint>
#include <memory>

#include "client/cpp/src/wire.h"

namespace voxeld::client {

// Of one stream. Thread-safe; nothing blocks but its destruction, which ends what is under way, and
// nothing calls back from within a call. Whatever is held goes with it.
class MemoryChannel {
 public:
  enum class Answer : uint8_t {
    kHeld,     // requests may name it now
    kNoRoom,   // as long as others are held
    kRefused,  // the server would not have it
    kGone,     // nor will anything else be held
  };
  class Events {
   public:
    virtual ~Events() = default;
    // On a thread of the channel's own: exactly one answer to each Hold, in their order.
    virtual void OnHold(uint64_t id, Answer answer) = 0;
  };
  virtual ~MemoryChannel() = default;

  // Puts a copy of `content` into new memory and hands it over as `id`, which was not used before.
  virtual void Hold(uint64_t id, Rope content) = 0;
  // It is not needed any more. Of one that is held.
  virtual void Release(uint64_t id) = 0;
};

}  // namespace voxeld::client
