#include "daemon/text/line_break.h"

#include <gtest/gtest.h>

#include <string>

namespace voxeld::text {
namespace {

// Letters are words of width 1, blanks are blanks; lines are returned with | between them.
std::string Broken(const std::string& text, double width) {
  std::vector<Word> words;
  for (size_t i = 0; i < text.size(); ++i) words.push_back({i, i + 1, 1, text[i] == ' '});
  std::string broken;
  for (const TextLine& line : BreakLines(words, width)) {
    if (!broken.empty()) broken += '|';
    for (size_t i = line.begin; i < line.end; ++i) broken += text[i];
  }
  return broken;
}

TEST(BreakLines, AsManyWordsAsFit) {
  EXPECT_EQ(Broken("a b c", 0), "a b c");
  EXPECT_EQ(Broken("a b c", 3), "a b|c");
  EXPECT_EQ(Broken("a b c", 2.5), "a|b|c");
  EXPECT_EQ(Broken("a b c", 0.5), "a|b|c") << "a word that is too long has its own";
  EXPECT_EQ(Broken("  a   b  ", 10), "a   b");
  EXPECT_EQ(Broken("", 3), "");
  EXPECT_EQ(Broken("   ", 3), "");
}

}  // namespace
}  // namespace voxeld::text
