// Colours as the wire has them: rows of them, by names or one by one.
#pragma once

#include <google/protobuf/repeated_field.h>

#include <cstdint>
#include <optional>

#include "daemon/colormaps/colormaps.h"
#include "daemon/wire/check.h"

namespace voxeld::daemon::wire {

// One of the two, fields `colormap` and `colors` of `path`: a map, which is found then, or colours, each 0xRRGGBB.
MaybeFault ToColorRow(const FieldPath& path, const std::string& colormap,
                      const google::protobuf::RepeatedField<uint32_t>& colors,
                      std::optional<ColorTable>* map);

}  // namespace voxeld::daemon::wire
