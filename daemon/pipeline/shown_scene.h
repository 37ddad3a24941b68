// What a volume was drawn from, beside what became of it. Words only.
#pragma once

#include "daemon/scene/snapshot.h"
#include "display/api/display.h"
#include "display/api/slice_frame.h"
#include "gpu/affine.h"

namespace voxeld::daemon {

struct DrawnFrom {
  SnapshotPtr scene;  // of a test pattern: the pattern's own
  gpu::Affine scene_to_voxel;
  display::Tone tone;  // with what the picture was dimmed by
};

struct ShownScene {
  display::DecodedVolume volume;  // as the display shows it
  DrawnFrom from;
};

}  // namespace voxeld::daemon
