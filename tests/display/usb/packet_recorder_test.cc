// Tests recordings while they grow: no caller waits for a disk, and packets that it does not accept
// are reported.

#include "display/usb/packet_recorder.h"

#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "gtest/gtest.h"

namespace voxeld::display {
namespace {

using Bytes = std::vector<std::byte>;

// A disk in memory that can be stopped and filled.
class Disk {
 public:
  class Sink final : public ByteSink {
   public:
    explicit Sink(Disk& disk) : disk_(disk) {}
    absl::Status Write(std::span<const std::byte> bytes) override { return disk_.Write(bytes); }

   private:
    Disk& disk_;
  };

  std::unique_ptr<ByteSink> MakeSink() { return std::make_unique<Sink>(*this); }
  void SetCapacity(size_t bytes) {
    sync::MutexLock lock(mutex_);
    capacity_ = bytes;
  }
  // While it is stopped, a write does not return.
  void SetStopped(bool stopped) {
    sync::MutexLock lock(mutex_);
    stopped_ = stopped;
    changed_.NotifyAll();
  }
  void WaitForWriter() {
    sync::MutexLock lock(mutex_);
    while (!writing_) changed_.Wait(mutex_);
  }
  Bytes bytes() const {
    sync::MutexLock lock(mutex_);
    return bytes_;
  }

 private:
  absl::Status Write(std::span<const std::byte> bytes) {
    sync::MutexLock lock(mutex_);
    writing_ = true;
    changed_.NotifyAll();
    while (stopped_) changed_.Wait(mutex_);
    writing_ = false;
    if (bytes_.size() + bytes.size() > capacity_) {
      return absl::ResourceExhaustedError("the disk is full");
    }
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
    return absl::OkStatus();
  }

