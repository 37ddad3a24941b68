#include "daemon/viewer/page_message.h"

#include <gmock/gmock.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::viewer::page {
namespace {

using ::testing::HasSubstr;

// Returns what is wrong with the message; empty: nothing.
std::string Wrong(const std::string& text, bool control = true) {
  const absl::StatusOr<Message> message = Read(text, control);
  if (message.ok()) return "";
  EXPECT_EQ(message.status().code(), absl::StatusCode::kInvalidArgument) << text;
  return std::string(message.status().message());
}

template <typename T>
T Get(const std::string& text, bool control = false) {
  absl::StatusOr<Message> message = Read(text, control);
  EXPECT_TRUE(message.ok()) << message.status();
  if (!message.ok()) return {};
  EXPECT_TRUE(std::holds_alternative<T>(*message)) << text << " is " << message->index();
  return std::holds_alternative<T>(*message) ? std::get<T>(*std::move(message)) : T();
}

TEST(PageMessage, IsAnObjectOfAKnownKind) {
  for (const char* const text : {"", "{", "[]", "1", "\"hello\"", "null", "{\"hello\":1}}"}) {
    EXPECT_EQ(Wrong(text), "a message is a JSON object") << text;
  }
  EXPECT_THAT(Wrong("{}"), HasSubstr("there is no such message"));
  EXPECT_THAT(Wrong("{\"Hello\":true}"), HasSubstr("there is no such message"));
}

TEST(PageMessage, AsksWithoutMore) {
  Get<Hello>("{\"hello\":true}");
  Get<Hello>("{\"hello\":null,\"watch\":\"sim\",\"id\":1}");  // the first counts
  Get<Stats>("{\"stats\":[]}");
  Get<Layers>("{\"layers\":1}");
}

TEST(PageMessage, WatchesByNameAndNumber) {
  const Watch watch = Get<Watch>("{\"watch\":\"sim\",\"id\":65535}");
  EXPECT_EQ(watch.display, "sim");
  EXPECT_EQ(watch.id, 65535);
  EXPECT_EQ(Get<Watch>("{\"id\":0,\"watch\":\"\"}").id, 0);
  for (const char* const rest :
       {"\"sim\"", "\"sim\",\"id\":65536", "\"sim\",\"id\":-1", "\"sim\",\"id\":1.0",
        "\"sim\",\"id\":\"1\"", "\"sim\",\"id\":null", "1,\"id\":1", "null,\"id\":1"}) {
    EXPECT_EQ(Wrong(absl::StrCat("{\"watch\":", rest, "}")),
              "watch names a display, and id is a number from 0 to 65535")
        << rest;
  }
}

TEST(PageMessage, NamesAWatchByItsId) {
  EXPECT_EQ(Get<Shown>("{\"shown\":7}").id, 7);
  EXPECT_EQ(Get<Unwatch>("{\"unwatch\":0}").id, 0);
  EXPECT_EQ(Get<Dark>("{\"dark\":65535}").id, 65535);
  EXPECT_EQ(Get<Compare>("{\"compare\":3}").id, 3);
  for (const char* const name : {"shown", "unwatch", "dark", "compare"}) {
    for (const char* const id : {"65536", "-1", "\"1\"", "null", "true", "1.5", "[1]", "{}"}) {
      EXPECT_EQ(Wrong(absl::StrCat("{\"", name, "\":", id, "}")),
                absl::StrCat(name, " is the id of a watch, 0 to 65535"));
    }
  }
}

TEST(PageMessage, ComparesWithoutLayers) {
  EXPECT_TRUE(Get<Compare>("{\"compare\":1,\"without\":[]}").without.empty());
  const auto some = Get<Compare>(
      "{\"compare\":1,\"without\":[{\"owner\":\"18446744073709551615\",\"layer\":\"a\"},"
      "{\"owner\":\"0\",\"layer\":\"\"}]}");
  ASSERT_EQ(some.without.size(), 2u);
  EXPECT_EQ(some.without[0].owner, UINT64_MAX);
  EXPECT_EQ(some.without[0].name, "a");
  EXPECT_EQ(some.without[1].owner, 0u);
  for (const char* const list :
       {"1", "{}", "null", "[1]", "[null]", "[{}]", "[{\"owner\":\"1\"}]", "[{\"layer\":\"a\"}]",
        "[{\"owner\":1,\"layer\":\"a\"}]", "[{\"owner\":\"1\",\"layer\":2}]",
        "[{\"owner\":\"-1\",\"layer\":\"a\"}]", "[{\"owner\":\"x\",\"layer\":\"a\"}]",
        "[{\"owner\":\"18446744073709551616\",\"layer\":\"a\"}]",
        "[{\"owner\":\"1\",\"layer\":\"a\"},{}]"}) {
    EXPECT_EQ(Wrong(absl::StrCat("{\"compare\":1,\"without\":", list, "}")),
              "without is a list of layers: {\"owner\": \"1\", \"layer\": \"name\"}")
        << list;
  }
}

TEST(PageMessage, ComparesWithoutAsManyLayersAsThereMayBe) {
  std::string layers;
  for (size_t i = 0; i < kMostHidden; ++i) {
    absl::StrAppend(&layers, i == 0 ? "" : ",", "{\"owner\":\"1\",\"layer\":\"a\"}");
  }
  const auto text = [&] { return absl::StrCat("{\"compare\":1,\"without\":[", layers, "]}"); };
  EXPECT_EQ(Get<Compare>(text()).without.size(), kMostHidden);
  absl::StrAppend(&layers, ",{\"owner\":\"1\",\"layer\":\"a\"}");
  EXPECT_THAT(Wrong(text()), HasSubstr("without is a list of layers"));
}

TEST(PageMessage, ChangesWithControlAlone) {
  for (const char* const text : {"{\"update\":{\"name\":\"sim\",\"blank\":true}}", "{\"update\":7}",
                                 "{\"clear\":{}}", "{\"clear\":7}", "{\"stop\":true}"}) {
    const absl::StatusOr<Message> message = Read(text, false);
    EXPECT_EQ(message.status().code(), absl::StatusCode::kPermissionDenied) << text;
    EXPECT_EQ(message.status().message(), kOnlyLook);
  }
  Get<Stop>("{\"stop\":true}", true);
  const auto update = Get<Update>("{\"update\":{\"name\":\"sim\",\"blank\":true}}", true);
  EXPECT_EQ(update.request.name(), "sim");
  EXPECT_EQ(update.update.blank, true);
  EXPECT_EQ(update.update.brightness, std::nullopt);
  const auto clear = Get<Clear>("{\"clear\":{\"owner\":\"5\",\"layer\":\"a\"}}", true);
  EXPECT_EQ(clear.request.owner(), 5u);
  EXPECT_EQ(clear.request.layer(), "a");
}

TEST(PageMessage, RequestsAreTheProtocols) {
  EXPECT_NE(Wrong("{\"update\":7}"), "");
  EXPECT_THAT(Wrong("{\"update\":{\"no_such_field\":1}}"), HasSubstr("no_such_field"));
  EXPECT_THAT(Wrong("{\"update\":{\"test_pattern\":77}}"), HasSubstr("77"));
  EXPECT_NE(Wrong("{\"clear\":[]}"), "");
  EXPECT_THAT(Wrong("{\"clear\":{\"no_such_field\":1}}"), HasSubstr("no_such_field"));
}

}  // namespace
}  // namespace voxeld::daemon::viewer::page
