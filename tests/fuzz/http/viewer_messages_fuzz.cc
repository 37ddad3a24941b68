// The viewer and a page that means harm: messages of text, in time, while displays show or do not. What it is told is JSON or a volume's
// bytes; one that is wrong has an error, and without control nothing is changed.

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "daemon/viewer/viewer_socket.h"
#include "tests/daemon/fakes/simulation.h"
#include "tests/fuzz/exchanges.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/script.h"

namespace voxeld::fuzz {
namespace {

using namespace voxeld::daemon;  // NOLINT(google-build-using-namespace)
using Json = nlohmann::json;

class Peer final : public http::WebSocketPeer {
 public:
  void Send(std::string message, bool binary) override {
    ++sent;
    if (binary) {
      EXPECT_THAT_HOLDS(message.size() >= 24 && message[0] >= 1 && message[0] <= 4);
      return;
    }
    const Json json = Json::parse(message, nullptr, false);
    EXPECT_THAT_HOLDS(json.is_object() && json.size() == 1, message);
    if (json.contains("error")) {
      ++errors;
      EXPECT_THAT_HOLDS(json["error"].is_string() && !json["error"].get<std::string>().empty());
    }
  }
  void Post(std::function<void()> what) override { posted.push_back(std::move(what)); }
  void Close(std::string why) override {
    EXPECT_THAT_HOLDS(!why.empty());
    closed = true;
  }

  std::deque<std::function<void()>> posted;
  uint64_t sent = 0, errors = 0;
  bool closed = false;
};

void Run(Script script) {
  const bool control = script.Flag();
  testing::Simulation simulation({}, 2);
  simulation.Start();
  auto shared = std::make_shared<viewer::ViewerShared>(
      viewer::ViewerShared{.core = *simulation.core,
                           .clock = simulation.clock,
                           .options = {.version = "1"},
                           .play = viewer::ViewerPlay::Make({.why_not = "no player"}, nullptr),
                           .places = {}});
  auto peer = std::make_shared<Peer>();
  std::unique_ptr<http::WebSocketService> service = viewer::NewViewerSocket(shared, peer, control);
  const auto settle = [&] {
    for (int round = 0; round < 64; ++round) {
      simulation.core->Step();
      if (peer->posted.empty()) break;
      const auto what = std::move(peer->posted.front());
      peer->posted.pop_front();
      what();
    }
    EXPECT_THAT_HOLDS(shared->watches <= 64);
  };
  testing::Simulation::Client client = simulation.Open();
  for (int step = 0; step < MostSteps(48) && !script.done() && !peer->closed; ++step) {
    switch (script.Byte() % 8) {
      case 0:
        simulation.Advance(script.Byte() * 50 * sync::kMillisecond);
        break;
      case 1:
        simulation.Show(script.Byte() % 2);
        break;
      case 2:
        simulation.Send(client, script.Byte() + 1,
                        testing::Put("a", "p", static_cast<float>(script.Byte() % 8)));
        break;
      default: {
        std::string text = script.Text();
        text.resize(std::min<size_t>(text.size(), http::kGreatestMessage));
        const uint64_t errors = peer->errors;
        const Json json = Json::parse(text, nullptr, false);
        service->OnText(std::move(text));
        settle();
        CountExchange(ExchangeKind::kViewer, peer->errors == errors);
        if (!json.is_object())
          EXPECT_THAT_HOLDS(peer->errors == errors + 1, "garbage has no error");
        break;
      }
    }
    settle();
  }
  service = nullptr;
  settle();
  EXPECT_THAT_HOLDS(shared->watches == 0, shared->watches, " watches outlive their socket");
}

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxeld::fuzz::Run(voxeld::fuzz::Script(data, size));
  return 0;
}
