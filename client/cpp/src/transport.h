// Streams to a server, with gRPC or without.
#pragma once

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "client/cpp/src/memory_channel.h"
#include "client/cpp/src/wire.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::client {

// One call of SceneService.Stream. Thread-safe; nothing blocks, and nothing calls back from within
// itself. Destroy it only after its OnEnd.
class Stream {
 public:
  // Called on threads of the transport's own, one at a time but for OnWritten.
  class Events {
   public:
    virtual ~Events() = default;
    virtual void OnRead(const v1::StreamResponse& response) = 0;
    // The transport has taken the message; the next may be written.
    virtual void OnWritten() = 0;
    // The last one.
    virtual void OnEnd(const absl::Status& status) = 0;
  };
  virtual ~Stream() = default;

  // A v1.StreamRequest. One at a time: after OnWritten of the one before. Nothing happens if the stream
  // is ending.
  virtual void Write(const Rope& message) = 0;
  virtual void WritesDone() = 0;  // when no write is under way
  virtual void Cancel() = 0;
};

class Transport {
 public:
  virtual ~Transport() = default;
  // A stream over a connection of its own. `events` must outlive its OnEnd.
  virtual std::unique_ptr<Stream> Start(Stream::Events* events) = 0;
  // With what Opened tells of the local socket. `events` must outlive it. Null: content is to go over the stream, as
  // where the server is not on this machine.
  virtual std::unique_ptr<MemoryChannel> OpenMemory(const std::string& /*path*/,
                                                    const std::string& /*token*/,
                                                    MemoryChannel::Events* /*events*/) {
    return nullptr;
  }
};

}  // namespace voxeld::client
