// A client to be killed: e2e_client TARGET LAYER clear|linger|keep LINGER_NS
//
// Inserts one sphere, waits for its outcome, prints "up", and keeps committing, each time from
// within a frame that it has not ended, until it is killed.
#include <grpcpp/grpcpp.h>

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>

#include "tests/daemon/services/daemon_fixture.h"

namespace {

using voxeld::daemon::services::Client;
using voxeld::daemon::services::SphereIn;
namespace v1 = voxeld::v1;

v1::DisconnectPolicy Policy(const std::string& text) {
  if (text == "keep") return v1::DISCONNECT_POLICY_KEEP;
  if (text == "linger") return v1::DISCONNECT_POLICY_LINGER;
  return v1::DISCONNECT_POLICY_CLEAR;
}

int Run(const std::string& target, const std::string& layer, const std::string& policy,
        int64_t linger_ns) {
  const auto stub =
      v1::SceneService::NewStub(grpc::CreateChannel(target, grpc::InsecureChannelCredentials()));
  Client client(*stub);
  v1::Open open;
  open.set_client_name("to be killed \"\n\x1b[31m");
  open.set_on_disconnect(Policy(policy));
  open.set_linger_ns(linger_ns);
  client.Open(open);
  client.Send(SphereIn(layer, "ball"));
  client.Commit(1);
  client.ReadOutcomes(1);
  std::puts("up");
  std::fflush(stdout);
  for (uint64_t frame = 2;; ++frame) {
    v1::StreamRequest begin;
    begin.mutable_frame_begin()->set_layer(layer);
    if (!client.Send(begin) || !client.Send(SphereIn(layer, "never")) || !client.Commit(frame)) {
      return 1;
    }
    while (client.answers.size() < frame) {
      if (!client.Read().has_value()) return 1;
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  return Run(argv[1], argv[2], argv[3], std::atoll(argv[4]));
}
