// Writes a recording while traffic goes on: packets are queued in memory and a thread of the
// recorder writes them, so that recording never waits for a disk. Packets that a slow disk does not
// accept are left out and counted, in the file too; a full disk ends the recording and nothing
// else.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "display/sync/mutex.h"
#include "display/usb/pcapng.h"

namespace voxeld::display {

// The destination of a recording's bytes. Used by one thread at a time.
class ByteSink {
 public:
  virtual ~ByteSink() = default;
  // Writes all of `bytes`, however long it takes. After an error the sink restores its former end,
  // if it can.
  virtual absl::Status Write(std::span<const std::byte> bytes) = 0;
};

// Creates a file, or truncates an existing one. The error names the path and the system's reason.
absl::StatusOr<std::unique_ptr<ByteSink>> OpenFileSink(const std::string& path);

// Thread-safe.
class PacketRecorder {
 public:
  struct Options {
    RecordingInfo info;
    // Limit of the bytes that wait for the disk. Packets beyond it are left out.
    size_t max_queued_bytes = size_t{32} << 20;
    // Limit of the file's size; 0: as much as the disk has. The recording ends before it.
    uint64_t max_file_bytes = 0;
  };
  struct Counts {
    uint64_t received = 0;  // by Add
    uint64_t left_out = 0;  // of those, permanently
    uint64_t file_bytes = 0;
  };

  PacketRecorder(std::unique_ptr<ByteSink> sink, Options options);
  // Calls Finish.
  ~PacketRecorder();

  // Copies the packet; never waits for the sink. The recorder sets `left_out_before`.
  void Add(const UsbPacket& packet);
  // Writes everything that waits, and statistics, however long that takes; packets added later are
  // left out. Idempotent.
  void Finish();

  // Returns OK while all packets are recorded, except those that a slow disk loses. Errors:
  // ResourceExhausted at max_file_bytes, FailedPrecondition after Finish, else the sink's error.
  absl::Status status() const;
  Counts counts() const;

 private:
  // Complete blocks that are written at once; small, so that growing one is cheap.
  struct Chunk {
    std::vector<std::byte> bytes;
    uint64_t packets = 0;
  };

  void Run();
  void Write(const Chunk& chunk);
  void WriteStatistics();

  const std::unique_ptr<ByteSink> sink_;  // used by the thread, and then by Finish
  const Options options_;

  mutable sync::Mutex mutex_;
  sync::CondVar work_;
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  absl::Status status_ VOXELD_GUARDED_BY(mutex_);
  bool sink_failed_ VOXELD_GUARDED_BY(mutex_) = false;
  std::deque<Chunk> waiting_ VOXELD_GUARDED_BY(mutex_);
  size_t queued_bytes_ VOXELD_GUARDED_BY(mutex_) = 0;  // waiting, and held by the thread
  uint64_t accepted_bytes_ VOXELD_GUARDED_BY(mutex_) = 0;
  uint64_t left_out_now_ VOXELD_GUARDED_BY(mutex_) = 0;  // since the last accepted packet
  Counts counts_ VOXELD_GUARDED_BY(mutex_);
  RecordingStatistics statistics_ VOXELD_GUARDED_BY(mutex_);

  sync::Mutex finish_mutex_;  // never held together with another lock
  std::thread thread_ VOXELD_GUARDED_BY(finish_mutex_);
};

}  // namespace voxeld::display