  mutable sync::Mutex mutex_;
  sync::CondVar changed_;
  Bytes bytes_ VOXELD_GUARDED_BY(mutex_);
  size_t capacity_ VOXELD_GUARDED_BY(mutex_) = SIZE_MAX;
  bool stopped_ VOXELD_GUARDED_BY(mutex_) = false;
  bool writing_ VOXELD_GUARDED_BY(mutex_) = false;
};

UsbPacket PacketOf(uint64_t id, std::span<const std::byte> data) {
  UsbPacket packet;
  packet.time_ns = static_cast<sync::TimeNs>(id) * sync::kSecond;
  packet.header.id = id;
  packet.header.type = UsbmonHeader::kSubmit;
  packet.data = data;
  return packet;
}

// A packet as it was read.
struct Read {
  uint64_t id;
  uint64_t left_out_before;
  bool operator==(const Read&) const = default;
};
std::vector<Read> ReadAll(const Bytes& file) {
  std::vector<Read> read;
  PcapngReader reader(file);
  while (true) {
    const auto packet = reader.Next();
    EXPECT_TRUE(packet.ok()) << packet.status();
    if (!packet.ok() || !packet->has_value()) return read;
    read.push_back({(*packet)->header.id, (*packet)->left_out_before});
  }
}

// Returns the interface statistics at the end of a file: received and left out.
std::pair<uint64_t, uint64_t> StatisticsOf(const Bytes& file) {
  const auto get = [&](size_t at, auto& value) {
    std::memcpy(&value, file.data() + at, sizeof(value));
  };
  std::pair<uint64_t, uint64_t> result{};
  for (size_t at = 0; at + 12 <= file.size();) {
    uint32_t type, length;
    get(at, type);
    get(at + 4, length);
    size_t option = at + 20;
    while (type == 5 && option + 4 < at + length - 4) {
      uint16_t code, size;
      get(option, code);
      get(option + 2, size);
      if (code == 4) get(option + 4, result.first);
      if (code == 5) get(option + 4, result.second);
      option += 4 + (size + 3u) / 4 * 4;
    }
    at += length;
  }
  return result;
}

TEST(PacketRecorder, WritesWhatItGetsAndStatistics) {
  Disk disk;
  PacketRecorder recorder(disk.MakeSink(), {});
  for (uint64_t i = 1; i <= 1000; ++i) recorder.Add(PacketOf(i, Bytes(i % 70)));
  EXPECT_TRUE(recorder.status().ok());
  recorder.Finish();
  recorder.Finish();
  EXPECT_TRUE(absl::IsFailedPrecondition(recorder.status()));
  recorder.Add(PacketOf(1001, {}));
  EXPECT_EQ(recorder.counts().received, 1001u);
  EXPECT_EQ(recorder.counts().left_out, 1u);
  const std::vector<Read> read = ReadAll(disk.bytes());
  ASSERT_EQ(read.size(), 1000u);
  for (uint64_t i = 0; i < read.size(); ++i) EXPECT_EQ(read[i], (Read{i + 1, 0}));
  EXPECT_EQ(StatisticsOf(disk.bytes()), std::pair(uint64_t{1000}, uint64_t{0}));
  EXPECT_EQ(recorder.counts().file_bytes, disk.bytes().size());
}

TEST(PacketRecorder, ASlowDiskLosesPacketsAndTheFileTells) {
  Disk disk;
  disk.SetStopped(true);
  PacketRecorder recorder(disk.MakeSink(), {.max_queued_bytes = 4096});
  disk.WaitForWriter();  // with the start of the file
  for (uint64_t i = 1; i <= 10; ++i) recorder.Add(PacketOf(i, Bytes(900)));
  const uint64_t lost = recorder.counts().left_out;
  EXPECT_EQ(lost, 6u);
  disk.SetStopped(false);
  while (recorder.counts().file_bytes < 3000) std::this_thread::yield();
  recorder.Add(PacketOf(11, Bytes(900)));
  EXPECT_TRUE(recorder.status().ok());
  recorder.Finish();
  EXPECT_EQ(ReadAll(disk.bytes()), (std::vector<Read>{{1, 0}, {2, 0}, {3, 0}, {4, 0}, {11, 6}}));
  EXPECT_EQ(StatisticsOf(disk.bytes()), std::pair(uint64_t{11}, uint64_t{6}));
}

TEST(PacketRecorder, AFullDiskEndsTheRecordingAndNothingElse) {
  Disk disk;
  PacketRecorder recorder(disk.MakeSink(), {});
  recorder.Add(PacketOf(1, Bytes(100)));
  while (recorder.counts().file_bytes < 200) std::this_thread::yield();
  disk.SetCapacity(300);
  recorder.Add(PacketOf(2, Bytes(1000)));
  while (recorder.status().ok()) std::this_thread::yield();
  EXPECT_EQ(recorder.status(), absl::ResourceExhaustedError("the disk is full"));
  recorder.Add(PacketOf(3, {}));
  recorder.Finish();
  EXPECT_EQ(recorder.status(), absl::ResourceExhaustedError("the disk is full"));
  EXPECT_EQ(recorder.counts().left_out, 2u);
  EXPECT_EQ(ReadAll(disk.bytes()), (std::vector<Read>{{1, 0}}));
}

TEST(PacketRecorder, EndsBeforeItsLimit) {
  Disk disk;
  PacketRecorder recorder(disk.MakeSink(), {.max_file_bytes = 5000});
  for (uint64_t i = 1; i <= 10; ++i) recorder.Add(PacketOf(i, Bytes(900)));
  EXPECT_TRUE(absl::IsResourceExhausted(recorder.status())) << recorder.status();
  recorder.Finish();
  EXPECT_TRUE(absl::IsResourceExhausted(recorder.status()));
  EXPECT_LE(disk.bytes().size(), 5000u);
  EXPECT_EQ(ReadAll(disk.bytes()).size(), 4u);
  EXPECT_EQ(StatisticsOf(disk.bytes()), std::pair(uint64_t{10}, uint64_t{6}));
}

class RecordingFile : public testing::Test {
 protected:
  void SetUp() override {
    std::string path = testing::TempDir() + "voxeld_recording_XXXXXX";
    ASSERT_NE(::mkdtemp(path.data()), nullptr);
    folder_ = path;
  }
  void TearDown() override {
    ::unlink((folder_ + "/a.pcapng").c_str());
    ::rmdir(folder_.c_str());
  }
  std::string folder_;
};

TEST_F(RecordingFile, IsMadeOrBegunAnew) {
  const std::string path = folder_ + "/a.pcapng";
  for (const uint64_t packets : {uint64_t{20}, uint64_t{3}}) {
    auto sink = OpenFileSink(path);
    ASSERT_TRUE(sink.ok()) << sink.status();
    PacketRecorder recorder(*std::move(sink), {});
    for (uint64_t i = 1; i <= packets; ++i) recorder.Add(PacketOf(i, Bytes(i)));
    recorder.Finish();
    std::ifstream in(path, std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(in), {}};
    const auto bytes = std::as_bytes(std::span(text));
    EXPECT_EQ(ReadAll(Bytes(bytes.begin(), bytes.end())).size(), packets);
  }
}

TEST_F(RecordingFile, ThatCannotBeMadeIsNamed) {
  const absl::Status status = OpenFileSink(folder_ + "/none/a.pcapng").status();
  EXPECT_TRUE(absl::IsNotFound(status)) << status;
  EXPECT_NE(status.message().find(folder_ + "/none/a.pcapng"), std::string::npos) << status;
}

TEST_F(RecordingFile, OnAFullDeviceFailsOnceAndStaysFailed) {
  ASSERT_EQ(::access("/dev/full", W_OK), 0) << "Linux provides it";
  auto sink = OpenFileSink("/dev/full");
  ASSERT_TRUE(sink.ok()) << sink.status();
  PacketRecorder recorder(*std::move(sink), {});
  recorder.Add(PacketOf(1, Bytes(10)));
  recorder.Finish();
  EXPECT_EQ(recorder.status(), absl::ResourceExhaustedError(
                                   "writing the recording \"/dev/full\": No space left on device"));
}

}  // namespace
}  // namespace voxeld::display
