// The packets of the local socket (voxeld/v1/local.proto), read and written.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/address/descriptor.h"

namespace voxeld::daemon::local {

inline constexpr size_t kGreatestPacket = 4096;

// What came in at once.
struct Packet {
  enum class What : uint8_t {
    kNothing,  // not now
    kEnd,      // the other side is gone, or has sent a packet of no bytes
    kPacket,
  };
  What what = What::kNothing;
  std::string bytes;
  std::vector<Descriptor> descriptors;  // closed on exec; as many as there was room for
  bool more_descriptors = false;        // there was no room for; they are gone
  bool truncated = false;               // it had more than kGreatestPacket bytes
  bool descriptors_lost = false;        // there was none left to put a descriptor of the packet in
};

// How many descriptors a packet may bring. One is right, and a second shows that there are too many:
// no more than that, as those that are about to be closed again must not make the process run out.
// None from whom nobody knows: closing may wait for the file's own system, and what is not taken
// need not be closed.
inline constexpr size_t kNoDescriptors = 0, kDescriptors = 2;

// Does not block.
Packet Receive(int socket, size_t room);

// A LocalMessage.
struct Message {
  enum class What : uint8_t { kHello, kMemory, kRelease };
  What what = What::kHello;
  std::string token;  // kHello
  uint64_t id = 0;    // kMemory, kRelease
  uint64_t size = 0;  // kMemory
};

// InvalidArgument: bytes that are no LocalMessage, or one that says nothing.
absl::StatusOr<Message> ParseMessage(const Packet& packet);

// LocalAnswers.
std::string Welcome(uint32_t max_memories, uint64_t max_bytes);
std::string Held(uint64_t id);
std::string Released(uint64_t id);
std::string Refused(uint64_t id, std::string_view message);

}  // namespace voxeld::daemon::local
