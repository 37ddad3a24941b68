// Reads and writes MCAP files (https://mcap.dev/spec, version 0): messages with times, on channels
// that name their schema, in compressed chunks with an index. Other tools can open the files that
// are written here, and the reverse.
//
//   magic, Header
//   Chunk (zstd, CRC of the contents): Schema and Channel records before their first message, Messages
//   MessageIndex for each channel of the chunk, …
//   DataEnd (CRC of everything before it)
//   summary: Schemas, Channels, Statistics, ChunkIndexes; SummaryOffsets
//   Footer (CRC of the summary), magic
//
// A file that ends early, for example because its writer was killed, has all its complete chunks;
// McapReader accepts it.
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
  std::string name, encoding, data;  // for "protobuf": a FileDescriptorSet
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
  // A chunk ends with the message that makes it at least this large.
  static constexpr size_t kChunkBytes = 1u << 20;

  // Creates a new file. `library` names the writer. Errors: AlreadyExists if the file exists.
  static absl::StatusOr<std::unique_ptr<McapWriter>> Create(const std::string& path,
                                                            const std::string& library);
  // Without Close, the file ends after its last complete chunk.
  ~McapWriter();
  McapWriter(const McapWriter&) = delete;
  McapWriter& operator=(const McapWriter&) = delete;

  // Add a schema or channel. Requires: called before the first message that uses it. Returns: its
  // number, counted from 1.
  uint16_t AddSchema(McapSchema schema);
  uint16_t AddChannel(McapChannel channel);

  absl::Status Write(const McapMessage& message);
  // Ends the current chunk, and syncs everything to the disk.
  absl::Status Flush();
  // Ends the chunk and writes the index. Nothing can be written afterwards.
  absl::Status Close();

  uint64_t bytes() const { return written_; }  // file size so far
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
  uint32_t crc_ = 0;  // of everything so far
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
  bool whole = false;  // the file has an end; otherwise it is truncated
  std::map<uint16_t, McapSchema> schemas;
  std::map<uint16_t, McapChannel> channels;
};

// Reads from front to end, chunk by chunk, so files of any size, including truncated ones, are read
// in the same way. Not thread-safe.
class McapReader {
 public:
  // The maximum uncompressed size of a chunk, which limits the memory that a file may require.
  static constexpr uint64_t kMostChunkBytes = uint64_t{4} << 30;

  // Opens a file. Errors: NotFound; InvalidArgument if it is not an MCAP file.
  static absl::StatusOr<std::unique_ptr<McapReader>> Open(const std::string& path);
  ~McapReader();

  // Reads the file once and returns a summary; then rewinds. Errors: DataLoss with the offset if a
  // chunk is damaged.
  absl::StatusOr<McapSummary> Summarise();

  // Calls `each` with every message from the current position on, in the file's order, until it
  // returns false. A truncated file ends with its last complete chunk. Errors: DataLoss as above.
  absl::Status Read(const std::function<bool(const McapMessage&)>& each);
  void Rewind();

  // Return what is known so far.
  const std::map<uint16_t, McapChannel>& channels() const { return summary_.channels; }
  const std::map<uint16_t, McapSchema>& schemas() const { return summary_.schemas; }

 private:
  McapReader(std::string path, int file) : path_(std::move(path)), file_(file) {}
  // Reads the next record. Returns false at the end of the data, or of the available part of it.
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
