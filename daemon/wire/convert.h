// Converts values of the core and the displays to the protocol and back. The reverse direction, for
// clients and for requests, validates.
#pragma once

#include "absl/status/statusor.h"
#include "daemon/core/core.h"
#include "daemon/geometry_wire/geometry_wire.h"
#include "daemon/scene/operation.h"
#include "display/api/display.h"
#include "voxeld/v1/display.pb.h"
#include "voxeld/v1/scene.pb.h"
#include "voxeld/v1/types.pb.h"

namespace voxeld::daemon::wire {

v1::Reason ToWire(Reason reason);
v1::BlendMode ToWire(gpu::BlendMode blend);
v1::Evidence ToWire(display::Evidence evidence);
v1::NotShown::Why ToWire(CommitOutcome::NotShown why);
v1::DisplayState ToWire(display::DisplayState state);
v1::SweepLock ToWire(sync::SweepLock::State state);
v1::PixelFormat ToWire(display::PixelFormat format);
v1::TestPattern ToWire(TestPattern pattern);
v1::VolumeHeader::Source ToWire(display::DecodedVolume::Source source);

void ToWire(const gpu::Affine& in, v1::Affine* out);  // always 12 values
void ToWire(const Clip& in, v1::Clip* out);
void ToWire(const gpu::Region& in, v1::Box3* out);
void ToWire(const display::FrameLayout& in, v1::FrameLayout* out);
void ToWire(const ViewOptions& in, v1::View* out);

// Errors: InvalidArgument for unknown values. Does not check whether a geometry is consistent
// (display/geometry does).
absl::StatusOr<Reason> FromWire(v1::Reason reason);
absl::StatusOr<gpu::BlendMode> FromWire(v1::BlendMode blend);
absl::StatusOr<display::Evidence> FromWire(v1::Evidence evidence);
absl::StatusOr<CommitOutcome::NotShown> FromWire(v1::NotShown::Why why);
absl::StatusOr<display::DisplayState> FromWire(v1::DisplayState state);
absl::StatusOr<display::PixelFormat> FromWire(v1::PixelFormat format);
absl::StatusOr<TestPattern> FromWire(v1::TestPattern pattern);
absl::StatusOr<display::DecodedVolume::Source> FromWire(v1::VolumeHeader::Source source);

absl::StatusOr<display::FrameLayout> FromWire(const v1::FrameLayout& in);
absl::StatusOr<ViewOptions> FromWire(const v1::View& in);
absl::StatusOr<DisplayUpdate> FromWire(const v1::UpdateDisplayRequest& in);
OwnerControl FromWire(const v1::ControlOwnerRequest& in);

}  // namespace voxeld::daemon::wire
