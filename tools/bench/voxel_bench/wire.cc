#include "tools/bench/voxel_bench/wire.h"

#include <grpc/grpc.h>
#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <grpcpp/completion_queue.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/slice.h>

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include <google/protobuf/message_lite.h>

#include "absl/strings/str_cat.h"

namespace voxeld::bench {
namespace {

// Interval at which an interruption is checked.
constexpr sync::TimeNs kLookUpEvery = 100 * sync::kMillisecond;
constexpr sync::TimeNs kEndLimit = 5 * sync::kSecond;

gpr_timespec InGrpcTime(sync::TimeNs time) {
  const sync::TimeNs left = std::max<sync::TimeNs>(0, time - Now());
  return gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC), gpr_time_from_nanos(left, GPR_TIMESPAN));
}

absl::Status FromGrpc(const grpc::Status& status) {
  return absl::Status(static_cast<absl::StatusCode>(status.error_code()), status.error_message());
}

}  // namespace

GrpcCore::GrpcCore() { grpc_init(); }
GrpcCore::~GrpcCore() { grpc_shutdown(); }

sync::TimeNs Now() { return sync::SystemClock().Now(); }

Message::Message(const google::protobuf::MessageLite& message) {
  const std::string text = message.SerializeAsString();
  const grpc::Slice slice(text);
  buffer_ = std::make_shared<const grpc::ByteBuffer>(&slice, 1);
  bytes_ = text.size();
}

// ------------------------------------------------------------------------------------------- call

class Loop::Impl {
 public:
  grpc::CompletionQueue queue;
  const std::atomic<bool>* interrupted = nullptr;
  size_t calls = 0;  // that have not ended
};

// Every operation in progress is an expected event. The last event deletes the object if nobody
// holds it.
class Call::Impl {
 public:
  struct Event {
    Impl* call;
    void (Impl::*handle)(bool ok);
  };

  Impl(Loop::Impl& loop, const std::shared_ptr<grpc::Channel>& channel, const std::string& method,
       CallEvents events, bool read_on)
      : loop_(loop), events_(std::move(events)), read_on_(read_on), stub_(channel) {
    ++loop_.calls;
    stream_ = stub_.PrepareCall(&context_, method, &loop_.queue);
    ++under_way_;
    stream_->StartCall(&started_event_);
  }

  void LetGo() {
    held_ = false;  // its events stay, because one of them may be running
    context_.TryCancel();
    if (started_ && !finished_) Finish();  // there may be no other operation that would end
    DeleteIfOver();
  }

  bool writable() const {
    return started_ && !writing_ && !half_closed_ && !broken_ && !finishing_;
  }
  bool ended() const { return finished_; }
  void set_read_on(bool read_on) { read_on_ = read_on; }

  void Write(const Message& message, bool more) {
    writing_ = true;
    ++under_way_;
    grpc::WriteOptions options;
    if (more) options.set_buffer_hint();
    stream_->Write(message.buffer(), options, &written_event_);
  }

  void WritesDone() {
    writing_ = half_closed_ = true;
    ++under_way_;
    stream_->WritesDone(&written_event_);
  }

  void Read() {
    if (reading_ || finishing_) return;
    reading_ = true;
    ++under_way_;
    stream_->Read(&incoming_, &read_event_);
  }

  static void Handle(void* tag, bool ok) {
    auto* event = static_cast<Event*>(tag);
    Impl* call = event->call;
    --call->under_way_;
    ++call->under_way_;  // held while its handler runs, because that may release the call
    (call->*event->handle)(ok);
    --call->under_way_;
    call->DeleteIfOver();
  }

 private:
  ~Impl() { --loop_.calls; }

  void DeleteIfOver() {
    if (!held_ && under_way_ == 0 && (finished_ || !started_)) delete this;
  }

  void OnStarted(bool ok) {
    started_ = true;
    if (!ok || !held_) return Finish();
    Read();
    if (events_.writable) events_.writable();
  }

  void OnWritten(bool ok) {
    writing_ = false;
    if (!ok) {  // the call has ended; its status comes after the unread messages
      broken_ = read_on_ = true;
      return Read();
    }
    if (held_ && events_.writable && writable()) events_.writable();
  }

