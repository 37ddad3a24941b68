#include "tools/voxelctl/cli/argument_checks.h"

#include <filesystem>

#include "absl/algorithm/container.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"

namespace voxeld::voxelctl {

void CheckRange(const char* option, double value, double least, double most) {
  if (value >= least && value <= most) return;
  throw UsageError{absl::StrCat(option, " is ", value, "; ", least, " to ", most, " is expected")};
}

void WantNumber(CLI::Option* option, double least, double most) {
  option->check([option, least, most](const std::string& text) {
    double value = 0;
    const bool spaced = text != absl::StripAsciiWhitespace(text);
    if (!spaced && absl::SimpleAtod(text, &value) && value >= least && value <= most) return "";
    throw UsageError{absl::StrCat(option->get_name(), " is ", EscapeForTerminal(text),
                                  "; a number from ", least, " to ", most, " is expected")};
  });
}

void AddNumber(CLI::App* command, const char* name, double* value, double least, double most,
               const char* about, const char* unit) {
  CLI::Option* option = command->add_option(name, *value, about);
  option->type_name(unit)->capture_default_str();
  WantNumber(option, least, most);
}

void AddFilter(CLI::App* command, std::string* layer, uint64_t* owner) {
  command->add_option("--layer", *layer, "Only this layer's")->type_name("NAME");
  command->add_option("--owner", *owner, "Only this owner's")
      ->type_name("N")
      ->check([](const std::string& text) {
        uint64_t number = 0;
        const bool plain =
            absl::c_all_of(text, absl::ascii_isdigit) && !absl::StartsWith(text, "0");
        if (plain && absl::SimpleAtoi(text, &number)) return "";
        throw UsageError{absl::StrCat("--owner is ", EscapeForTerminal(text),
                                      "; an owner's number is expected, such as 7 (voxelctl "
                                      "entities lists them)")};
      });
}

void CheckPictureName(const std::string& file) {
  std::filesystem::path path(file);
  const std::string extension = path.extension().string();
  if (extension.empty() || absl::EqualsIgnoreCase(extension, ".png")) return;
  throw UsageError{absl::StrCat("the picture's name ", EscapeForTerminal(file), " ends in ",
                                EscapeForTerminal(extension), "; snapshot writes PNG: name it ",
                                EscapeForTerminal(path.replace_extension(".png").string()))};
}

}  // namespace voxeld::voxelctl
