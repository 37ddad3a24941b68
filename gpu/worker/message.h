// The messages between an engine's owner and its worker: small messages over pairs of
// SOCK_SEQPACKET sockets, one pair for each engine and one for control. Bulk data is in segments;
// messages name them.
//
// Both ends must come from the same build: kWorkerProtocol identifies it, and a worker of another
// build is rejected.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "gpu/engine.h"
#include "gpu/rank_link.h"

namespace voxeld::gpu {

inline constexpr uint32_t kWorkerProtocol = 6;

enum class MessageType : uint32_t {
  // To the worker. Each, except those about segments, is answered once, under its own call number.
  kOpen = 1,         // OpenMessage; answered by kReady or kDone
  kSegment = 2,      // SegmentMessage, with its descriptor
  kDropSegment = 3,  // SegmentMessage
  kTarget = 4,       // BulkMessage; kDone
  kApply = 5,        // BulkMessage; kDone
  kFrame = 6,        // FrameMessage; kFrameDone or kDone
  kVoxels = 7,       // VoxelsMessage; kDone
  kConnect = 8,      // a descriptor, the other end of a connection; only over the control socket
  kBulkSegment = 9,  // BulkSegmentMessage, with its descriptor
  kDropBulkSegment = 10,  // BulkSegmentMessage
  kInvite = 11,           // InviteMessage, then the library's path; kInvited or kDone
  kJoin = 12,             // JoinMessage, then the library's path; kDone
  // From the worker.
  kReady = 32,      // ReadyMessage
  kDone = 33,       // DoneMessage, then the text of the status
  kFrameDone = 34,  // FrameDoneMessage
  kInvited = 35,    // InvitedMessage
};

struct OpenMessage {
  uint32_t protocol = kWorkerProtocol;
  EngineKind kind = EngineKind::kCpu;
  int32_t threads = 0;
  int32_t device = 0;
  SlicePart part;
  uint64_t index_bytes = 0;
  uint64_t cpu_index_bytes = 0;
};

struct SegmentMessage {
  uint32_t segment = 0;
  uint32_t staging = 0;  // 1: for data to the worker, read by a device; 0: for results
  uint64_t size = 0;
};

// A segment of bulk memory, which is only read.
struct BulkSegmentMessage {
  uint64_t segment = 0;
  uint64_t size = 0;
};

// The first `size` bytes of a segment.
struct BulkMessage {
  uint32_t segment = 0;
  uint32_t crc = 0;  // CRC-32C of those bytes
  uint64_t size = 0;
};

// The worker writes the frame to the segment, in FrameSlot's layout.
struct FrameMessage {
  uint32_t segment = 0;
  uint64_t frame = 0;
  uint64_t holds = 0;                // the frame that the segment holds
  uint64_t buffer_holds = 0;         // the frame that the caller's buffer holds
  uint64_t pictures = 0, bytes = 0;  // sizes of the caller's buffer
};

struct VoxelsMessage {
  uint32_t segment = 0;
  VoxelBox box;
  uint64_t count = 0;
};

struct InviteMessage {
  uint32_t reserved = 0;
};

struct InvitedMessage {
  RankLink::Invitation invitation = {};
};

struct JoinMessage {
  RankLink::Invitation invitation = {};
  int32_t rank = 0, ranks = 1;
};

struct ReadyMessage {
  EngineKind kind = EngineKind::kCpu;
  char device[128] = {};
};

struct DoneMessage {
  int32_t code = 0;
};

struct FrameDoneMessage {
  FrameResult result;
  uint32_t crc = 0;  // FrameCrc
};

struct Message {
  MessageType type = MessageType::kDone;
  uint64_t call = 0;
  std::vector<std::byte> body;
  int fd = -1;  // the receiver's to close

  // Returns the struct at the beginning of the body; nullopt if the body is too short.
  template <typename T>
  std::optional<T> As() const {
    static_assert(std::is_trivially_copyable_v<T>);
    if (body.size() < sizeof(T)) return std::nullopt;
    T value;
    std::memcpy(static_cast<void*>(&value), body.data(), sizeof(T));
    return value;
  }
  // Returns the text after the struct.
  template <typename T>
  std::string TextAfter() const {
    if (body.size() < sizeof(T)) return "";
    return {reinterpret_cast<const char*>(body.data()) + sizeof(T), body.size() - sizeof(T)};
  }
};

template <typename T>
Message MakeMessage(MessageType type, uint64_t call, const T& body, std::string_view text = {}) {
  static_assert(std::is_trivially_copyable_v<T>);
  Message message;
  message.type = type;
  message.call = call;
  message.body.resize(sizeof(T) + text.size());
  std::memcpy(message.body.data(), &body, sizeof(T));
  if (!text.empty()) std::memcpy(message.body.data() + sizeof(T), text.data(), text.size());
  return message;
}

Message MakeDone(uint64_t call, const absl::Status& status);
absl::Status StatusOf(const Message& done);

// For a socket of a pair. Errors: sending gives Unavailable if the other end is gone, and
// ResourceExhausted if it does not read (only if the socket does not block). Receiving blocks, and
// gives Unavailable at the end of the connection.
absl::Status SendMessage(int socket, const Message& message);
absl::StatusOr<Message> ReceiveMessage(int socket);

}  // namespace voxeld::gpu
