#include "display/drivers/voxlink/protocol.h"

namespace voxeld::display::voxlink {

void AppendBytes(std::vector<std::byte>& out, std::span<const std::byte> bytes) {
  out.insert(out.end(), bytes.begin(), bytes.end());
}

void AppendBytes(TransferBytes& out, std::span<const std::byte> bytes) { out.Append(bytes); }

const char* PacketTypeName(uint8_t type) {
  switch (static_cast<PacketType>(type)) {
    case PacketType::kBegin:
      return "VOLUME_BEGIN";
    case PacketType::kSlice:
      return "SLICE";
    case PacketType::kEnd:
      return "VOLUME_END";
    case PacketType::kAbort:
      return "ABORT";
    case PacketType::kShow:
      return "SHOW";
    case PacketType::kDrop:
      return "DROP";
    case PacketType::kKeepalive:
      return "KEEPALIVE";
  }
  return "unknown";
}

const char* ErrorCodeName(ErrorCode code) {
  switch (code) {
    case ErrorCode::kNone:
      return "none";
    case ErrorCode::kBadHeader:
      return "bad header";
    case ErrorCode::kBadPayload:
      return "bad payload CRC";
    case ErrorCode::kSequence:
      return "packets missing";
    case ErrorCode::kNotFilling:
      return "volume is not being filled";
    case ErrorCode::kNotInBitmap:
      return "slice was not announced";
    case ErrorCode::kBadPicture:
      return "slice outside the mode";
    case ErrorCode::kBadOrder:
      return "out of order";
    case ErrorCode::kBadLength:
      return "bad length";
    case ErrorCode::kUnknownType:
      return "unknown packet type";
    case ErrorCode::kBadBegin:
      return "VOLUME_BEGIN does not fit";
    case ErrorCode::kCreditExceeded:
      return "credit exceeded";
  }
  return "unknown";
}

const char* ReasonName(uint32_t reason) {
  switch (static_cast<Reason>(reason)) {
    case Reason::kByHost:
      return "by the host";
    case Reason::kSuperseded:
      return "superseded";
    case Reason::kBadBase:
      return "its base is not held";
    case Reason::kUnknownVolume:
      return "the volume is unknown";
    case Reason::kMalformed:
      return "it does not fit the mode";
  }
  return "unknown reason";
}

}  // namespace voxeld::display::voxlink
