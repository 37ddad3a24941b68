// Tests that text from untrusted sources is made safe to print.
#include "common/text/printable.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"

namespace voxeld {
namespace {

// An encoder that is independent of the tested code.
std::string Utf8(uint32_t code) {
  std::string out;
  if (code < 0x80) {
    out += static_cast<char>(code);
  } else if (code < 0x800) {
    out += static_cast<char>(0xc0 | code >> 6);
    out += static_cast<char>(0x80 | (code & 0x3f));
  } else {
    out += static_cast<char>(0xe0 | code >> 12);
    out += static_cast<char>(0x80 | (code >> 6 & 0x3f));
    out += static_cast<char>(0x80 | (code & 0x3f));
  }
  return out;
}

// Every control of Unicode below U+3000, the separators of lines and paragraphs, and the marks of category Cf that terminals obey.
std::vector<uint32_t> HarmfulCodes() {
  std::vector<uint32_t> codes;
  for (uint32_t code = 0; code < 0x20; ++code) codes.push_back(code);
  for (uint32_t code = 0x7f; code < 0xa0; ++code) codes.push_back(code);
  for (const uint32_t code :
       {0x061cu, 0x200bu, 0x200cu, 0x200du, 0x200eu, 0x200fu, 0x2028u, 0x2029u, 0x202au, 0x202bu,
        0x202cu, 0x202du, 0x202eu, 0x2066u, 0x2067u, 0x2068u, 0x2069u, 0xfeffu}) {
    codes.push_back(code);
  }
  return codes;
}

TEST(EscapeForTerminal, LeavesOrdinaryTextAlone) {
  EXPECT_EQ(EscapeForTerminal("Grüße, 体積 ✓"), "Grüße, 体積 ✓");
}

TEST(EscapeForTerminal, EscapesControlsAndWhatIsNotUtf8) {
  EXPECT_EQ(EscapeForTerminal("\x1b]0;title\x07"), "\\u{1b}]0;title\\u{7}");
  EXPECT_EQ(EscapeForTerminal("a\nb\tc\\"), "a\\u{a}b\\u{9}c\\\\");
  EXPECT_EQ(EscapeForTerminal("\xc2\x9b"
                              "31m"),
            "\\u{9b}31m");  // C1 CSI
  EXPECT_EQ(EscapeForTerminal("\xe2\x80\xae"
                              "gnp"),
            "\\u{202e}gnp");                                        // right-to-left override
  EXPECT_EQ(EscapeForTerminal("\xff\xfe"), "\\xff\\xfe");           // never UTF-8
  EXPECT_EQ(EscapeForTerminal("\xe2\x82"), "\\xe2\\x82");           // truncated
  EXPECT_EQ(EscapeForTerminal("\xc0\xaf"), "\\xc0\\xaf");           // overlong
  EXPECT_EQ(EscapeForTerminal("\xed\xa0\x80"), "\\xed\\xa0\\x80");  // a surrogate
  EXPECT_EQ(EscapeForTerminal(absl::string_view("\0x", 2)), "\\u{0}x");
}

TEST(Escape, LeavesNoHarmfulCharacterInAnyForm) {
  for (const uint32_t code : HarmfulCodes()) {
    const std::string raw = Utf8(code), text = absl::StrCat("a", raw, "b");
    EXPECT_EQ(EscapeForTerminal(text).find(raw), std::string::npos) << code;
    EXPECT_EQ(EscapeQuoted(text).find(raw), std::string::npos) << code;
    EXPECT_EQ(EscapeControls(text).find(raw), std::string::npos) << code;
    if (code != '\n') {
      EXPECT_EQ(EscapeLines(text).find(raw), std::string::npos) << code;
    }
    // C0 controls never occur in JSON text except as white space between its parts.
    if (code >= 0x7f) {
      EXPECT_EQ(EscapeJson(text).find(raw), std::string::npos) << code;
    }
  }
}

TEST(EscapeControls, LeavesTextThatIsEscapedAsItIs) {
  for (const std::string& once :
       {EscapeForTerminal("\x1b[31m\\ \xff"), EscapeQuoted("\"\n\t\x9b\\")}) {
    EXPECT_EQ(EscapeControls(once), once);
  }
  EXPECT_EQ(EscapeControls("two\nlines\x1b"), "two\\x0alines\\x1b");
  EXPECT_EQ(EscapeLines("two\nlines\x1b"), "two\nlines\\x1b");
}

TEST(EscapeQuoted, EscapesQuotesAndWhiteSpaceAsInC) {
  EXPECT_EQ(EscapeQuoted("say \"hi\"\\\r\n\t."), "say \\\"hi\\\"\\\\\\r\\n\\t.");
  EXPECT_EQ(EscapeQuoted("Grüße"), "Grüße");
  EXPECT_EQ(EscapeQuoted("\x01\x7f\xc2\x9b"), "\\x01\\x7f\\u{9b}");
}

TEST(EscapeJson, KeepsTheDocument) {
  EXPECT_EQ(EscapeJson("{\"a\":\"\xc2\x9b \xe2\x80\xa8 \\n ü\"}\n"),
            "{\"a\":\"\\u009b \\u2028 \\n ü\"}\n");
}

TEST(IsUtf8, JudgesTheWholeText) {
  for (const char* text : {"", "a", "Grüße, 体積 ✓", "\xf4\x8f\xbf\xbf"})
    EXPECT_TRUE(IsUtf8(text)) << text;
  for (const char* text :
       {"\xff", "a\xe2\x82", "\xc0\x80", "\xed\xa0\x80", "\xf4\x90\x80\x80", "\x80 a"}) {
    EXPECT_FALSE(IsUtf8(text));
  }
}

}  // namespace
}  // namespace voxeld
