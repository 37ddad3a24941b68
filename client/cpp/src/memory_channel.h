// Memory that a server on this machine reads in place of payloads on a stream.
#pragma once

#include <cstdint>
#include <memory>

#include "client/cpp/src/wire.h"

namespace voxeld::client {

// Belongs to one stream. Thread-safe; only its destruction blocks, which ends what is in progress.
// No callback runs from within a call. Destruction releases everything that is held.
class MemoryChannel {
 public:
  enum class Answer : uint8_t {
    kHeld,     // requests may name it now
    kNoRoom,   // no room as long as others are held
    kRefused,  // the server refused it
    kGone,     // the channel failed: nothing else will be held either
  };
  class Events {
   public:
    virtual ~Events() = default;
    // Called on a thread of the channel: exactly one answer to each Hold, in their order.
    virtual void OnHold(uint64_t id, Answer answer) = 0;
  };
  virtual ~MemoryChannel() = default;

  // Copies `content` into new memory and hands it over as `id`, which must not have been used
  // before.
  virtual void Hold(uint64_t id, Rope content) = 0;
  // Releases the held memory `id`.
  virtual void Release(uint64_t id) = 0;
};

}  // namespace voxeld::client
