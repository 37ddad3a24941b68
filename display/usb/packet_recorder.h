// A recording that grows while traffic goes on: packets are handed over in memory and a thread of
// the recorder's own writes them, so that whoever records never waits for a disk. What a slow disk
// does not take is left out and counted, in the file too; a full one ends the recording and
// nothing else.
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

// Where the bytes of a recording go. Used by one thread at a time.
class ByteSink {
 public:
  virtual ~ByteSink() = default;
  // All of `bytes`, however long it takes. After an error the sink ends, as far as it can, where it
  // ended before.
  virtual absl::Status Write(std::span<const std::byte> bytes) = 0;
};

// A new file, or an old one from its beginning. The error names the path and what the system said.
absl::StatusOr<std::unique_ptr<ByteSink>> OpenFileSink(const std::string& path);

// Thread-safe.
class PacketRecorder {
 public:
  struct Options {
    RecordingInfo info;
    // What may wait for the disk. A packet that would go beyond is left out.
    size_t max_queued_bytes = size_t{32} << 20;
    // Of the file; 0: as many as there is room for. The recording ends before it.
    uint64_t max_file_bytes = 0;
  };
  struct Counts {
    uint64_t received = 0;  // by Add
    uint64_t left_out = 0;  // of those, for good
    uint64_t file_bytes = 0;
  };

  PacketRecorder(std::unique_ptr<ByteSink> sink, Options options);
  // Finish.
  ~PacketRecorder();

  // Copies the packet; never waits for the sink. `left_out_before` is the recorder's to set.
  void Add(const UsbPacket& packet);
  // Writes all that waits, and statistics, as long as that takes; what is added after it is left
  // out. Idempotent.
  void Finish();

  // OK while all is recorded that comes, but for what a slow disk loses. ResourceExhausted at
  // max_file_bytes, FailedPrecondition after Finish, else what the sink said.
  absl::Status status() const;
  Counts counts() const;

 private:
  // Whole blocks that are written at once; small, so that one that grows is cheap to move.
  struct Chunk {
    std::vector<std::byte> bytes;
    uint64_t packets = 0;
  };

  void Run();
  void Write(const Chunk& chunk);
  void WriteStatistics();

  const std::unique_ptr<ByteSink> sink_;  // the thread's, and then Finish's
  const Options options_;

  mutable sync::Mutex mutex_;
  sync::CondVar work_;
  bool stop_ VOXELD_GUARDED_BY(mutex_) = false;
  absl::Status status_ VOXELD_GUARDED_BY(mutex_);
  bool sink_failed_ VOXELD_GUARDED_BY(mutex_) = false;
  std::deque<Chunk> waiting_ VOXELD_GUARDED_BY(mutex_);
  size_t queued_bytes_ VOXELD_GUARDED_BY(mutex_) = 0;  // waiting, and with the thread
  uint64_t accepted_bytes_ VOXELD_GUARDED_BY(mutex_) = 0;
  uint64_t left_out_now_ VOXELD_GUARDED_BY(mutex_) = 0;  // since the last packet accepted
  Counts counts_ VOXELD_GUARDED_BY(mutex_);
  RecordingStatistics statistics_ VOXELD_GUARDED_BY(mutex_);

  sync::Mutex finish_mutex_;  // held alone
  std::thread thread_ VOXELD_GUARDED_BY(finish_mutex_);
};

}  // namespace voxeld::display
