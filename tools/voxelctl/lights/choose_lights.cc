#include "tools/voxelctl/lights/choose_lights.h"

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"

namespace voxeld::voxelctl {
namespace {

constexpr uintmax_t kMostLayoutBytes = 64 << 20;

absl::StatusOr<std::string> ReadLayout(const std::string& path) {
  std::error_code error;
  const uintmax_t bytes = std::filesystem::file_size(path, error);
  if (!error && bytes > kMostLayoutBytes) {
    return absl::InvalidArgumentError(absl::StrCat(EscapeForTerminal(path), ": ", bytes,
                                                   " bytes; a layout has ", kMostLayoutBytes,
                                                   " at most"));
  }
  std::ostringstream text;
  std::ifstream file(path, std::ios::binary);
  if (error || !(text << file.rdbuf())) {
    return absl::NotFoundError(absl::StrCat(EscapeForTerminal(path), ": cannot be read"));
  }
  return std::move(text).str();
}

}  // namespace

absl::StatusOr<LightMap> ChooseLights(const LightsOptions& options, Connection& connection) {
  const absl::StatusOr<v1::ListDisplaysResponse> all = connection.ListDisplays();
  if (!all.ok()) return all.status();
  const v1::DisplayDescription* chosen = nullptr;
  std::vector<std::string> names;
  for (const v1::DisplayDescription& display : all->displays()) {
    names.push_back(EscapeForTerminal(display.name()));
    if (chosen == nullptr && (options.display.empty() || display.name() == options.display)) {
      chosen = &display;
    }
  }
  if (chosen == nullptr) {
    return absl::NotFoundError(
        names.empty() ? "the server has no display whose lights could be lit"
                      : absl::StrCat("there is no display \"", EscapeForTerminal(options.display),
                                     "\"; there are ", absl::StrJoin(names, ", ")));
  }
  if (options.size.has_value()) return LightsInBox(*options.size, *chosen);
  if (options.layout.empty()) return LightsOf(*chosen);
  const absl::StatusOr<std::string> text = ReadLayout(options.layout);
  if (!text.ok()) return text.status();
  absl::StatusOr<LightMap> map = LightsOfLayout(*text, *chosen);
  if (absl::IsInvalidArgument(map.status())) {
    return absl::InvalidArgumentError(absl::StrCat(EscapeForTerminal(options.layout), ": ",
                                                   EscapeForTerminal(map.status().message())));
  }
  return map;
}

}  // namespace voxeld::voxelctl
