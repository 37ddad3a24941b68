// Reads rows of colours, by the name of a map or as a list.
#pragma once

#include <google/protobuf/repeated_field.h>

#include <cstdint>
#include <optional>

#include "daemon/colormaps/colormaps.h"
#include "daemon/wire/check.h"

namespace voxeld::daemon::wire {

// Reads either the field `colormap` or the field `colors` (each 0xRRGGBB) of `path`. A map is
// looked up and stored in the output.
MaybeFault ToColorRow(const FieldPath& path, const std::string& colormap,
                      const google::protobuf::RepeatedField<uint32_t>& colors,
                      std::optional<ColorTable>* map);

}  // namespace voxeld::daemon::wire
