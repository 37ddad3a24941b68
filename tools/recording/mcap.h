// MCAP files (https://mcap.dev/spec, version 0): messages with times, on channels that name their schema, in
// compressed chunks with an index. What is written here other tools open, and the other way round.
//
//   magic, Header
//   Chunk (zstd, CRC of what is in it): Schema and Channel records before their first message, Messages
//   MessageIndex for each channel of the chunk, …
//   DataEnd (CRC of all before)
//   summary: Schemas, Channels, Statistics, ChunkIndexes; SummaryOffsets
//   Footer (CRC of the summary), magic
//
// A file that ends early, as when its writer was killed, has all its whole chunks; Reader takes it as it is.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace voxeld::recording {

struct McapSchema {
  std::string name, encoding, data;  // "protobuf": a FileDescriptorSet
};

struct McapChannel {
  uint16_t schema = 0;  // 0: none
  std::string topic, encoding;
  std::map<std::string, std::string> metadata;
};

struct McapMessage {
  uint16_t channel = 0;
  uint32_t sequence = 0;
  uint64_t log_time_ns = 0, publish_time_ns = 0;
  std::string_view data;
};

// Not thread-safe.
class McapWriter {
 public:
  // A chunk ends with the message that takes it to this size.
  static constexpr size_t kChunkBytes = 1u << 20;

  // A new file; AlreadyExists if there is one. `library` names the writer.
  static absl::StatusOr<std::unique_ptr<McapWriter>> Create(const std::string& path,
                                                            const std::string& library);
  // Without Close the file ends after its last whole chunk.
  ~McapWriter();
  McapWriter(const McapWriter&) = delete;
  McapWriter& operator=(const McapWriter&) = delete;

  // Before the first message on them. Numbers count from 1.
  uint16_t AddSchema(McapSchema schema);
  uint16_t AddChannel(McapChannel channel);

  absl::Status Write(const McapMessage& message);
  // Ends the chunk under way, and has the system put all on the disk.
  absl::Status Flush();
  // Ends the chunk and writes the index. Nothing can be written any more.
  absl::Status Close();

  uint64_t bytes() const { return written_; }  // in the file
  uint64_t messages() const { return messages_; }

 private:
  struct ChunkIndex {
    uint64_t start_time = 0, end_time = 0, offset = 0, length = 0;
    std::map<uint16_t, uint64_t> index_offsets;
    uint64_t index_length = 0, compressed = 0, uncompressed = 0;
  };

  McapWriter(std::string path, int file) : path_(std::move(path)), file_(file) {}
  absl::Status Put(std::string_view bytes);
  absl::Status EndChunk();

  const std::string path_;
  int file_;
  uint64_t written_ = 0;
  uint32_t crc_ = 0;  // of all so far
  std::vector<McapSchema> schemas_;
  std::vector<McapChannel> channels_;
  size_t schemas_written_ = 0, channels_written_ = 0;  // into chunks
  std::string chunk_;
  uint64_t chunk_start_ = 0, chunk_end_ = 0;
  std::map<uint16_t, std::vector<std::pair<uint64_t, uint64_t>>> chunk_messages_;
  std::vector<ChunkIndex> chunks_;
  std::map<uint16_t, uint64_t> counts_;
  uint64_t messages_ = 0, start_ = UINT64_MAX, end_ = 0;
  bool failed_ = false;
};

struct McapSummary {
  uint64_t messages = 0, chunks = 0;
  uint64_t start_ns = 0, end_ns = 0;
  bool whole = false;  // it has its end; else it was cut off
  std::map<uint16_t, McapSchema> schemas;
  std::map<uint16_t, McapChannel> channels;
};

// Reads front to end, chunk by chunk, so that files of any size and those that were cut off are read alike.
// Not thread-safe.
class McapReader {
 public:
  // Greatest chunk, uncompressed: what a file may make a reader hold.
  static constexpr uint64_t kMostChunkBytes = uint64_t{4} << 30;

  // NotFound; InvalidArgument for what is no MCAP file.
  static absl::StatusOr<std::unique_ptr<McapReader>> Open(const std::string& path);
  ~McapReader();

  // What is in it, found by reading it once; then it stands at its beginning again. DataLoss with the place
  // for a chunk that is damaged.
  absl::StatusOr<McapSummary> Summarise();

  // From where it stands, every message in the order of the file, until `each` answers false. DataLoss as
  // above; a file that was cut off ends where its last whole chunk does.
  absl::Status Read(const std::function<bool(const McapMessage&)>& each);
  void Rewind();

  // Known so far.
  const std::map<uint16_t, McapChannel>& channels() const { return summary_.channels; }
  const std::map<uint16_t, McapSchema>& schemas() const { return summary_.schemas; }

 private:
  McapReader(std::string path, int file) : path_(std::move(path)), file_(file) {}
  // The next record; false at the end of the data, or of what there is of it.
  absl::StatusOr<bool> NextRecord(uint8_t* kind, std::string* content);
  absl::Status ReadChunk(std::string_view content,
                         const std::function<bool(const McapMessage&)>& each, bool* go_on);
  absl::Status TakeRecord(uint8_t kind, std::string_view content,
                          const std::function<bool(const McapMessage&)>& each, bool* go_on);
  absl::Status Damaged(std::string_view what) const;

  const std::string path_;
  int file_;
  uint64_t at_ = 0;
  McapSummary summary_;
};

}  // namespace voxeld::recording
