// Session's requests.
#include <algorithm>

#include "display/drivers/voxlink/verify/session.h"

namespace voxeld::display::voxlink {

using conformance::Answer;

namespace {

// Returns the name in §4, such as "GET_STATUS".
const char* RequestName(Request request) {
  switch (request) {
    case Request::kGetCapabilities:
      return "GET_CAPABILITIES";
    case Request::kGetStatus:
      return "GET_STATUS";
    case Request::kSetMode:
      return "SET_MODE";
    case Request::kGetMode:
      return "GET_MODE";
    case Request::kStart:
      return "START";
    case Request::kStop:
      return "STOP";
    case Request::kSetBrightness:
      return "SET_BRIGHTNESS";
    case Request::kSetPowerLimit:
      return "SET_POWER_LIMIT";
    case Request::kSetBlank:
      return "SET_BLANK";
  }
  return "a request";
}

}  // namespace

UsbSetup Session::Setup(Request request, uint16_t value, uint16_t length, bool in) {
  return {.request_type = in ? kRequestIn : kRequestOut,
          .request = static_cast<uint8_t>(request),
          .value = value,
          .index = 0,
          .length = length};
}

Answer Session::Get(Request request, uint16_t value, uint16_t length) {
  return probe_.In(Setup(request, value, length, true));
}

Answer Session::Put(Request request, uint16_t value, std::span<const std::byte> data) {
  return probe_.Out(Setup(request, value, static_cast<uint16_t>(data.size()), false), data);
}

void Session::Do(Request request, uint16_t value, std::span<const std::byte> data) {
  if (!ok()) return;
  const Answer answer = Put(request, value, data);
  if (answer.ok()) return;
  check().Fail(absl::StrCat(RequestName(request), " with value ", value, " is done"),
               Describe(answer), "4");
}

void Session::MustStall(const std::string& what, const UsbSetup& setup,
                        std::span<const std::byte> data) {
  if (!ok()) return;
  const bool in = (setup.request_type & 0x80) != 0;
  const Answer answer = in ? probe_.In(setup) : probe_.Out(setup, data);
  check().Expect(answer.status == TransferStatus::kStall, absl::StrCat(what, " is stalled"),
                 Describe(answer));
  const Answer next = Get(Request::kGetStatus, 0, sizeof(Status));
  check().Expect(next.ok(), absl::StrCat("GET_STATUS is answered after ", what, " was stalled"),
                 Describe(next));
}

Status Session::GetStatus() {
  if (!ok()) return {};
  // Request one byte more than expected, so that a longer answer is noticed; a later minor version
  // may add some.
  const Answer answer = Get(Request::kGetStatus, 0, sizeof(Status));
  if (!answer.ok() || answer.data.size() < sizeof(Status)) {
    check().Fail("GET_STATUS gives 80 bytes", Describe(answer), "4.4");
    return {};
  }
  const auto status = Load<Status>(answer.data);
  if (status.running > 1) {
    check().Fail("running is 0 or 1", absl::StrCat(int{status.running}), "4.4");
  }
  if (status.credit_limit > credit_limit_) credit_limit_ = status.credit_limit;
  return status;
}

Mode Session::GetMode() {
  if (!ok()) return {};
  const Answer answer = Get(Request::kGetMode, 0, sizeof(Mode));
  if (!answer.ok() || answer.data.size() != sizeof(Mode)) {
    check().Fail("GET_MODE gives 16 bytes", Describe(answer), "4.3");
    return {};
  }
  return Load<Mode>(answer.data);
}

const std::vector<std::byte>& Session::CapabilityBytes() {
  if (block_) return *block_;
  block_.emplace();
  size_t total = sizeof(Capabilities);
  while (ok() && block_->size() < total) {
    const auto page = static_cast<uint16_t>(block_->size() / kCapabilitiesPage);
    const Answer answer = Get(Request::kGetCapabilities, page, kCapabilitiesPage);
    if (!answer.ok() || answer.data.empty()) {
      check().Fail(absl::StrCat("GET_CAPABILITIES gives page ", page), Describe(answer), "4.1");
      break;
    }
    if (page == 0) {
      if (answer.data.size() < sizeof(Capabilities)) {
        check().Fail("page 0 of the capabilities has 64 bytes or more", Describe(answer), "4.1");
        break;
      }
      total = Load<Capabilities>(answer.data).total_length;
      if (total > kMaxCapabilities || total < sizeof(Capabilities)) {
        check().Fail("total_length is from 64 to 2^20", absl::StrCat(total), "4.1");
        break;
      }
    }
    AppendBytes(*block_, answer.data);
    if (block_->size() < total && answer.data.size() != kCapabilitiesPage) {
      check().Fail(absl::StrCat("page ", page, ", which is not the last, has 4096 bytes"),
                   Describe(answer), "4.1");
    }
  }
  return *block_;
}

const DeviceCapabilities& Session::capabilities() {
  if (capabilities_) return *capabilities_;
  capabilities_.emplace();
  const std::vector<std::byte>& block = CapabilityBytes();
  if (!ok()) return *capabilities_;
  absl::StatusOr<DeviceCapabilities> parsed = ParseCapabilities(block);
  if (parsed.ok()) {
    capabilities_ = *std::move(parsed);
  } else {
    check().Fail("capabilities that are sound", std::string(parsed.status().message()), "4.1");
  }
  return *capabilities_;
}

FrameLayout Session::LayoutOf(const Mode& mode) {
  const Capabilities& fixed = capabilities().fixed;
  return {.slices = static_cast<int32_t>(fixed.slices),
          .width = static_cast<int32_t>(fixed.width),
          .height = static_cast<int32_t>(fixed.height),
          .sub_frames = mode.sub_frames,
          .format = static_cast<PixelFormat>(mode.format),
          .bits = mode.bits};
}

Mode Session::SmallestMode() {
  std::optional<Mode> best;
  for (uint8_t format = 0; format < kPixelFormats; ++format) {
    if ((capabilities().fixed.formats >> format & 1) == 0) continue;
    const Mode mode{.format = format, .sub_frames = 1};
    if (!best || LayoutOf(mode).bytes() < LayoutOf(*best).bytes()) best = mode;
  }
  if (!best && ok())
    check().NotApplicable("the device has none of the pixel formats of voxlink 1.0");
  return best.value_or(Mode{.format = 0, .sub_frames = 1});
}

absl::Status BringToRest(conformance::Probe& probe) {
  const auto put = [&](Request request, uint16_t value, std::span<const std::byte> data = {}) {
    return probe.Out(Session::Setup(request, value, static_cast<uint16_t>(data.size()), false),
                     data);
  };
  // Sent before the first request of a case, so that the case's own requests show what is wrong.
  const Answer stopped = put(Request::kStop, 0);
  probe.ClearHalt(kBulkOut);
  probe.ClearHalt(kInterruptIn);
  put(Request::kSetBlank, 0);
  put(Request::kSetBrightness, 65535);
  put(Request::kSetPowerLimit, 0, BytesOf(uint32_t{0}));
  if (stopped.ok()) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat("STOP: ", Describe(stopped)));
}

}  // namespace voxeld::display::voxlink
