// Raw gRPC with as little of the client's own as can be: one thread, one completion queue, messages
// that are serialised once.
//
// Bound to one thread, all of it: events come from within Loop::RunUntil and RunTo.
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

// Keeps gRPC's core of this process up while it lives: to let it go and take it again between
// measurements would be measured.
class GrpcCore {
 public:
  GrpcCore();
  ~GrpcCore();
  GrpcCore(const GrpcCore&) = delete;
  GrpcCore& operator=(const GrpcCore&) = delete;
};

sync::TimeNs Now();  // CLOCK_MONOTONIC, as the daemon's

// Bytes on their way, shared by all copies; sending them again costs nothing but the sending.
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
  // RunUntil ends with Cancelled once `*interrupted` is set.
  explicit Loop(const std::atomic<bool>* interrupted = nullptr);
  ~Loop();  // every call has been let go of; waits for their ends
  Loop(const Loop&) = delete;
  Loop& operator=(const Loop&) = delete;

  // Handles events until `done`, which is asked after each. DeadlineExceeded if it is not done in
  // time.
  absl::Status RunUntil(sync::TimeNs deadline, absl::FunctionRef<bool()> done);
  // Handles events until `time`; it may be up to a millisecond later. Cancelled as above.
  absl::Status RunTo(sync::TimeNs time);

 private:
  friend class Call;
  class Impl;
  std::unique_ptr<Impl> impl_;
};

// Where to, and over TLS, by what certificate: both ends', and the authority of both.
struct Target {
  std::string address;
  std::string certificate, key;  // PEM; empty: no TLS
};

// A connection of its own, for any number of calls.
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
  std::function<void(std::string_view)> message;   // one has come
  std::function<void(const absl::Status&)> ended;  // once, and last
};

// One call of any shape, as a stream of bytes in both directions. When it is destroyed it is
// cancelled, and no event comes any more.
class Call {
 public:
  // `method`: "/package.Service/Method". With `read_on` each message is followed by the reading of
  // the next; without, Read asks for one.
  Call(Loop& loop, const Connection& connection, const std::string& method, CallEvents events,
       bool read_on = true);
  ~Call();
  Call(const Call&) = delete;
  Call& operator=(const Call&) = delete;

  // Started, nothing being written, not half-closed, not ended.
  bool writable() const;
  // Must be writable. `more`: another Write follows at once, so this one need not be flushed.
  void Write(const Message& message, bool more = false);
  void WritesDone();  // must be writable
  void Read();
  // From the next message on.
  void set_read_on(bool read_on);
  bool ended() const;

 private:
  friend class Loop;
  class Impl;
  Impl* impl_;  // owns itself until its last event
};

}  // namespace voxeld::bench
