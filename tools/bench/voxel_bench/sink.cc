#include "tools/bench/voxel_bench/sink.h"

#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <grpcpp/support/byte_buffer.h>
#include <grpcpp/support/server_callback.h>
#include <grpcpp/support/slice.h>
#include <poll.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <memory>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "voxeld/v1/scene.grpc.pb.h"

namespace voxeld::bench {
namespace {

class SinkReactor final : public grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
 public:
  SinkReactor() { StartRead(&incoming_); }

  void OnReadDone(bool ok) override {
    if (!ok) {
      v1::StreamResponse response;
      response.set_credit_bytes(bytes_);
      const std::string text = response.SerializeAsString();
      const grpc::Slice slice(text);
      answer_ = grpc::ByteBuffer(&slice, 1);
      return StartWriteAndFinish(&answer_, {}, grpc::Status::OK);
    }
    bytes_ += incoming_.Length();
    incoming_.Clear();
    StartRead(&incoming_);
  }

  void OnDone() override { delete this; }

 private:
  grpc::ByteBuffer incoming_, answer_;
  uint64_t bytes_ = 0;
};

class SinkService final
    : public v1::SceneService::WithRawCallbackMethod_Stream<v1::SceneService::Service> {
 public:
  grpc::ServerBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer>* Stream(
      grpc::CallbackServerContext*) override {
    return new SinkReactor;
  }
};

// Uses the same settings as the daemon (daemon/services/server.cc).
void SetAsTheDaemon(grpc::ServerBuilder& builder) {
  builder.SetMaxReceiveMessageSize(16 << 20);
  builder.SetMaxSendMessageSize(-1);
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_BDP_PROBE, 0);
  builder.AddChannelArgument(GRPC_ARG_ENABLE_CHANNELZ, 1);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_STREAM_LOOKAHEAD_BYTES, 256 << 10);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, 20'000);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10'000);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 5'000);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PING_STRIKES, 2);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, 100);
  builder.AddChannelArgument(GRPC_ARG_MAX_METADATA_SIZE, 8 << 10);
}

}  // namespace

absl::Status RunSink(const std::vector<std::string>& listen) {
  SinkService service;
  grpc::ServerBuilder builder;
  SetAsTheDaemon(builder);
  builder.RegisterService(&service);
  std::vector<int> ports(listen.size(), 0);
  for (size_t i = 0; i < listen.size(); ++i) {
    builder.AddListeningPort(listen[i], grpc::InsecureServerCredentials(), &ports[i]);
  }
  const std::unique_ptr<grpc::Server> server = builder.BuildAndStart();
  std::vector<std::string> addresses;
  for (size_t i = 0; i < listen.size(); ++i) {
    if (server == nullptr || ports[i] == 0) {
      return absl::UnavailableError(absl::StrCat(listen[i], " cannot be listened on"));
    }
    const bool unix_socket = absl::StartsWith(listen[i], "unix:");
    addresses.push_back(
        unix_socket ? listen[i]
                    : absl::StrCat(listen[i].substr(0, listen[i].rfind(':')), ":", ports[i]));
  }
  std::printf("ready %s\n", absl::StrJoin(addresses, " ").c_str());
  std::fflush(stdout);
  // The process that started it holds the other end of its output.
  pollfd reader = {STDOUT_FILENO, 0, 0};
  while (poll(&reader, 1, -1) < 0) {
  }
  server->Shutdown(gpr_now(GPR_CLOCK_MONOTONIC));
  return absl::OkStatus();
}

}  // namespace voxeld::bench
