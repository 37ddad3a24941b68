// Streams to a server, over gRPC or, in tests, without it.
#pragma once

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "client/cpp/src/memory_channel.h"
#include "client/cpp/src/wire.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::client {

// One call of SceneService.Stream. Thread-safe; nothing blocks, and no callback runs from within a
// call. Destroy it only after its OnEnd.
class Stream {
 public:
  // Called on threads of the transport, one at a time except for OnWritten.
  class Events {
   public:
    virtual ~Events() = default;
    virtual void OnRead(const v1::StreamResponse& response) = 0;
    // The transport has accepted the message; the next may be written.
    virtual void OnWritten() = 0;
    // The last event.
    virtual void OnEnd(const absl::Status& status) = 0;
  };
  virtual ~Stream() = default;

  // Writes a v1.StreamRequest. One at a time: the next only after OnWritten. Does nothing if the
  // stream is ending.
  virtual void Write(const Rope& message) = 0;
  virtual void WritesDone() = 0;  // call it when no write is in progress
  virtual void Cancel() = 0;
};

class Transport {
 public:
  virtual ~Transport() = default;
  // Starts a stream over a connection of its own. `events` must outlive its OnEnd.
  virtual std::unique_ptr<Stream> Start(Stream::Events* events) = 0;
  // Opens the memory channel with the local socket's path and token from Opened. `events` must
  // outlive it. Returns null if content must go over the stream, for example because the server is
  // remote.
  virtual std::unique_ptr<MemoryChannel> OpenMemory(const std::string& /*path*/,
                                                    const std::string& /*token*/,
                                                    MemoryChannel::Events* /*events*/) {
    return nullptr;
  }
};

}  // namespace voxeld::client
