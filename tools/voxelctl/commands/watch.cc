#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/text/proto_json.h"

namespace voxeld::voxelctl {
namespace {

// Formats change sets as lines: "+" added, "~" changed, "-" removed; an owner, a layer, an entity.
class Lines {
 public:
  // Lists changes in the order in which a message applies.
  std::string Of(const v1::WatchSceneResponse& message) {
    std::string text;
    for (const v1::LayerKey& layer : message.removed_layers()) {
      known_.erase({layer.owner(), layer.layer()});
      absl::StrAppend(&text, "- ", Name(layer.owner(), layer.layer()), "\n");
    }
    for (const v1::EntityKey& key : message.removed_entities()) {
      known_[{key.owner(), key.layer()}].erase(key.id());
      absl::StrAppend(&text, "- ", Name(key), "\n");
    }
    for (const v1::LayerInfo& layer : message.layers()) {
      const bool came = known_.try_emplace({layer.owner(), layer.layer()}).second;
      absl::StrAppend(&text, Sign(came), Name(layer.owner(), layer.layer()), Details(layer), "\n");
    }
    for (const v1::WatchedEntity& entity : message.entities()) {
      const v1::EntityKey& key = entity.info().key();
      const bool came = known_[{key.owner(), key.layer()}].insert(key.id()).second;
      absl::StrAppend(&text, Sign(came), Name(key), "  ", EscapeForTerminal(entity.info().kind()),
                      "\n");
    }
    return text;
  }

 private:
  static const char* Sign(bool came) { return came ? "+ " : "~ "; }
  static std::string Name(uint64_t owner, const std::string& layer) {
    return absl::StrCat(owner, " ", EscapeForTerminal(layer));
  }
  static std::string Name(const v1::EntityKey& key) {
    return absl::StrCat(Name(key.owner(), key.layer()), " ", EscapeForTerminal(key.id()));
  }
  static std::string Details(const v1::LayerInfo& layer) {
    std::string text;
    if (!layer.client_name().empty()) {
      absl::StrAppend(&text, "  of ", EscapeForTerminal(layer.client_name()));
    }
    if (!layer.visible()) text += ", hidden";
    if (layer.orphaned()) text += ", orphaned";
    return text;
  }

  std::map<std::pair<uint64_t, std::string>, std::set<std::string>> known_;
};

}  // namespace

absl::Status Watch(const WatchOptions& options, Connection& connection, Interrupt& interrupt,
                   Console& console) {
  v1::WatchSceneRequest request;
  request.set_layer(options.layer);
  request.set_owner(options.owner);
  Lines lines;
  v1::WatchSceneResponse change_set;
  bool in_sync = false;  // once, at least
  absl::Status status = connection.WatchScene(request, [&](const v1::WatchSceneResponse& message) {
    const bool first = message.in_sync() != 0 && !in_sync;
    in_sync = in_sync || first;
    if (console.json()) {
      change_set.MergeFrom(message);
      if (message.in_sync() == 0) return true;
      const bool read = console.Data(JsonText(ToJson(change_set), true));
      change_set.Clear();
      return read;
    }
    const std::string text = lines.Of(message);
    const bool read = text.empty() || console.Data(text);
    if (first) console.Say("that is all there is; what follows is news (Ctrl-C ends)");
    return read;
  });
  // Ctrl-C is the normal end of a watch.
  if (in_sync && interrupt.requested()) return absl::OkStatus();
  return status;
}

}  // namespace voxeld::voxelctl
