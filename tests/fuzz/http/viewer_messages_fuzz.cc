// The viewer, and malicious pages: text messages over time, while displays show or do not, and are
// lost. A page receives JSON or a volume's bytes; a wrong message is answered with an error, and a
// request for a comparison with an answer.

#include <algorithm>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <utility>

#include "daemon/viewer/viewer_socket.h"
#include "display/sync/mutex.h"
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
    if (json.contains("compared")) ++compared;
    if (json.contains("error")) {
      ++errors;
      EXPECT_THAT_HOLDS(json["error"].is_string() && !json["error"].get<std::string>().empty());
    }
  }
  // May be called in any thread.
  void Post(std::function<void()> what) override {
    const sync::MutexLock lock(mutex_);
    posted_.push_back(std::move(what));
  }
  void Close(std::string why) override {
    EXPECT_THAT_HOLDS(!why.empty());
    closed = true;
  }

  // Runs the function that was posted first. Returns false if none is waiting.
  bool CarryOut() {
    std::function<void()> what;
    {
      const sync::MutexLock lock(mutex_);
      if (posted_.empty()) return false;
      what = std::move(posted_.front());
      posted_.pop_front();
    }
    what();
    return true;
  }

  uint64_t sent = 0, errors = 0, compared = 0;
  bool closed = false;

 private:
  sync::Mutex mutex_;
  std::deque<std::function<void()>> posted_ VOXELD_GUARDED_BY(mutex_);
};

// Returns whether a message requests a comparison, according to docs/protocols/viewer.md.
bool AsksToCompare(const Json& json) {
  if (!json.is_object() || !json.contains("compare")) return false;
  for (const char* before : {"hello", "watch", "shown", "unwatch", "dark"}) {
    if (json.contains(before)) return false;
  }
  return true;
}

// Lights at points; a page is not told their places one by one.
display::DisplayInfo Lights() {
  display::DisplayInfo info = testing::SmallDisplay("lights");
  display::Lattice lattice;
  lattice.width_px = 2, lattice.height_px = 1;
  lattice.cell_mm = {1, 1, 1};
  lattice.points_mm = {display::Vec3{0, 0, 0}, display::Vec3{1, 1, 0}};
  info.geometry.shape = lattice;
  info.layout = {1, 2, 1, 1, display::PixelFormat::kRgb888};
  return info;
}

class Session {
 public:
  explicit Session(bool control) : control_(control) {
    auto lights = std::make_unique<testing::ScriptedDisplay>(Lights(), simulation_.clock);
    lights_ = lights.get();
    EXPECT_THAT_HOLDS(simulation_.core->AddDisplay(std::move(lights), {}).ok());
    simulation_.Start();
    lights_->Show();
    shared_ = std::make_shared<viewer::ViewerShared>(
        viewer::ViewerShared{.core = *simulation_.core,
                             .clock = simulation_.clock,
                             .options = {.version = "1"},
                             .play = viewer::ViewerPlay::Make({.why_not = "no player"}, nullptr),
                             .places = {}});
    client_ = simulation_.Open();
  }

  void Run(Script script) {
    for (int step = 0; step < MostSteps(48) && !script.done(); ++step) {
      const uint8_t what = script.Byte();
      switch (what % 8) {
        case 0:
          simulation_.Advance(script.Byte() * 50 * sync::kMillisecond);
          break;
        case 1:
          Device(script.Byte());
          break;
        case 2:
          simulation_.Send(client_, script.Byte() + 1,
                           testing::Put("a", "p", static_cast<float>(script.Byte() % 8)));
          break;
        default: {
          Page& page = pages_[(what >> 3) % kPages];
          if (what >= 0xF8) page = Page();  // it disconnects; another takes its place
          Say(page, script.Text(), (what & 0x80) == 0);
          break;
        }
      }
      Settle();
    }
    for (Page& page : pages_) page.service = nullptr;
    Settle();
    EXPECT_THAT_HOLDS(shared_->watches == 0, shared_->watches, " watches outlive their socket");
  }

 private:
  static constexpr size_t kPages = 5;
  struct Page {
    std::shared_ptr<Peer> peer;
    std::unique_ptr<http::WebSocketService> service;
  };

  void Device(uint8_t what) {
    testing::ScriptedDisplay& display = simulation_.display(what % 2);
    if (what >= 0xF0) {
      display.Lose("unplugged");
    } else if (what >= 0xE0) {
      display.Attach();
    } else if (what >= 0xD0) {
      lights_->Show();
    } else {
      display.Show();
    }
    simulation_.core->Step();
  }

  // `wait`: waits for a comparison to end.
  void Say(Page& page, std::string text, bool wait) {
    if (page.service == nullptr) {
      page.peer = std::make_shared<Peer>();
      page.service = viewer::NewViewerSocket(shared_, page.peer, control_);
    }
    Peer& peer = *page.peer;
    if (peer.closed) return;
    text.resize(std::min<size_t>(text.size(), http::kGreatestMessage));
    const uint64_t errors = peer.errors, compared = peer.compared;
    const Json json = Json::parse(text, nullptr, false);
    page.service->OnText(std::move(text));
    Settle();
    while (wait && AsksToCompare(json) && peer.errors == errors && peer.compared == compared) {
      if (!peer.CarryOut()) {
        // The comparer pauses between two comparisons, by the clock that stands still here.
        if (simulation_.clock.waiters() > 0) simulation_.Advance(sync::kSecond);
        std::this_thread::yield();
      }
      Settle();
    }
    CountExchange(ExchangeKind::kViewer, peer.errors == errors);
    if (!json.is_object()) {
      EXPECT_THAT_HOLDS(peer.errors == errors + 1, "garbage has no error");
    }
  }

  void Settle() {
    for (int round = 0; round < 64; ++round) {
      simulation_.core->Step();
      bool idle = true;
      for (const Page& page : pages_) {
        if (page.peer != nullptr && page.peer->CarryOut()) idle = false;
      }
      if (idle) break;
    }
    EXPECT_THAT_HOLDS(shared_->watches <= 64);
  }

  const bool control_;
  testing::Simulation simulation_{{}, 2, [](const gpu::EngineOptions&) {
                                    return std::make_unique<testing::RecordingEngine>(
                                        std::make_shared<testing::EngineScript>());
                                  }};
  testing::ScriptedDisplay* lights_;
  std::shared_ptr<viewer::ViewerShared> shared_;
  testing::Simulation::Client client_;
  Page pages_[kPages];
};

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxeld::fuzz::Script script(data, size);
  const bool control = script.Flag();
  voxeld::fuzz::Session(control).Run(script);
  return 0;
}
