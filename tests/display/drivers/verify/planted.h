// Defects for a device, and the cases that must find them.
#pragma once

#include <cstring>
#include <ostream>
#include <set>
#include <string>

#include "display/crc/crc32c.h"
#include "display/drivers/voxlink/protocol.h"
#include "display/emulator/voxlink_device.h"
#include "tests/display/drivers/verify/defective_device.h"

namespace voxeld::display::conformance {

using emulator::VoxlinkDeviceConfig;
using voxlink::EventHeader;
using voxlink::EventType;
using voxlink::Load;
using voxlink::PacketHeader;
using voxlink::PacketType;
using voxlink::Request;

struct Planted {
  std::string name;
  std::set<std::string> found_by;  // and possibly by others
  Defect defect;
  std::function<void(VoxlinkDeviceConfig&)> config;
};
inline std::ostream& operator<<(std::ostream& out, const Planted& p) { return out << p.name; }

template <typename T>
void Store(Bytes& bytes, size_t at, const T& value) {
  if (bytes.size() >= at + sizeof(T)) std::memcpy(bytes.data() + at, &value, sizeof(T));
}
template <typename T>
T At(const Bytes& bytes, size_t at) {
  T value{};
  if (bytes.size() >= at + sizeof(T)) std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

inline bool Is(const UsbSetup& setup, Request request) {
  return (setup.request_type & 0x7F) == 0x41 && setup.request == static_cast<uint8_t>(request);
}
inline bool Is(const Bytes& event, EventType type) {
  return At<uint8_t>(event, 0) == static_cast<uint8_t>(type);
}
constexpr size_t kBody = sizeof(EventHeader);

// Changes the answers to a request that reads.
inline Defect Reading(Request request, std::function<void(Bytes&)> change) {
  return {.answer = [=](const UsbSetup& setup, TransferStatus& status, Bytes& data) {
    if (Is(setup, request) && status != TransferStatus::kStall) change(data);
  }};
}
Defect Capability(auto change) {
  return Reading(Request::kGetCapabilities, [=](Bytes& data) {
    if (data.size() < sizeof(voxlink::Capabilities)) return;
    auto fixed = Load<voxlink::Capabilities>(data);
    change(fixed);
    Store(data, 0, fixed);
  });
}
Defect StatusField(auto change) {
  return Reading(Request::kGetStatus, [=](Bytes& data) {
    if (data.size() < sizeof(voxlink::Status)) return;
    auto status = Load<voxlink::Status>(data);
    change(status);
    Store(data, 0, status);
  });
}
inline Defect Descriptor(uint8_t type, std::function<void(TransferStatus&, Bytes&)> change) {
  return {.answer = [=](const UsbSetup& setup, TransferStatus& status, Bytes& data) {
    if (setup.request_type == 0x80 && setup.request == 6 && setup.value >> 8 == type)
      change(status, data);
  }};
}
inline Defect Events(std::function<bool(Bytes&)> change) { return {.event = std::move(change)}; }
inline Defect Silent(EventType type) {
  return Events([=](Bytes& event) { return !Is(event, type); });
}
// Requests that should be stalled are answered.
inline Defect Accepting(std::function<bool(const UsbSetup&)> which) {
  return {.answer = [=](const UsbSetup& setup, TransferStatus& status, Bytes&) {
    if (status == TransferStatus::kStall && which(setup)) status = TransferStatus::kOk;
  }};
}
// Changes whole packets, and computes their checksums again.
inline Defect Packets(std::function<void(PacketHeader&, std::span<std::byte>)> change) {
  return {.bulk = [=](Bytes& bytes) {
    for (size_t at = 0; at + sizeof(PacketHeader) <= bytes.size();) {
      auto header = At<PacketHeader>(bytes, at);
      const size_t end = at + sizeof(header) + header.length;
      if (header.magic != voxlink::kMagic || end > bytes.size()) return;
      const auto payload = std::span(bytes).subspan(at + sizeof(header), header.length);
      const bool sound = header.length == 0 || Crc32c(payload) == header.payload_crc;
      change(header, payload);
      if (sound && header.length > 0) header.payload_crc = Crc32c(payload);
      header.header_crc =
          Crc32c(std::as_bytes(std::span(&header, 1)).first(voxlink::kHeaderCrcOffset));
      Store(bytes, at, header);
      at = end;
    }
  }};
}

}  // namespace voxeld::display::conformance
