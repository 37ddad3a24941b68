#include "daemon/viewer/page_message.h"

#include <google/protobuf/util/json_util.h>

#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/json/bounded_json.h"
#include "daemon/wire/convert.h"

namespace voxeld::daemon::viewer::page {
namespace {

using Json = nlohmann::json;

absl::Status Wrong(const std::string& why) { return absl::InvalidArgumentError(why); }

std::optional<uint16_t> Number(const Json& json) {
  if (!json.is_number_unsigned() || json.get<uint64_t>() > UINT16_MAX) return std::nullopt;
  return json.get<uint16_t>();
}

// Reads messages that contain only a watch's id.
template <typename T>
absl::StatusOr<Message> ReadId(const char* name, const Json& json) {
  const std::optional<uint16_t> id = Number(json);
  if (!id.has_value()) return Wrong(absl::StrCat(name, " is the id of a watch, 0 to 65535"));
  return T{*id};
}

absl::StatusOr<Message> ReadWatch(const Json& message) {
  const std::optional<uint16_t> id = Number(message.value("id", Json()));
  if (!id.has_value() || !message["watch"].is_string()) {
    return Wrong("watch names a display, and id is a number from 0 to 65535");
  }
  return Watch{*id, message["watch"].get<std::string>()};
}

// Returns: nothing if the list is malformed.
std::optional<std::vector<OwnedName>> ReadLayers(const Json& json) {
  std::vector<OwnedName> layers;
  if (!json.is_array() || json.size() > kMostHidden) return std::nullopt;
  for (const Json& each : json) {
    uint64_t owner = 0;
    if (!each.is_object() || !each.value("owner", Json()).is_string() ||
        !each.value("layer", Json()).is_string() ||
        !absl::SimpleAtoi(each["owner"].get<std::string>(), &owner)) {
      return std::nullopt;
    }
    layers.push_back({owner, each["layer"].get<std::string>()});
  }
  return layers;
}

absl::StatusOr<Message> ReadCompare(const Json& message) {
  absl::StatusOr<Message> compare = ReadId<Compare>("compare", message["compare"]);
  if (!compare.ok()) return compare;
  std::optional<std::vector<OwnedName>> hidden =
      ReadLayers(message.value("without", Json::array()));
  if (!hidden.has_value()) {
    return Wrong("without is a list of layers: {\"owner\": \"1\", \"layer\": \"name\"}");
  }
  std::get<Compare>(*compare).without = *std::move(hidden);
  return compare;
}

absl::Status ReadRequest(const Json& json, google::protobuf::Message* request) {
  const std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  const auto status = google::protobuf::util::JsonStringToMessage(text, request);
  return status.ok() ? absl::OkStatus() : Wrong(std::string(status.message()));
}

absl::StatusOr<Message> ReadUpdate(const Json& json) {
  Update update;
  if (absl::Status status = ReadRequest(json, &update.request); !status.ok()) return status;
  absl::StatusOr<DisplayUpdate> read = wire::FromWire(update.request);
  if (!read.ok()) return read.status();
  update.update = *std::move(read);
  return update;
}

absl::StatusOr<Message> ReadClear(const Json& json) {
  Clear clear;
  if (absl::Status status = ReadRequest(json, &clear.request); !status.ok()) return status;
  return clear;
}

}  // namespace

absl::StatusOr<Message> Read(const std::string& text, bool control) {
  const Json message = ParseBoundedJson(text);
  if (!message.is_object()) return Wrong("a message is a JSON object");
  if (message.contains("hello")) return Hello{};
  if (message.contains("watch")) return ReadWatch(message);
  if (message.contains("shown")) return ReadId<Shown>("shown", message["shown"]);
  if (message.contains("unwatch")) return ReadId<Unwatch>("unwatch", message["unwatch"]);
  if (message.contains("dark")) return ReadId<Dark>("dark", message["dark"]);
  if (message.contains("compare")) return ReadCompare(message);
  if (message.contains("stats")) return Stats{};
  if (message.contains("layers")) return Layers{};
  const bool update = message.contains("update"), clear = message.contains("clear");
  if (!update && !clear && !message.contains("stop")) {
    return Wrong("there is no such message; see docs/protocols/viewer.md");
  }
  if (!control) return absl::PermissionDeniedError(kOnlyLook);
  if (update) return ReadUpdate(message["update"]);
  if (clear) return ReadClear(message["clear"]);
  return Stop{};
}

}  // namespace voxeld::daemon::viewer::page
