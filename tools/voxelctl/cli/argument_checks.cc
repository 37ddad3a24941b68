#include "tools/voxelctl/cli/argument_checks.h"

#include <filesystem>

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

void CheckPictureName(const std::string& file) {
  std::filesystem::path path(file);
  const std::string extension = path.extension().string();
  if (extension.empty() || absl::EqualsIgnoreCase(extension, ".png")) return;
  throw UsageError{absl::StrCat("the picture's name ", EscapeForTerminal(file), " ends in ",
                                EscapeForTerminal(extension), "; snapshot writes PNG: name it ",
                                EscapeForTerminal(path.replace_extension(".png").string()))};
}

}  // namespace voxeld::voxelctl
