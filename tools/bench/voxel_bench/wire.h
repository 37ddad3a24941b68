// Raw gRPC with as little overhead in the client as possible: one thread, one completion queue, and
// messages that are serialised once.
//
// Everything is bound to one thread: events are delivered from within Loop::RunUntil and RunTo.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "display/sync/clock.h"

namespace google::protobuf {
class MessageLite;
}  // namespace google::protobuf

namespace grpc {
class ByteBuffer;
class Channel;
}  // namespace grpc

namespace voxeld::bench {

// Keeps gRPC's core initialised in this process while it lives. Otherwise, shutting it down and
// starting it again between measurements would be part of the measurement.
class GrpcCore {
 public:
  GrpcCore();
  ~GrpcCore();
  GrpcCore(const GrpcCore&) = delete;
  GrpcCore& operator=(const GrpcCore&) = delete;
};

sync::TimeNs Now();  // CLOCK_MONOTONIC, as the daemon's

// The bytes of a message, shared by all copies; sending them again costs only the sending.
class Message {
 public:
  Message() = default;
  explicit Message(const google::protobuf::MessageLite& message);
  size_t bytes() const { return bytes_; }
  const grpc::ByteBuffer& buffer() const { return *buffer_; }

 private:
  std::shared_ptr<const grpc::ByteBuffer> buffer_;
  size_t bytes_ = 0;
};

class Loop {
 public:
  // RunUntil returns Cancelled once `*interrupted` is set.
  explicit Loop(const std::atomic<bool>* interrupted = nullptr);
  ~Loop();  // waits for the ends of all calls. Requires: every call is released
  Loop(const Loop&) = delete;
  Loop& operator=(const Loop&) = delete;

  // Handles events until `done`, which is called after each event. Errors: DeadlineExceeded if it
  // is not done in time.
  absl::Status RunUntil(sync::TimeNs deadline, absl::FunctionRef<bool()> done);
  // Handles events until `time`, or up to a millisecond longer. Errors: Cancelled as above.
  absl::Status RunTo(sync::TimeNs time);

 private:
  friend class Call;
  class Impl;
  std::unique_ptr<Impl> impl_;
};

// The address, and for TLS the certificate that both ends use, which is also the authority for
// both.
struct Target {
  std::string address;
  std::string certificate, key;  // PEM; empty: no TLS
};

// A separate connection, for any number of calls.
class Connection {
 public:
  explicit Connection(const Target& target);
  explicit Connection(const std::string& address) : Connection(Target{address, {}, {}}) {}
  ~Connection();
  Connection(Connection&&) noexcept;
  Connection& operator=(Connection&&) = delete;

 private:
  friend class Call;
  std::shared_ptr<grpc::Channel> channel_;
};

struct CallEvents {
  std::function<void()> writable;                  // after the start and after each write
  std::function<void(std::string_view)> message;   // a message was received
  std::function<void(const absl::Status&)> ended;  // called once, last
};

// One call of any kind, as a stream of bytes in both directions. Destroying it cancels the call,
// and no event follows.
class Call {
 public:
  // `method` is "/package.Service/Method". With `read_on`, the next message is read after each one;
  // otherwise Read() requests one.
  Call(Loop& loop, const Connection& connection, const std::string& method, CallEvents events,
       bool read_on = true);
  ~Call();
  Call(const Call&) = delete;
  Call& operator=(const Call&) = delete;

  // Returns whether the call has started, nothing is being written, and it is neither half-closed
  // nor ended.
  bool writable() const;
  // Requires: writable(). With `more`, another Write follows immediately, so this one need not be
  // flushed.
  void Write(const Message& message, bool more = false);
  void WritesDone();  // must be writable
  void Read();
  // Takes effect from the next message on.
  void set_read_on(bool read_on);
  bool ended() const;

 private:
  friend class Loop;
  class Impl;
  Impl* impl_;  // owns itself until its last event
};

}  // namespace voxeld::bench
