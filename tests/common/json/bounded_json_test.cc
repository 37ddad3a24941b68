// Tests JSON from untrusted sources: a text that nests deeper than the bound never becomes a
// document.
#include "common/json/bounded_json.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/small_stack.h"

namespace voxeld {
namespace {

std::string Nested(const std::string& open, const std::string& close, size_t times) {
  std::string text;
  for (size_t i = 0; i < times; ++i) text += open;
  text += "1";
  for (size_t i = 0; i < times; ++i) text += close;
  return text;
}

TEST(ParseBoundedJson, ReadsWhatIsWithinTheBound) {
  EXPECT_EQ(ParseBoundedJson(R"({"a": "[[[[{{{{\"", "b": [1, {"c": null}]})").dump(),
            R"({"a":"[[[[{{{{\"","b":[1,{"c":null}]})");
}

TEST(ParseBoundedJson, DiscardsWhatIsNotJson) {
  for (const char* text : {"", "{", "[1,]", "]]]][[[[", "{\"a\" 1}", "nul", "\"\xff\""}) {
    EXPECT_TRUE(ParseBoundedJson(text).is_discarded()) << text;
  }
}

TEST(ParseBoundedJson, DiscardsDeepTextBeforeItTakesStack) {
  OnSmallStack([] {
    for (size_t depth = 1; depth <= (size_t{1} << 20); depth = depth < 80 ? depth + 1 : depth * 2) {
      EXPECT_EQ(ParseBoundedJson(Nested("[", "]", depth)).is_discarded(), depth > kMaxJsonDepth);
      EXPECT_EQ(ParseBoundedJson(Nested("{\"a\":", "}", depth)).is_discarded(),
                depth > kMaxJsonDepth);
      EXPECT_EQ(ParseBoundedJson(Nested("[{\"a\":", "}]", depth)).is_discarded(),
                2 * depth > kMaxJsonDepth);
    }
  });
}

}  // namespace
}  // namespace voxeld
