// Packets of voxlink according to a script: valid ones with any contents, since a fuzzer would
// hardly find the checksums, and bytes that are not packets.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "display/drivers/voxlink/packet.h"
#include "tests/fuzz/script.h"

namespace voxeld::fuzz {

inline std::vector<std::byte> BytesOf(const std::string& text) {
  const auto* const data = reinterpret_cast<const std::byte*>(text.data());
  return {data, data + text.size()};
}

// Volumes mostly have small numbers, so that they coincide.
inline uint64_t Volume(Script& script) {
  const uint8_t byte = script.Byte();
  return byte < 250 ? byte : script.Number(8);
}

// Appends one packet, or garbage.
inline void AppendPacket(Script& script, display::voxlink::PacketWriter& writer,
                         std::vector<std::byte>& out) {
  using display::voxlink::PacketType;
  switch (script.Byte() % 10) {
    case 0: {
      const uint64_t volume = Volume(script), base = Volume(script);
      const uint32_t pictures = script.Byte();
      writer.Begin(out, volume, base, pictures, BytesOf(script.Text()));
      break;
    }
    case 1: {
      const uint64_t volume = Volume(script);
      const uint32_t slice = script.Byte();
      const uint16_t sub_frame = script.Byte();
      const uint32_t offset = script.Below(65536);
      writer.Slice(out, volume, slice, sub_frame, offset, BytesOf(script.Text()));
      break;
    }
    case 2: {  // a picture of that many bytes, all alike
      const uint64_t volume = Volume(script);
      const uint32_t slice = script.Byte();
      const uint16_t sub_frame = script.Byte();
      const std::vector<std::byte> picture(script.Byte(), std::byte{script.Byte()});
      writer.Slice(out, volume, slice, sub_frame, 0, picture);
      break;
    }
    case 3: {
      const uint64_t volume = Volume(script);
      writer.End(out, volume, script.Flag());
      break;
    }
    case 4: {
      const uint64_t volume = Volume(script), sweep = Volume(script);
      writer.Show(out, volume, sweep);
      break;
    }
    case 5: {
      const uint64_t volume = Volume(script), sweep = Volume(script);
      writer.ShowAhead(out, volume, sweep, script.Byte());
      break;
    }
    case 6: {
      const auto type = static_cast<PacketType>(script.Byte());
      writer.Plain(out, type, Volume(script));
      break;
    }
    case 7:
      writer.Restart();
      break;
    case 8: {  // what was written is damaged, or truncated
      if (out.empty()) break;
      const size_t at = script.Below(65536) % out.size();
      const auto change = static_cast<std::byte>(script.Byte());
      if (change == std::byte{0}) {
        out.resize(at);
      } else {
        out[at] ^= change;
      }
      break;
    }
    default: {
      const std::vector<std::byte> garbage = BytesOf(script.Text());
      out.insert(out.end(), garbage.begin(), garbage.end());
      break;
    }
  }
}

}  // namespace voxeld::fuzz
