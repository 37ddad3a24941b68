#include "display/emulator/carriers/model_facts.h"

#include <span>

namespace voxeld::display::emulator {
namespace {

constexpr uint16_t kDevice = 0x0100, kConfiguration = 0x0200, kString = 0x0300;
constexpr uint16_t kEnglish = 0x0409;

std::vector<std::byte> Descriptor(UsbDeviceModel& model, uint16_t value, uint16_t index) {
  std::vector<std::byte> answer;
  model.SetComplete(
      [&answer](uint64_t, TransferStatus status, uint32_t, std::span<const std::byte> in) {
        if (status == TransferStatus::kOk || status == TransferStatus::kShort) {
          answer.assign(in.begin(), in.end());
        }
      });
  Urb urb;
  urb.setup = {.request_type = 0x80, .request = 6, .value = value, .index = index, .length = 4096};
  urb.length = urb.setup.length;
  model.Submit(urb);
  model.Unlink(urb.id);
  model.SetComplete([](uint64_t, TransferStatus, uint32_t, std::span<const std::byte>) {});
  return answer;
}

}  // namespace

ModelFacts ReadFacts(UsbDeviceModel& model) {
  ModelFacts facts;
  facts.device = Descriptor(model, kDevice, 0);
  facts.configuration = Descriptor(model, kConfiguration, 0);
  const auto u8 = [](std::span<const std::byte> bytes, size_t at) {
    return at < bytes.size() ? std::to_integer<uint8_t>(bytes[at]) : uint8_t{0};
  };
  const auto u16 = [&](std::span<const std::byte> bytes, size_t at) {
    return static_cast<uint16_t>(u8(bytes, at) | u8(bytes, at + 1) << 8);
  };
  facts.vendor_id = u16(facts.device, 8);
  facts.product_id = u16(facts.device, 10);
  facts.bcd_device = u16(facts.device, 12);
  if (const uint8_t serial = u8(facts.device, 16); serial != 0) {
    const std::vector<std::byte> text =
        Descriptor(model, static_cast<uint16_t>(kString | serial), kEnglish);
    for (size_t at = 2; at + 1 < text.size(); at += 2) {
      facts.serial.push_back(u8(text, at + 1) == 0 ? static_cast<char>(u8(text, at)) : '?');
    }
  }
  std::span<const std::byte> rest(facts.configuration);
  while (u8(rest, 0) >= 2 && u8(rest, 0) <= rest.size()) {
    const std::span<const std::byte> one = rest.first(u8(rest, 0));
    if (u8(one, 1) == 4 && u8(one, 3) == 0) {
      facts.interfaces.push_back({u8(one, 5), u8(one, 6), u8(one, 7)});
    } else if (u8(one, 1) == 5) {
      facts.endpoints.push_back({u8(one, 2), u8(one, 3), u16(one, 4), u8(one, 6)});
    }
    rest = rest.subspan(one.size());
  }
  return facts;
}

UsbSetup ParseSetup(const uint8_t (&bytes)[8]) {
  const auto u16 = [&](size_t at) { return static_cast<uint16_t>(bytes[at] | bytes[at + 1] << 8); };
  return {.request_type = bytes[0],
          .request = bytes[1],
          .value = u16(2),
          .index = u16(4),
          .length = u16(6)};
}

}  // namespace voxeld::display::emulator
