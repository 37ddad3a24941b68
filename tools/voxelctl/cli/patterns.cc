#include "tools/voxelctl/cli/patterns.h"

namespace voxeld::voxelctl {

const Choices<v1::TestPattern>& Patterns() {
  static const Choices<v1::TestPattern> patterns = {
      {"axes", v1::TEST_PATTERN_AXES},       {"corners", v1::TEST_PATTERN_CORNERS},
      {"grid", v1::TEST_PATTERN_GRID},       {"ramp", v1::TEST_PATTERN_RAMP},
      {"white", v1::TEST_PATTERN_WHITE},     {"bars", v1::TEST_PATTERN_BARS},
      {"density", v1::TEST_PATTERN_DENSITY}, {"slices", v1::TEST_PATTERN_SLICES},
      {"posts", v1::TEST_PATTERN_POSTS},     {"frames", v1::TEST_PATTERN_FRAMES},
      {"none", v1::TEST_PATTERN_NONE}};
  return patterns;
}

std::vector<std::string> PatternNames() {
  std::vector<std::string> names;
  for (const auto& [name, pattern] : Patterns()) {
    if (pattern != v1::TEST_PATTERN_NONE) names.push_back(name);
  }
  return names;
}

}  // namespace voxeld::voxelctl
