#include "client/cpp/src/grpc_transport.h"

#include <grpc/grpc.h>
#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/channel_arguments.h>
#include <grpcpp/support/client_callback.h>
#include <grpcpp/support/slice.h>

#include <utility>
#include <vector>

#include "client/cpp/src/local_socket.h"
#include "display/sync/mutex.h"
#include "voxeld/channel.h"
#include "voxeld/v1/scene.grpc.pb.h"  // for gRPC's deserialisation of answers

namespace voxeld::client {
namespace {

constexpr char kMethod[] = "/voxeld.v1.SceneService/Stream";
constexpr int kMostAnswerBytes = 64 << 20;

// References the payloads, and releases them when gRPC has sent them.
grpc::ByteBuffer ToByteBuffer(const Rope& message) {
  std::vector<grpc::Slice> slices;
  slices.emplace_back(message.head());
  for (const Rope::Chunk& chunk : message.tail()) {
    if (chunk.owner == nullptr) {
      slices.emplace_back(chunk.text);
      continue;
    }
    slices.emplace_back(
        const_cast<char*>(chunk.shared.data()), chunk.shared.size(),
        [](void* owner) { delete static_cast<std::shared_ptr<const void>*>(owner); },
        new std::shared_ptr<const void>(chunk.owner));
  }
  return grpc::ByteBuffer(slices.data(), slices.size());
}

class GrpcStream final : public Stream,
                         private grpc::ClientBidiReactor<grpc::ByteBuffer, v1::StreamResponse> {
 public:
  GrpcStream(const std::shared_ptr<grpc::Channel>& channel, Events* events)
      : events_(events), stub_(channel) {
    stub_.PrepareBidiStreamingCall(&context_, kMethod, {}, this);
    // Writes start outside of reactions.
    AddHold();
    StartRead(&response_);
    StartCall();
  }

  void Write(const Rope& message) override {
    sync::MutexLock lock(mutex_);
    if (ending_) return;
    request_ = ToByteBuffer(message);
    StartWrite(&request_);
  }

  void WritesDone() override {
    sync::MutexLock lock(mutex_);
    if (!ending_) StartWritesDone();
  }

  void Cancel() override { context_.TryCancel(); }

 private:
  void OnReadDone(bool ok) override {
    if (ok) {
      events_->OnRead(response_);
      StartRead(&response_);
      return;
    }
    {
      sync::MutexLock lock(mutex_);
      if (std::exchange(ending_, true)) return;
    }
    RemoveHold();
  }

  void OnWriteDone(bool ok) override {
    if (ok) events_->OnWritten();
  }

  void OnDone(const grpc::Status& status) override {
    events_->OnEnd({static_cast<absl::StatusCode>(status.error_code()), status.error_message()});
  }

  Events* const events_;
  grpc::ClientContext context_;
  grpc::TemplatedGenericStub<grpc::ByteBuffer, v1::StreamResponse> stub_;
  v1::StreamResponse response_;
  grpc::ByteBuffer request_;
  sync::Mutex mutex_;
  bool ending_ VOXELD_GUARDED_BY(mutex_) = false;
};

class GrpcTransport final : public Transport {
 public:
  GrpcTransport(std::string address, Credentials credentials, Keepalive keepalive)
      : address_(std::move(address)), credentials_(std::move(credentials)), keepalive_(keepalive) {}

  absl::Status MakeFirst() {
    auto made = Make();
    if (!made.ok()) return made.status();
    last_ = *std::move(made);
    return absl::OkStatus();
  }

  std::unique_ptr<Stream> Start(Stream::Events* events) override {
    // The first stream uses the channel that was made to validate the arguments.
    if (std::exchange(started_, true)) {
      if (auto made = Make(); made.ok()) last_ = *std::move(made);
    }
    return std::make_unique<GrpcStream>(last_, events);
  }

  std::unique_ptr<MemoryChannel> OpenMemory(const std::string& path, const std::string& token,
                                            MemoryChannel::Events* events) override {
    if (!address_.starts_with("unix:")) return nullptr;
    return ConnectLocalSocket(path, token, events);
  }

 private:
  absl::StatusOr<std::shared_ptr<grpc::Channel>> Make() const {
    grpc::ChannelArguments arguments;
    arguments.SetMaxReceiveMessageSize(kMostAnswerBytes);
    // The server is nearby; a configured web proxy is not meant for it.
    arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
    // The session decides the pauses between attempts, not gRPC's shared subchannel pool.
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, static_cast<int>(keepalive_.interval.count()));
    arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, static_cast<int>(keepalive_.timeout.count()));
    // By default gRPC pings only twice without data, and then stops until data goes out.
    arguments.SetInt(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
    return MakeChannel(address_, credentials_, arguments);
  }

  const std::string address_;
  const Credentials credentials_;
  const Keepalive keepalive_;
  std::shared_ptr<grpc::Channel> last_;
  bool started_ = false;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Transport>> MakeGrpcTransport(std::string address,
                                                             Credentials credentials,
                                                             Keepalive keepalive) {
  // Keep gRPC initialised from now on: shutting it down waits, up to 10 s, for sockets that it is
  // still closing, and that would happen at the end of the last session.
  static const bool up = (grpc_init(), true);
  static_cast<void>(up);
  auto transport =
      std::make_unique<GrpcTransport>(std::move(address), std::move(credentials), keepalive);
  if (absl::Status status = transport->MakeFirst(); !status.ok()) return status;
  return transport;
}

}  // namespace voxeld::client
