#include "daemon/wire/colors.h"

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::wire {

MaybeFault ToColorRow(const FieldPath& path, const std::string& colormap,
                      const google::protobuf::RepeatedField<uint32_t>& colors,
                      std::optional<ColorTable>* map) {
  const FieldPath name(path, "colormap");
  if (colormap.empty() == colors.empty()) {
    return Fault{name.ToString(), Reason::kInvalidValue,
                 colormap.empty() ? "is empty, and so is colors; give one of the two"
                                  : "is given, and so is colors; give one of the two"};
  }
  for (int i = 0; i < colors.size(); ++i) {
    if (colors[i] <= 0xFFFFFF) continue;
    return Fault{FieldPath(path, "colors", i).ToString(), Reason::kInvalidValue,
                 absl::StrCat("is 0x", absl::Hex(colors[i]), "; give 0xRRGGBB, at most 0xffffff")};
  }
  if (colormap.empty()) return {};
  *map = FindColormap(colormap);
  if (map->has_value()) return {};
  return Fault{name.ToString(), Reason::kNotFound,
               absl::StrCat("is ", Quote(colormap), ", which is none; ", ColormapAdvice(colormap))};
}

}  // namespace voxeld::daemon::wire
