// Tests TOML from untrusted sources: which texts are read, and that no text makes the parser
// recurse without bound.
#include "common/toml/parse_toml.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "tests/small_stack.h"

namespace voxeld {
namespace {

using ::testing::StartsWith;

std::string ErrorOf(const std::string& text, const TomlLimits& limits = {}) {
  return std::string(ParseToml(text, "a.toml", limits).status().message());
}

std::string Repeated(const std::string& text, size_t times) {
  std::string out;
  out.reserve(text.size() * times);
  for (size_t i = 0; i < times; ++i) out += text;
  return out;
}

std::string Key(size_t parts, const std::string& part = "a") {
  return absl::StrJoin(std::vector<std::string>(parts, part), ".");
}

TEST(ParseToml, ReadsWhatIsWithinTheLimits) {
  const absl::StatusOr<toml::table> table = ParseToml(
      "a.b.c.d.e.f.g.h = [[[1.5, 2.5], [3e1]], [{x.y = \"[[[[[[[[[[[[[[[[[[ # no comment\"}]]\n"
      "# [[[[[[[[[[[[[[[[[[[[ a.a.a.a.a.a.a.a.a.a.a\n"
      "t = '''\n[[[[[[[[[[[[[[[[[[[[\n'a.a.a.a.a.a.a.a.a.a' '''\n"
      "u = \"\"\"\\\"\"\"[[[[[[[[[[[[[[[[[[[[[[\"\"\"\n"
      "[[item]]\nfrom = 1979-05-27T07:32:00.999999-07:00\n",
      "a.toml");
  ASSERT_TRUE(table.ok()) << table.status();
  EXPECT_TRUE(table->at_path("a.b.c.d.e.f.g.h").is_array());
  EXPECT_EQ(table->at_path("a.b.c.d.e.f.g.h[0][1][0]").value<double>(), 30.0);
}

TEST(ParseToml, NamesThePlaceOfWhatIsTooDeep) {
  EXPECT_EQ(ErrorOf(absl::StrCat("x = 1\n  ", Key(9), " = 1\n")),
            "a.toml:2:18: a dotted key has more than 8 parts");
  EXPECT_EQ(ErrorOf(absl::StrCat("x = ", Repeated("[", 17), Repeated("]", 17), "\n")),
            "a.toml:1:21: arrays and tables are nested more than 16 levels deep");
}

TEST(ParseToml, NamesThePlaceOfWhatIsNotToml) {
  EXPECT_THAT(ErrorOf("size = \"1x1\"\nslices = \n"), StartsWith("a.toml:2:"));
  EXPECT_EQ(ErrorOf("\"\x1b[31m\" = \n").find('\x1b'), std::string::npos);
}

TEST(ParseToml, RefusesATextThatIsTooLong) {
  EXPECT_EQ(ErrorOf("a = 1", {.max_bytes = 4}), "a.toml: the file has 5 bytes; the maximum is 4");
  EXPECT_TRUE(ParseToml("a=1\n", "a.toml", {.max_bytes = 4}).ok());
}

// A construct that nests to a given depth, and the greatest depth that is accepted.
struct Construct {
  const char* name;
  std::function<std::string(size_t depth)> text;
  size_t most;
};

const Construct kConstructs[] = {
    {"DottedKey", [](size_t n) { return absl::StrCat(Key(n), " = 1\n"); }, 8},
    {"SpacedDottedKey", [](size_t n) { return absl::StrCat(Key(n, " a "), "= 1\n"); }, 8},
    {"QuotedDottedKey", [](size_t n) { return absl::StrCat(Key(n, "\"a.=b\""), " = 1\n"); }, 8},
    {"LiteralDottedKey", [](size_t n) { return absl::StrCat(Key(n, "'\"'"), " = 1\n"); }, 8},
    {"TableHeader", [](size_t n) { return absl::StrCat("[", Key(n), "]\n"); }, 8},
    {"ArrayOfTablesHeader", [](size_t n) { return absl::StrCat("[[", Key(n), "]]\n"); }, 8},
    {"KeyInInlineTable", [](size_t n) { return absl::StrCat("x = {", Key(n), " = 1}\n"); }, 8},
    {"Array",
     [](size_t n) { return absl::StrCat("x = ", Repeated("[", n), Repeated("]", n), "\n"); }, 16},
    {"ArrayOverLines",
     [](size_t n) { return absl::StrCat("x = ", Repeated("[ # ]\n", n), Repeated("]\n", n)); }, 16},
    {"InlineTable",
     [](size_t n) {
       return absl::StrCat("x = ", Repeated("{a = ", n), "1", Repeated("}", n), "\n");
     },
     16},
    {"InlineTableOfDottedKeys",
     [](size_t n) {
       return absl::StrCat("[", Key(8), "]\n", Key(8, "b"), " = ",
                           Repeated(absl::StrCat("{", Key(8), " = "), n), "1", Repeated("}", n),
                           "\n");
     },
     16},
    {"ArrayInInlineTable",
     [](size_t n) {
       return absl::StrCat("x = ", Repeated("[{a = ", n), "1", Repeated("}]", n), "\n");
     },
     8},
    // A long string may end with one or two quotes of its own before the three that close it.
    {"KeyAfterFourQuotes",
     [](size_t n) { return absl::StrCat("x = {s = \"\"\"a\"\"\"\", ", Key(n), " = 1}\n"); }, 8},
    {"KeyAfterFiveQuotes",
     [](size_t n) { return absl::StrCat("x = {s = \"\"\"a\"\"\"\"\", ", Key(n), " = 1}\n"); }, 8},
    {"KeyAfterFiveApostrophes",
     [](size_t n) { return absl::StrCat("x = {s = '''a''''', ", Key(n), " = 1}\n"); }, 8},
    {"KeyAfterEmptyStrings",
     [](size_t n) {
       return absl::StrCat("x = {s = \"\", t = '', u = \"\"\"\"\"\", ", Key(n), " = 1}\n");
     },
     8},
    {"ArrayAfterFourQuotes",
     [](size_t n) {
       return absl::StrCat("x = [\"\"\"a\"\"\"\", ", Repeated("[", n), Repeated("]", n), "]\n");
     },
     15},
    {"BracketsNeverClosed", [](size_t n) { return absl::StrCat("x = ", Repeated("[", n)); }, 0},
};

class DeepenedTest : public ::testing::TestWithParam<Construct> {};

TEST_P(DeepenedTest, IsRefusedBeforeItTakesStack) {
  const Construct& construct = GetParam();
  OnSmallStack([&] {
    for (size_t depth = 1; depth <= (size_t{1} << 18); depth = depth < 40 ? depth + 1 : depth * 2) {
      const absl::StatusOr<toml::table> table = ParseToml(construct.text(depth), "a.toml");
      EXPECT_EQ(table.ok(), depth <= construct.most) << depth << ": " << table.status();
    }
  });
}

INSTANTIATE_TEST_SUITE_P(ParseToml, DeepenedTest, ::testing::ValuesIn(kConstructs),
                         [](const auto& instance) { return std::string(instance.param.name); });

}  // namespace
}  // namespace voxeld
