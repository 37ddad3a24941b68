// Tests the description of a command line: as a table, as a manual page, and in the errors for
// wrong ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <string>
#include <vector>

#include "daemon/usage/command_table.h"
#include "daemon/usage/man_page.h"
#include "daemon/usage/usage_error.h"

namespace voxeld::usage {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

class UsageTest : public testing::Test {
 protected:
  UsageTest() {
    app_.add_flag("-v,--verbose", verbose_, "Says \\more… it's \"all\"");
    app_.add_flag("--secret", verbose_, "")->group("");
    CLI::App* put = app_.add_subcommand(
        "put", "Puts it there: at once.\n.dotted line\n  prog put '-x'\nThe end.");
    put->add_option("FILE", files_, "What");
    put->add_option("--mode", mode_, "How")->type_name("fast|slow|TIME")->capture_default_str();
    put->add_option("--rate", rate_, "How often")->type_name("N");
    app_.add_subcommand("__hidden", "")->group("");
    app_.require_subcommand(0, 1);
  }

  std::string Explain(std::vector<std::string> words) {
    std::reverse(words.begin(), words.end());
    try {
      app_.parse(words);
    } catch (const CLI::Error& error) {
      return ExplainError(error, {app_.get_subcommand("put"), &app_});
    }
    return "";
  }

  bool verbose_ = false;
  std::vector<std::string> files_;
  std::string mode_ = "fast";
  double rate_ = 1;
  CLI::App app_{"A program that puts things", "prog"};
};

TEST_F(UsageTest, TheTableHasWhatIsNotHidden) {
  const CommandEntry program = DescribeCommand(app_);
  EXPECT_EQ(program.name, "prog");
  ASSERT_EQ(program.options.size(), 2u);
  EXPECT_THAT(program.options[0].names, ElementsAre("-h", "--help"));
  EXPECT_THAT(program.options[1].names, ElementsAre("-v", "--verbose"));
  EXPECT_EQ(program.options[1].value, "");
  ASSERT_EQ(program.commands.size(), 1u);
  const CommandEntry& put = program.commands[0];
  EXPECT_EQ(put.name, "put");
  ASSERT_EQ(put.arguments.size(), 1u);
  EXPECT_EQ(put.arguments[0].argument, "FILE");
  EXPECT_TRUE(put.arguments[0].repeated);
  ASSERT_EQ(put.options.size(), 2u) << "help belongs to the program";
  EXPECT_EQ(put.options[0].value, "fast|slow|TIME");
  EXPECT_THAT(put.options[0].choices, ElementsAre("fast", "slow"));
  EXPECT_EQ(put.options[0].fallback, "fast");
  EXPECT_EQ(put.options[1].value, "N");
  EXPECT_THAT(put.options[1].choices, ElementsAre());
}

TEST_F(UsageTest, AManualPageIsAsciiAndEscaped) {
  ::setenv("SOURCE_DATE_EPOCH", "86400", 1);
  const CommandEntry program = DescribeCommand(app_);
  const std::string page = ManPage(program, {.source = "x 1", .see_also = {"other(8)"}});
  EXPECT_THAT(page, testing::StartsWith(".TH \"PROG\" \"1\" \"1970-01-02\" \"x 1\"\n.SH NAME\nprog "
                                        "\\- A program that puts things\n"));
  EXPECT_THAT(
      page,
      HasSubstr("\n\\fB\\-v\\fR, \\fB\\-\\-verbose\\fR\nSays \\emore\\[u2026] it\\(aqs \"all\"\n"));
  EXPECT_THAT(
      page,
      HasSubstr(".SH COMMANDS\n.TP\n\\fBput\\fR\nPuts it there: see \\fBprog\\-put\\fR(1)\n"));
  EXPECT_THAT(page, HasSubstr(".SH SEE ALSO\n\\fBother\\fR(8)\n"));
  EXPECT_THAT(page, Not(HasSubstr("secret")));
  const std::string put = ManPage(program.commands[0], {.source = "x 1", .program = "prog"});
  EXPECT_THAT(put, HasSubstr("prog\\-put \\- Puts it there\n"));
  EXPECT_THAT(put, HasSubstr("\\fBprog put\\fR [\\fIOPTION\\fR ...] \\fIFILE\\fR ...\n"));
  EXPECT_THAT(put, HasSubstr("\n\\&.dotted line\n.PP\n.nf\n.RS 4\nprog put "
                             "\\(aq\\-x\\(aq\n.RE\n.fi\n.PP\nThe end.\n"));
  EXPECT_THAT(put, HasSubstr("\\fB\\-\\-mode\\fR \\fIfast|slow|TIME\\fR\nHow (default: fast)\n"));
  for (const char c : page + put) EXPECT_TRUE(c == '\n' || (c >= ' ' && c <= '~')) << c;
}

TEST_F(UsageTest, ErrorsSayWhatWouldBeRight) {
  EXPECT_EQ(Explain({"put", "--mode"}), "--mode wants a value, fast|slow|TIME: How");
  EXPECT_EQ(Explain({"put", "a", "--rate", "often"}), "--rate is often; N is expected");
  EXPECT_EQ(Explain({"--verbose=maybe", "put"}), "--verbose is maybe; it takes no value");
  EXPECT_EQ(UnknownOption("--mdoe=3", {app_.get_subcommand("put"), &app_}),
            "--mdoe is no option here; did you mean --mode?");
  EXPECT_THAT(UnknownOption("--xyzzy", {&app_}), HasSubstr("known are --help, --verbose"));
}

}  // namespace
}  // namespace voxeld::usage
