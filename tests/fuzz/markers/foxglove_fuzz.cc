// A malicious Foxglove server: the channels that it announces, its messages, and the updates in
// them. The entities shown are those that were put and not removed.

#include <cmath>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <utility>

#include "tests/fuzz/expect.h"
#include "tests/fuzz/script.h"
#include "tools/markers/foxglove_channels.h"
#include "tools/markers/marker_scene.h"

namespace voxeld::fuzz {
namespace {

using namespace voxeld::markers;  // NOLINT(google-build-using-namespace)
using Json = nlohmann::json;

constexpr int kMostMessages = 64;

class Viewer {
 public:
  void Told(const std::string& text) {
    const size_t before = channels_.subscribed();
    const absl::StatusOr<std::string> answer = channels_.Told(text);
    ExpectSays(answer.status());
    EXPECT_THAT_HOLDS(channels_.subscribed() <= FoxgloveChannels::kMostChannels &&
                      channels_.passed_over().size() <= FoxgloveChannels::kMostPassedOver);
    if (!answer.ok() || answer->empty()) {
      EXPECT_THAT_HOLDS(!answer.ok() || channels_.subscribed() <= before);
      return;
    }
    const Json json = Json::parse(*answer, nullptr, false);
    EXPECT_THAT_HOLDS(json.is_object() && json["op"] == "subscribe" &&
                      !json["subscriptions"].empty());
  }

  void Sent(const std::string& bytes) {
    const auto message = channels_.Data(bytes);
    ExpectSays(message.status());
    if (message.ok() && message->has_value()) {
      Update((*message)->topic, (*message)->payload, (*message)->encoding);
    }
  }

  void Update(const std::string& topic, const std::string& payload, Encoding encoding) {
    const auto update = ParseSceneUpdate(payload, encoding);
    if (!update.ok()) {
      EXPECT_THAT_HOLDS(absl::IsInvalidArgument(update.status()));
      EXPECT_THAT_HOLDS(!update.status().message().empty());
      return;
    }
    const MarkerScene::Changes changes = scene_.Apply(topic, *update, now_);
    for (const std::string& id : changes.remove) up_.erase(id);
    for (const auto& [id, piece] : changes.put) {
      EXPECT_THAT_HOLDS(!id.empty());
      up_.insert(id);
    }
    EXPECT_THAT_HOLDS(scene_.size() <= MarkerScene::kMostEntities);
  }

  void Wait(sync::TimeNs duration) { now_ += duration; }

 private:
  FoxgloveChannels channels_{{}};
  MarkerScene scene_;
  std::set<std::string> up_;
  sync::TimeNs now_ = sync::kSecond;
};

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxeld;  // NOLINT(google-build-using-namespace)
  fuzz::Script script(data, size);
  fuzz::Viewer viewer;
  for (int i = 0; i < fuzz::kMostMessages && !script.done(); ++i) {
    const uint8_t what = script.Byte() % 5;
    switch (what) {
      case 0:
        viewer.Told(script.Text());
        break;
      case 1:
        viewer.Sent(script.Text());
        break;
      case 2:
      case 3:
        viewer.Update("/m", script.Text(),
                      what == 2 ? markers::Encoding::kProtobuf : markers::Encoding::kJson);
        break;
      default:
        viewer.Wait(script.Byte() * 100 * sync::kMillisecond);
        break;
    }
  }
  return 0;
}
