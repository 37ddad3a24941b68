// What a device says of itself: refused with a reason, or a geometry that says itself again.

#include <cstdint>
#include <span>
#include <vector>

#include "display/drivers/voxlink/capabilities.h"
#include "tests/fuzz/exchanges.h"
#include "tests/fuzz/expect.h"

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
  return 0;
}
