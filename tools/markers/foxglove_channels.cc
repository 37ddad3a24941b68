#include "tools/markers/foxglove_channels.h"

#include <algorithm>
#include <boost/endian/conversion.hpp>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/json/bounded_json.h"

namespace voxeld::markers {
namespace {

using Json = nlohmann::json;

constexpr char kSchema[] = "foxglove.SceneUpdate";
constexpr size_t kHeaderBytes = 13;  // kind, subscription, time
constexpr uint8_t kMessageData = 1;
constexpr size_t kMostNameBytes = 1024;

std::string TextOf(const Json& object, const char* key) {
  const auto at = object.find(key);
  return at != object.end() && at->is_string() ? at->get<std::string>() : "";
}

std::optional<uint64_t> NumberOf(const Json& object, const char* key) {
  const auto at = object.find(key);
  if (at == object.end() || !at->is_number_unsigned()) return {};
  return at->get<uint64_t>();
}

}  // namespace

absl::StatusOr<std::string> FoxgloveChannels::Told(std::string_view text) {
  const Json json = ParseBoundedJson(text);
  if (!json.is_object()) return absl::InvalidArgumentError("the server's text is no JSON object");
  const std::string what = TextOf(json, "op");
  if (what == "unadvertise") {
    const auto ids = json.find("channelIds");
    if (ids == json.end() || !ids->is_array()) return "";
    for (const Json& id : *ids) {
      if (!id.is_number_unsigned() || id.get<uint64_t>() > UINT32_MAX) continue;
      channels_.erase(static_cast<uint32_t>(id.get<uint64_t>()));
    }
  }
  if (what != "advertise") return "";  // serverInfo, status and messages of later versions
  const auto channels = json.find("channels");
  if (channels == json.end() || !channels->is_array()) {
    return absl::InvalidArgumentError("the server advertises no list of channels");
  }
  Json wanted = Json::array();
  for (const Json& channel : *channels) {
    if (!channel.is_object()) continue;
    const std::optional<uint64_t> id = NumberOf(channel, "id");
    const std::string topic = TextOf(channel, "topic"), encoding = TextOf(channel, "encoding"),
                      schema = TextOf(channel, "schemaName");
    if (!id.has_value() || *id > UINT32_MAX || topic.size() > kMostNameBytes ||
        schema.size() > kMostNameBytes || encoding.size() > kMostNameBytes) {
      continue;
    }
    if (channels_.size() >= kMostChannels) {
      return absl::InvalidArgumentError(
          absl::StrCat("the server has more than ", kMostChannels, " channels; name the topics"));
    }
    const bool asked =
        topics_.empty() || std::find(topics_.begin(), topics_.end(), topic) != topics_.end();
    const bool readable = schema == kSchema && (encoding == "protobuf" || encoding == "json");
    if (!asked || !readable) {
      if (asked && passed_over_.size() < kMostPassedOver) {
        passed_over_.push_back(absl::StrCat(topic, " (", schema, ", ", encoding, ")"));
      }
      continue;
    }
    // The channel's own number is used as the subscription's number.
    channels_[static_cast<uint32_t>(*id)] = {
        topic, encoding == "json" ? Encoding::kJson : Encoding::kProtobuf};
    wanted.push_back({{"id", *id}, {"channelId", *id}});
  }
  if (wanted.empty()) return "";
  return Json{{"op", "subscribe"}, {"subscriptions", std::move(wanted)}}.dump();
}

absl::StatusOr<std::optional<FoxgloveMessage>> FoxgloveChannels::Data(
    std::string_view bytes) const {
  if (bytes.empty() || static_cast<uint8_t>(bytes[0]) != kMessageData) {
    return std::nullopt;  // times, responses
  }
  if (bytes.size() < kHeaderBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat("a message of ", bytes.size(), " bytes ends within its header"));
  }
  const auto channel = channels_.find(
      boost::endian::load_little_u32(reinterpret_cast<const unsigned char*>(bytes.data() + 1)));
  // Sent before the server saw the unsubscription.
  if (channel == channels_.end()) return std::nullopt;
  return FoxgloveMessage{channel->second.topic, std::string(bytes.substr(kHeaderBytes)),
                         channel->second.encoding};
}

}  // namespace voxeld::markers
