#include "daemon/usage/man_page.h"

#include <cstdlib>
#include <ctime>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"

namespace voxeld::usage {
namespace {

constexpr size_t kLine = 78;

// Removes the first code point from well-formed UTF-8 text and returns it.
uint32_t TakeCodePoint(absl::string_view* text) {
  const auto first = static_cast<unsigned char>(text->front());
  const size_t length = first < 0x80 ? 1 : first < 0xe0 ? 2 : first < 0xf0 ? 3 : 4;
  uint32_t code = length == 1 ? first : first & (0x7f >> length);
  for (size_t i = 1; i < length && i < text->size(); ++i) {
    code = code << 6 | (static_cast<unsigned char>((*text)[i]) & 0x3f);
  }
  text->remove_prefix(std::min(length, text->size()));
  return code;
}

// Escapes text for roff.
std::string Roff(absl::string_view text) {
  std::string out;
  while (!text.empty()) {
    const uint32_t code = TakeCodePoint(&text);
    switch (code) {
      case '\\':
        out += "\\e";
        break;
      case '-':
        out += "\\-";
        break;
      case '\'':
        out += "\\(aq";
        break;
      case '`':
        out += "\\(ga";
        break;
      case '^':
        out += "\\(ha";
        break;
      case '~':
        out += "\\(ti";
        break;
      default:
        if (code < 0x80) {
          out += static_cast<char>(code);
        } else {
          absl::StrAppendFormat(&out, "\\[u%04X]", code);
        }
    }
  }
  // roff would interpret a line that begins with a dot as a request.
  return absl::StartsWith(out, ".") ? absl::StrCat("\\&", out) : out;
}

// Wraps text into lines of moderate length, each with a newline. roff decides on the final layout.
std::string Filled(absl::string_view roff) {
  std::string out;
  size_t length = 0;
  for (const absl::string_view word : absl::StrSplit(roff, ' ', absl::SkipEmpty())) {
    const bool begins = length == 0 || length + 1 + word.size() > kLine;
    if (begins && length > 0) out += '\n';
    if (begins) length = 0;
    const bool request = begins && word.front() == '.';
    absl::StrAppend(&out, begins ? "" : " ", request ? "\\&" : "", word);
    length += word.size() + (begins ? 0 : 1);
  }
  return out + "\n";
}

std::string Quoted(absl::string_view text) {
  return absl::StrCat("\"", absl::StrJoin(absl::StrSplit(Roff(text), '"'), "\\(dq"), "\"");
}

std::string Bold(absl::string_view text) { return absl::StrCat("\\fB", Roff(text), "\\fR"); }
std::string Italic(absl::string_view text) { return absl::StrCat("\\fI", Roff(text), "\\fR"); }

// Joins lines to paragraphs; lines that begin with two spaces stay as they are.
std::string Paragraphs(absl::string_view text) {
  std::string out;
  bool example = false;
  for (const absl::string_view line : absl::StrSplit(text, '\n')) {
    if (absl::StripAsciiWhitespace(line).empty()) continue;
    const bool is_example = absl::StartsWith(line, "  ");
    if (is_example != example) out += is_example ? ".PP\n.nf\n.RS 4\n" : ".RE\n.fi\n.PP\n";
    example = is_example;
    if (is_example) {
      absl::StrAppend(&out, Roff(line.substr(2)), "\n");
    } else {
      out += Filled(Roff(line));
    }
  }
  if (example) out += ".RE\n.fi\n";
  return out;
}

std::string Sections(const std::vector<std::pair<std::string, std::string>>& sections) {
  std::string out;
  for (const auto& [heading, text] : sections) {
    absl::StrAppend(&out, ".SH ", Quoted(heading), "\n");
    for (const absl::string_view line : absl::StrSplit(text, '\n', absl::SkipEmpty())) {
      const std::pair<absl::string_view, absl::string_view> entry =
          absl::StrSplit(line, absl::MaxSplits('\t', 1));
      if (absl::StrContains(line, '\t')) {
        absl::StrAppend(&out, ".TP\n", Bold(entry.first), "\n", Filled(Roff(entry.second)));
      } else {
        out += Filled(Roff(line));
      }
    }
  }
  return out;
}

// Returns: the beginning of the description, for NAME: up to the end of the first line, sentence or
// clause.
std::string Summary(const CommandEntry& command) {
  std::string first = command.about.substr(0, command.about.find('\n'));
  for (const char* end : {". ", ": ", "; "}) first = first.substr(0, first.find(end));
  while (absl::EndsWith(first, ".") || absl::EndsWith(first, ":")) first.pop_back();
  return first;
}

std::string Entries(const std::vector<OptionEntry>& options) {
  std::string out;
  for (const OptionEntry& option : options) {
    std::vector<std::string> names;
    names.reserve(option.names.size() + 1);
    for (const std::string& name : option.names) names.push_back(Bold(name));
    if (names.empty()) names.push_back(Italic(option.argument));
    absl::StrAppend(&out, ".TP\n", absl::StrJoin(names, ", "));
    if (!option.names.empty() && !option.value.empty()) {
      absl::StrAppend(&out, " ", Italic(option.value));
    }
    std::string about = option.about;
    if (option.names.empty() && !option.choices.empty()) {
      absl::StrAppend(&about, ": ", absl::StrJoin(option.choices, ", "));
    }
    if (!option.fallback.empty()) absl::StrAppend(&about, " (default: ", option.fallback, ")");
    if (about.empty()) about = "As it says.";
    absl::StrAppend(&out, "\n", Filled(Roff(absl::StrJoin(absl::StrSplit(about, '\n'), " "))));
  }
  return out;
}

std::string Date() {
  std::time_t seconds = std::time(nullptr);
  int64_t epoch = 0;
  if (const char* text = std::getenv("SOURCE_DATE_EPOCH");
      text != nullptr && absl::SimpleAtoi(text, &epoch)) {
    seconds = static_cast<std::time_t>(epoch);
  }
  std::tm date = {};
  ::gmtime_r(&seconds, &date);
  return absl::StrFormat("%04d-%02d-%02d", date.tm_year + 1900, date.tm_mon + 1, date.tm_mday);
}

}  // namespace

std::string ManPage(const CommandEntry& command, const ManualInfo& info) {
  const std::string name =
      info.program.empty() ? command.name : absl::StrCat(info.program, "-", command.name);
  std::string out = absl::StrCat(
      ".TH ", Quoted(absl::AsciiStrToUpper(name)), " ", Quoted(info.section), " ",
      absl::StrCat("\"", Date(), "\""), " ", Quoted(info.source), "\n.SH NAME\n",
      Filled(absl::StrCat(Roff(name), " \\- ", Roff(Summary(command)))), ".SH SYNOPSIS\n",
      info.program.empty() ? Bold(name) : Bold(absl::StrCat(info.program, " ", command.name)), " [",
      Italic("OPTION"), " ...]");
  if (!command.commands.empty()) {
    absl::StrAppend(&out, " ", Italic("COMMAND"), " [", Italic("ARGUMENT"), " ...]");
  }
  for (const OptionEntry& argument : command.arguments) {
    absl::StrAppend(&out, " ", Italic(argument.argument), argument.repeated ? " ..." : "");
  }
  absl::StrAppend(&out, "\n.SH DESCRIPTION\n", Paragraphs(command.about));
  if (info.program.empty() && !command.footer.empty()) {
    absl::StrAppend(&out, ".PP\n", Paragraphs(command.footer));
  }
  if (!command.arguments.empty()) {
    absl::StrAppend(&out, ".SH ARGUMENTS\n", Entries(command.arguments));
  }
  if (!command.commands.empty()) {
    absl::StrAppend(&out, ".SH COMMANDS\n");
    for (const CommandEntry& each : command.commands) {
      absl::StrAppend(&out, ".TP\n", Bold(each.name), "\n",
                      Filled(absl::StrCat(Roff(Summary(each)), ": see ",
                                          Bold(absl::StrCat(name, "-", each.name)), "(",
                                          Roff(info.section), ")")));
    }
  }
  if (!command.options.empty()) absl::StrAppend(&out, ".SH OPTIONS\n", Entries(command.options));
  absl::StrAppend(&out, Sections(info.sections));
  if (!info.see_also.empty()) {
    std::vector<std::string> pages;
    for (const std::string& page : info.see_also) {
      const size_t bracket = page.find('(');
      pages.push_back(absl::StrCat(Bold(page.substr(0, bracket)), Roff(page.substr(bracket))));
    }
    absl::StrAppend(&out, ".SH SEE ALSO\n", absl::StrJoin(pages, ",\n"), "\n");
  }
  return out;
}

}  // namespace voxeld::usage
