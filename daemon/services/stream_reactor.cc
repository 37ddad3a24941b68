// Implements SceneService.Stream for gRPC as a port for StreamSession.
#include <grpcpp/alarm.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/server_callback.h>
#include <grpcpp/support/slice.h>

#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/container/inlined_vector.h"
#include "daemon/services/services.h"
#include "daemon/services/status.h"
#include "daemon/services/stream_session.h"

namespace voxeld::daemon::services {
namespace {

class Received final : public ReceivedMessage {
 public:
  // Returns: false if the message cannot be decompressed. `bytes` is left empty.
  bool Take(grpc::ByteBuffer& bytes) {
    slices_.resize(1);
    const bool single = bytes.TrySingleSlice(&slices_[0]).ok();
    if (!single && !bytes.Dump(&slices_).ok()) return false;
    bytes.Clear();
    views_.reserve(slices_.size());
    for (const grpc::Slice& slice : slices_) {
      views_.emplace_back(reinterpret_cast<const char*>(slice.begin()), slice.size());
    }
    return true;
  }

  std::span<const std::string_view> slices() const override { return views_; }

 private:
  std::vector<grpc::Slice> slices_;
  absl::InlinedVector<std::string_view, 2> views_;
};

class StreamReactor final : public grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>,
                            public StreamPort {
 public:
  StreamReactor(ServiceContext& context, access::Caller caller)
      : session_(std::make_shared<StreamSession>(context, this)) {
    session_->SetCaller(std::move(caller));
    session_->Start();
  }

  void Read() override { StartRead(&incoming_); }

  void Write(const std::string& message) override {
    const grpc::Slice slice(message);
    outgoing_ = grpc::ByteBuffer(&slice, 1);
    StartWrite(&outgoing_);
  }

  void Finish(const absl::Status& status) override {
    grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>::Finish(ToGrpc(status));
  }

  void SetAlarm(sync::TimeNs delay) override {
    alarm_ = std::make_unique<grpc::Alarm>();
    const gpr_timespec deadline =
        gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC), gpr_time_from_nanos(delay, GPR_TIMESPAN));
    alarm_->Set(deadline, [session = session_](bool due) {
      if (due) session->OnAlarm();
    });
  }

  void Post() override {
    turn_ = std::make_unique<grpc::Alarm>();
    turn_->Set(gpr_now(GPR_CLOCK_MONOTONIC), [session = session_](bool due) {
      if (due) session->OnTurn();
    });
  }

  void OnReadDone(bool ok) override {
    if (!ok) return session_->OnReadsDone();
    auto message = std::make_unique<Received>();
    if (!message->Take(incoming_)) {
      return session_->End(absl::InternalError("a message could not be decompressed"));
    }
    session_->OnMessage(std::move(message));
  }

  void OnWriteDone(bool ok) override {
    outgoing_.Clear();
    session_->OnWritten(ok);
  }

  void OnCancel() override { session_->OnCancel(); }

  void OnDone() override {
    session_->OnPortDone();
    delete this;
  }

 private:
  const std::shared_ptr<StreamSession> session_;
  grpc::ByteBuffer incoming_, outgoing_;
  std::unique_ptr<grpc::Alarm> alarm_, turn_;
};

}  // namespace

grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* NewStream(ServiceContext& context,
                                                                       access::Caller caller) {
  return new StreamReactor(context, std::move(caller));
}

}  // namespace voxeld::daemon::services
