#include "display/usb/packet_recorder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::display {
namespace {

constexpr size_t kChunkBytes = size_t{1} << 20;
constexpr size_t kRoomForStatistics = 512;  // reserved at the end of a file of limited size

absl::Status SystemError(const char* what, const std::string& path, int error) {
  const std::string message = absl::StrCat(what, " \"", path, "\": ", std::strerror(error));
  if (error == ENOSPC || error == EDQUOT || error == EFBIG) {
    return absl::ResourceExhaustedError(message);
  }
  return absl::ErrnoToStatus(error, absl::StrCat(what, " \"", path, "\""));
}

class FileSink final : public ByteSink {
 public:
  FileSink(std::string path, int descriptor) : path_(std::move(path)), descriptor_(descriptor) {}
  ~FileSink() override { ::close(descriptor_); }
  FileSink(const FileSink&) = delete;
  FileSink& operator=(const FileSink&) = delete;

  absl::Status Write(std::span<const std::byte> bytes) override {
    const uint64_t end = size_ + bytes.size();
    while (!bytes.empty()) {
      const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
      if (written >= 0) {
        bytes = bytes.subspan(static_cast<size_t>(written));
      } else if (errno != EINTR) {
        const int error = errno;
        // If this also fails, the file can be read up to the truncated block.
        [[maybe_unused]] const int cut = ::ftruncate(descriptor_, static_cast<off_t>(size_));
        return SystemError("writing the recording", path_, error);
      }
    }
    size_ = end;
    return absl::OkStatus();
  }

 private:
  const std::string path_;
  const int descriptor_;
  uint64_t size_ = 0;
};

}  // namespace

absl::StatusOr<std::unique_ptr<ByteSink>> OpenFileSink(const std::string& path) {
  constexpr mode_t kMode = 0640;  // restricted, because it holds everything that was shown
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, kMode);
  if (descriptor < 0) return SystemError("opening the recording", path, errno);
  // Not a recording that another process is writing.
  if (flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    ::close(descriptor);
    return absl::FailedPreconditionError(
        absl::StrCat("the recording ", path, " is being written already; choose another file"));
  }
  // A pipe or a device cannot be truncated, and need not be.
  if (ftruncate(descriptor, 0) != 0 && errno != EINVAL) {
    const int error = errno;
    ::close(descriptor);
    return SystemError("emptying the recording", path, error);
  }
  return std::make_unique<FileSink>(path, descriptor);
}

PacketRecorder::PacketRecorder(std::unique_ptr<ByteSink> sink, Options options)
    : sink_(std::move(sink)), options_(std::move(options)) {
  std::vector<std::byte>& start = waiting_.emplace_back().bytes;
  AppendRecordingStart(options_.info, start);
  accepted_bytes_ = queued_bytes_ = start.size();
  thread_ = std::thread([this] { Run(); });
}

PacketRecorder::~PacketRecorder() { Finish(); }

void PacketRecorder::Add(const UsbPacket& packet) {
  const size_t size = UsbPacketBlockSize(packet);
  sync::MutexLock lock(mutex_);
  if (counts_.received++ == 0) statistics_.first_ns = packet.time_ns;
  statistics_.last_ns = packet.time_ns;
  if (status_.ok() && options_.max_file_bytes > 0 &&
      accepted_bytes_ + size + kRoomForStatistics > options_.max_file_bytes) {
    status_ = absl::ResourceExhaustedError(
        absl::StrCat("the recording ended after ", accepted_bytes_, " bytes: with the next packet ",
                     "it would pass its limit of ", options_.max_file_bytes));
  }
  if (stop_ || !status_.ok() || packet.data.size() > kMostPacketData ||
      queued_bytes_ + size > options_.max_queued_bytes) {
    ++counts_.left_out;
    ++left_out_now_;
    return;
  }
  UsbPacket numbered = packet;
  numbered.left_out_before = std::exchange(left_out_now_, 0);
  if (waiting_.empty() || waiting_.back().bytes.size() >= kChunkBytes) waiting_.emplace_back();
  Chunk& chunk = waiting_.back();
  const size_t before = chunk.bytes.size();
  AppendUsbPacket(numbered, chunk.bytes);
  ++chunk.packets;
  accepted_bytes_ += chunk.bytes.size() - before;
  queued_bytes_ += chunk.bytes.size() - before;
  work_.NotifyOne();
}

void PacketRecorder::Run() {
  while (true) {
    Chunk chunk;
    {
      sync::MutexLock lock(mutex_);
      while (waiting_.empty() && !stop_) work_.Wait(mutex_);
      if (waiting_.empty()) return;
      chunk = std::move(waiting_.front());
      waiting_.pop_front();
      if (sink_failed_) {
        counts_.left_out += chunk.packets;
        queued_bytes_ -= chunk.bytes.size();
        continue;
      }
    }
    Write(chunk);
  }
}

void PacketRecorder::Write(const Chunk& chunk) {
  const absl::Status status = sink_->Write(chunk.bytes);
  sync::MutexLock lock(mutex_);
  queued_bytes_ -= chunk.bytes.size();
  if (status.ok()) {
    counts_.file_bytes += chunk.bytes.size();
    return;
  }
  counts_.left_out += chunk.packets;
  sink_failed_ = true;
  status_ = status;
}

void PacketRecorder::Finish() {
  sync::MutexLock finish_lock(finish_mutex_);
  if (!thread_.joinable()) return;
  {
    sync::MutexLock lock(mutex_);
    stop_ = true;
    work_.NotifyOne();
  }
  thread_.join();
  WriteStatistics();
}

void PacketRecorder::WriteStatistics() {
  std::vector<std::byte> bytes;
  {
    sync::MutexLock lock(mutex_);
    if (sink_failed_) return;
    statistics_.received = counts_.received;
    statistics_.left_out = counts_.left_out;
    statistics_.comment = std::string(status_.message());
    AppendStatistics(statistics_, bytes);
  }
  const absl::Status status = sink_->Write(bytes);
  sync::MutexLock lock(mutex_);
  if (!status.ok()) {
    status_ = status;
    return;
  }
  counts_.file_bytes += bytes.size();
  if (status_.ok()) status_ = absl::FailedPreconditionError("the recording is finished");
}

absl::Status PacketRecorder::status() const {
  sync::MutexLock lock(mutex_);
  return status_;
}

PacketRecorder::Counts PacketRecorder::counts() const {
  sync::MutexLock lock(mutex_);
  return counts_;
}

}  // namespace voxeld::display
