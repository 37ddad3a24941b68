// A device's description of itself: refused with a reason, or a geometry that is the same when it
// is encoded and read again.

#include <cstdint>
#include <span>
#include <vector>

#include "display/drivers/voxlink/capabilities.h"
#include "tests/fuzz/exchanges.h"
#include "tests/fuzz/expect.h"

namespace voxeld::fuzz {
namespace {

namespace voxlink = display::voxlink;

// Checks displays that are configured differently from the device.
void CheckOthers(const voxlink::DeviceCapabilities& device, display::Geometry geometry,
                 const display::FrameLayout& layout) {
  const auto refused = [&](const display::Geometry& other, const display::FrameLayout& with) {
    const absl::Status status = voxlink::CheckCapabilities(device, other, with);
    EXPECT_THAT_HOLDS(absl::IsFailedPrecondition(status), status.ToString());
    ExpectSays(status);
  };
  display::FrameLayout other = layout;
  ++other.width;
  refused(geometry, other);
  other = layout;
  other.sub_frames = device.fixed.max_sub_frames + 1;
  refused(geometry, other);
  other.sub_frames = device.fixed.max_sub_frames;
  for (const auto format : {display::PixelFormat::kRgb888, display::PixelFormat::kHub75}) {
    other.format = format;
    ExpectSays(voxlink::CheckCapabilities(device, geometry, other));
  }
  if (auto* const planar = std::get_if<display::PlanarStack>(&geometry.shape)) {
    planar->pitch_u_mm *= 2;
  } else if (auto* const lattice = std::get_if<display::Lattice>(&geometry.shape)) {
    lattice->cell_mm.x *= 2;
  } else if (auto* const helix = std::get_if<display::Helix>(&geometry.shape)) {
    helix->pitch_u_mm *= 2;
  } else {
    std::get<display::Rotor>(geometry.shape).panels.front().pitch_u_mm *= 2;
  }
  refused(geometry, layout);
}

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxeld;  // NOLINT(google-build-using-namespace)
  namespace voxlink = display::voxlink;
  const auto block = std::as_bytes(std::span(data, size));
  const absl::StatusOr<voxlink::DeviceCapabilities> read = voxlink::ParseCapabilities(block);
  fuzz::CountExchange(fuzz::ExchangeKind::kCapabilityBlock, read.ok());
  if (!read.ok()) {
    fuzz::ExpectSays(read.status());
    return 0;
  }
  const std::vector<std::byte> written = voxlink::EncodeCapabilities(*read);
  const absl::StatusOr<voxlink::DeviceCapabilities> again = voxlink::ParseCapabilities(written);
  EXPECT_THAT_HOLDS(again.ok(), again.status().ToString());
  EXPECT_THAT_HOLDS(voxlink::EncodeCapabilities(*again) == written);
  display::FrameLayout layout;
  layout.slices = static_cast<int32_t>(read->fixed.slices);
  layout.width = static_cast<int32_t>(read->fixed.width);
  layout.height = static_cast<int32_t>(read->fixed.height);
  fuzz::ExpectSays(voxlink::CheckCapabilities(*read, again->geometry, layout));
  fuzz::ExpectSays(voxlink::CheckCapabilities(*read, again->geometry, layout, true));
  fuzz::CheckOthers(*read, again->geometry, layout);
  return 0;
}
