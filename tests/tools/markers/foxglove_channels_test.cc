// Tests a Foxglove server's announcements of its channels, without a socket.
#include "tools/markers/foxglove_channels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace voxeld::markers {
namespace {

using ::testing::ElementsAre;
using Json = nlohmann::json;

constexpr char kAdvertise[] =
    R"({"op": "advertise", "channels": [
      {"id": 5, "topic": "/m", "encoding": "protobuf", "schemaName": "foxglove.SceneUpdate"},
      {"id": 6, "topic": "/j", "encoding": "json", "schemaName": "foxglove.SceneUpdate"},
      {"id": 7, "topic": "/tf", "encoding": "cdr", "schemaName": "tf2"},
      {"id": 4294967296, "topic": "/far", "encoding": "json", "schemaName": "foxglove.SceneUpdate"}]})";

std::string Message(uint8_t channel, const std::string& payload) {
  return std::string("\x01") + static_cast<char>(channel) + std::string(11, '\0') + payload;
}

TEST(FoxgloveChannels, AreSubscribedToByTheirNumbers) {
  FoxgloveChannels channels({});
  const auto answer = channels.Told(kAdvertise);
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_EQ(Json::parse(*answer), Json::parse(R"({"op": "subscribe", "subscriptions":
                            [{"id": 5, "channelId": 5}, {"id": 6, "channelId": 6}]})"));
  EXPECT_EQ(channels.subscribed(), 2u);
  EXPECT_THAT(channels.passed_over(), ElementsAre("/tf (tf2, cdr)"));
  const auto message = channels.Data(Message(6, "{}"));
  ASSERT_TRUE(message.ok() && message->has_value());
  EXPECT_EQ((*message)->topic, "/j");
  EXPECT_EQ((*message)->payload, "{}");
  EXPECT_EQ((*message)->encoding, Encoding::kJson);
  EXPECT_FALSE(channels.Data(Message(7, ""))->has_value());
}

TEST(FoxgloveChannels, GoOnlyByTheirOwnNumber) {
  FoxgloveChannels channels({});
  ASSERT_TRUE(channels.Told(kAdvertise).ok());
  // 5 and 6 beyond 32 bits, and invalid ones.
  ASSERT_TRUE(
      channels.Told(R"({"op": "unadvertise", "channelIds": [4294967301, 4294967302, -5, "5"]})")
          .ok());
  EXPECT_EQ(channels.subscribed(), 2u);
  ASSERT_TRUE(channels.Told(R"({"op": "unadvertise", "channelIds": [5]})").ok());
  EXPECT_EQ(channels.subscribed(), 1u);
}

TEST(FoxgloveChannels, WhatIsNotOfTheProtocolSaysSo) {
  FoxgloveChannels channels({});
  for (const char* text : {"", "[]", "{", R"({"op": "advertise"})"}) {
    EXPECT_EQ(channels.Told(text).status().code(), absl::StatusCode::kInvalidArgument) << text;
  }
  EXPECT_EQ(channels.Data("\x01short").status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE(channels.Told(R"({"op": "serverInfo"})").ok());
}

}  // namespace
}  // namespace voxeld::markers