  void OnRead(bool ok) {
    reading_ = false;
    if (!ok) return Finish();
    std::vector<grpc::Slice> slices;
    if (!incoming_.Dump(&slices).ok()) {
      context_.TryCancel();
      return Finish();
    }
    incoming_.Clear();
    std::string joined;
    std::string_view bytes;
    if (slices.size() == 1) {
      bytes = {reinterpret_cast<const char*>(slices[0].begin()), slices[0].size()};
    } else {
      for (const grpc::Slice& slice : slices) {
        joined.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
      }
      bytes = joined;
    }
    if (held_ && events_.message) events_.message(bytes);
    if (held_ && read_on_) Read();
  }

  void Finish() {
    if (finishing_) return;
    finishing_ = true;
    ++under_way_;
    stream_->Finish(&status_, &finished_event_);
  }

  void OnFinished(bool) {
    finished_ = true;
    if (held_ && events_.ended) events_.ended(FromGrpc(status_));
  }

  Loop::Impl& loop_;
  CallEvents events_;
  bool read_on_;
  grpc::GenericStub stub_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::GenericClientAsyncReaderWriter> stream_;
  grpc::ByteBuffer incoming_;
  grpc::Status status_;
  Event started_event_{this, &Impl::OnStarted}, written_event_{this, &Impl::OnWritten},
      read_event_{this, &Impl::OnRead}, finished_event_{this, &Impl::OnFinished};
  int under_way_ = 0;
  bool held_ = true, started_ = false, reading_ = false, writing_ = false, half_closed_ = false,
       broken_ = false, finishing_ = false, finished_ = false;
};

Call::Call(Loop& loop, const Connection& connection, const std::string& method, CallEvents events,
           bool read_on)
    : impl_(new Impl(*loop.impl_, connection.channel_, method, std::move(events), read_on)) {}
Call::~Call() { impl_->LetGo(); }
bool Call::writable() const { return impl_->writable(); }
void Call::Write(const Message& message, bool more) { impl_->Write(message, more); }
void Call::WritesDone() { impl_->WritesDone(); }
void Call::Read() { impl_->Read(); }
void Call::set_read_on(bool read_on) { impl_->set_read_on(read_on); }
bool Call::ended() const { return impl_->ended(); }

// ------------------------------------------------------------------------------------------- loop

Loop::Loop(const std::atomic<bool>* interrupted) : impl_(std::make_unique<Impl>()) {
  impl_->interrupted = interrupted;
}

Loop::~Loop() {
  impl_->interrupted = nullptr;
  RunUntil(Now() + kEndLimit, [this] { return impl_->calls == 0; }).IgnoreError();
  impl_->queue.Shutdown();
  void* tag = nullptr;
  bool ok = false;
  while (impl_->queue.Next(&tag, &ok)) Call::Impl::Handle(tag, ok);
}

absl::Status Loop::RunUntil(sync::TimeNs deadline, absl::FunctionRef<bool()> done) {
  const auto interrupted = [this] {
    return impl_->interrupted != nullptr && impl_->interrupted->load(std::memory_order_relaxed);
  };
  const auto next_look = [deadline] {
    return InGrpcTime(std::min(deadline, Now() + kLookUpEvery));
  };
  gpr_timespec look = next_look();
  while (!done()) {
    if (interrupted()) return absl::CancelledError("interrupted");
    void* tag = nullptr;
    bool ok = false;
    if (impl_->queue.AsyncNext(&tag, &ok, look) == grpc::CompletionQueue::GOT_EVENT) {
      Call::Impl::Handle(tag, ok);
      continue;
    }
    if (Now() >= deadline) {
      return done() ? absl::OkStatus() : absl::DeadlineExceededError("not in time");
    }
    look = next_look();
  }
  return absl::OkStatus();
}

absl::Status Loop::RunTo(sync::TimeNs time) {
  return RunUntil(time, [time] { return Now() >= time; });
}

// ------------------------------------------------------------------------------------- connection

Connection::Connection(const Target& target) {
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  arguments.SetMaxReceiveMessageSize(-1);
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  const std::shared_ptr<grpc::ChannelCredentials> credentials =
      target.certificate.empty() ? grpc::InsecureChannelCredentials()
                                 : grpc::SslCredentials({.pem_root_certs = target.certificate,
                                                         .pem_private_key = target.key,
                                                         .pem_cert_chain = target.certificate});
  channel_ = grpc::CreateCustomChannel(target.address, credentials, arguments);
}
Connection::~Connection() = default;
Connection::Connection(Connection&&) noexcept = default;

}  // namespace voxeld::bench
