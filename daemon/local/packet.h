// Reads and writes the packets of the local socket (voxeld/v1/local.proto).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "daemon/address/descriptor.h"

namespace voxeld::daemon::local {

inline constexpr size_t kGreatestPacket = 4096;

// The result of one receive call.
struct Packet {
  enum class What : uint8_t {
    kNothing,  // would block
    kEnd,      // the client has gone, or has sent an empty packet
    kPacket,
  };
  What what = What::kNothing;
  std::string bytes;
  std::vector<Descriptor> descriptors;  // close-on-exec; as many as there was room for
  bool more_descriptors = false;        // further ones did not fit and are lost
  bool truncated = false;               // the packet had more than kGreatestPacket bytes
  bool descriptors_lost = false;  // the process had no descriptor left for one of the packet's
};

// How many descriptors a packet may carry. One is valid, and a second one shows that there are too
// many. More are not received, so that descriptors that are closed at once cannot exhaust the
// process's limit. None are received from unknown clients: closing one may block in its file
// system, and those that are not received need not be closed.
inline constexpr size_t kNoDescriptors = 0, kDescriptors = 2;

// Receives a packet without blocking.
Packet Receive(int socket, size_t room);

// A parsed LocalMessage.
struct Message {
  enum class What : uint8_t { kHello, kMemory, kRelease };
  What what = What::kHello;
  std::string token;  // kHello
  uint64_t id = 0;    // kMemory, kRelease
  uint64_t size = 0;  // kMemory
};

// Errors: InvalidArgument if the bytes are not a LocalMessage, or if it is empty.
absl::StatusOr<Message> ParseMessage(const Packet& packet);

// Serialize LocalAnswers.
std::string Welcome(uint32_t max_memories, uint64_t max_bytes);
std::string Held(uint64_t id);
std::string Released(uint64_t id);
std::string Refused(uint64_t id, std::string_view message);

}  // namespace voxeld::daemon::local
