#include <fcntl.h>
#include <unistd.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <cerrno>
#include <utility>

#include "absl/strings/str_cat.h"
#include "tools/recording/mcap.h"
#include "tools/recording/mcap_bytes.h"

namespace voxeld::recording {
namespace {

constexpr int kLevel = 1;  // fast enough for any stream
constexpr std::string_view kZstd = "zstd";

uint32_t Crc(uint32_t before, std::string_view bytes) {
  return static_cast<uint32_t>(
      crc32_z(before, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
}

std::string SchemaRecord(uint16_t id, const McapSchema& schema) {
  return McapBytes()
      .Number(id)
      .Text(schema.name)
      .Text(schema.encoding)
      .Text(schema.data)
      .Record(kSchema);
}

std::string ChannelRecord(uint16_t id, const McapChannel& channel) {
  return McapBytes()
      .Number(id)
      .Number(channel.schema)
      .Text(channel.topic)
      .Text(channel.encoding)
      .Map(channel.metadata)
      .Record(kChannel);
}

}  // namespace

absl::StatusOr<std::unique_ptr<McapWriter>> McapWriter::Create(const std::string& path,
                                                               const std::string& library) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (file < 0) return absl::ErrnoToStatus(errno, path);
  std::unique_ptr<McapWriter> writer(new McapWriter(path, file));
  absl::Status status = writer->Put(kMcapMagic);
  if (status.ok()) status = writer->Put(McapBytes().Text("").Text(library).Record(kHeader));
  if (!status.ok()) return status;
  return writer;
}

McapWriter::~McapWriter() {
  if (file_ >= 0) close(file_);
}

uint16_t McapWriter::AddSchema(McapSchema schema) {
  schemas_.push_back(std::move(schema));
  return static_cast<uint16_t>(schemas_.size());
}

uint16_t McapWriter::AddChannel(McapChannel channel) {
  channels_.push_back(std::move(channel));
  return static_cast<uint16_t>(channels_.size());
}

absl::Status McapWriter::Put(std::string_view bytes) {
  if (failed_ || file_ < 0) {
    return absl::FailedPreconditionError(absl::StrCat(path_, " cannot be written any more"));
  }
  for (std::string_view rest = bytes; !rest.empty();) {
    const ssize_t n = write(file_, rest.data(), rest.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      const int error = n < 0 ? errno : ENOSPC;
      failed_ = true;  // the end of the file is unknown
      return absl::ErrnoToStatus(error, path_);
    }
    rest.remove_prefix(static_cast<size_t>(n));
  }
  crc_ = Crc(crc_, bytes);
  written_ += bytes.size();
  return absl::OkStatus();
}

absl::Status McapWriter::Write(const McapMessage& message) {
  if (failed_) {
    return absl::FailedPreconditionError(absl::StrCat(path_, " cannot be written any more"));
  }
  for (; schemas_written_ < schemas_.size(); ++schemas_written_) {
    chunk_ += SchemaRecord(static_cast<uint16_t>(schemas_written_ + 1), schemas_[schemas_written_]);
  }
  for (; channels_written_ < channels_.size(); ++channels_written_) {
    chunk_ +=
        ChannelRecord(static_cast<uint16_t>(channels_written_ + 1), channels_[channels_written_]);
  }
  if (chunk_messages_.empty()) chunk_start_ = chunk_end_ = message.log_time_ns;
  chunk_start_ = std::min(chunk_start_, message.log_time_ns);
  chunk_end_ = std::max(chunk_end_, message.log_time_ns);
  chunk_messages_[message.channel].emplace_back(message.log_time_ns, chunk_.size());
  chunk_ += McapBytes()
                .Number(message.channel)
                .Number(message.sequence)
                .Number(message.log_time_ns)
                .Number(message.publish_time_ns)
                .Raw(message.data)
                .Record(kMessage);
  ++counts_[message.channel];
  ++messages_;
  start_ = std::min(start_, message.log_time_ns);
  end_ = std::max(end_, message.log_time_ns);
  return chunk_.size() < kChunkBytes ? absl::OkStatus() : EndChunk();
}

absl::Status McapWriter::EndChunk() {
  if (chunk_.empty()) return absl::OkStatus();
  std::string compressed(ZSTD_compressBound(chunk_.size()), '\0');
  const size_t size =
      ZSTD_compress(compressed.data(), compressed.size(), chunk_.data(), chunk_.size(), kLevel);
  if (ZSTD_isError(size)) {
    return absl::ResourceExhaustedError(absl::StrCat("zstd: ", ZSTD_getErrorName(size)));
  }
  compressed.resize(size);
  ChunkIndex index{.start_time = chunk_start_,
                   .end_time = chunk_end_,
                   .offset = written_,
                   .compressed = compressed.size(),
                   .uncompressed = chunk_.size()};
  std::string bytes = McapBytes()
                          .Number(chunk_start_)
                          .Number(chunk_end_)
                          .Number(uint64_t{chunk_.size()})
                          .Number(Crc(0, chunk_))
                          .Text(kZstd)
                          .Number(uint64_t{compressed.size()})
                          .Raw(compressed)
                          .Record(kChunk);
  index.length = bytes.size();
  for (const auto& [channel, messages] : chunk_messages_) {
    McapBytes entries;
    for (const auto& [time, offset] : messages) entries.Number(time).Number(offset);
    index.index_offsets[channel] = written_ + bytes.size();
    bytes += McapBytes().Number(channel).Map(entries).Record(kMessageIndex);
  }
  index.index_length = bytes.size() - index.length;
  // A chunk and its index are written together, so a truncated file contains no partial pair.
  if (absl::Status status = Put(bytes); !status.ok()) return status;
  chunks_.push_back(std::move(index));
  chunk_.clear();
  chunk_messages_.clear();
  return absl::OkStatus();
}

absl::Status McapWriter::Flush() {
  if (absl::Status status = EndChunk(); !status.ok()) return status;
  if (fdatasync(file_) != 0 && errno != EINVAL && errno != ENOSYS) {
    return absl::ErrnoToStatus(errno, path_);
  }
  return absl::OkStatus();
}

absl::Status McapWriter::Close() {
  if (absl::Status status = EndChunk(); !status.ok()) return status;
  if (absl::Status status = Put(McapBytes().Number(crc_).Record(kDataEnd)); !status.ok()) {
    return status;
  }
  const uint64_t summary_start = written_;
  std::string summary;
  std::string offset_records;
  const auto group = [&](uint8_t kind, const std::string& records) {
    if (records.empty()) return;
    offset_records += McapBytes()
                          .Number(kind)
                          .Number(summary_start + summary.size())
                          .Number(uint64_t{records.size()})
                          .Record(kSummaryOffset);
    summary += records;
  };
  std::string records;
  for (size_t i = 0; i < schemas_.size(); ++i) {
    records += SchemaRecord(static_cast<uint16_t>(i + 1), schemas_[i]);
  }
  group(kSchema, std::exchange(records, {}));
  for (size_t i = 0; i < channels_.size(); ++i) {
    records += ChannelRecord(static_cast<uint16_t>(i + 1), channels_[i]);
  }
  group(kChannel, std::exchange(records, {}));
  McapBytes counts;
  for (const auto& [channel, count] : counts_) counts.Number(channel).Number(count);
  group(kStatistics, McapBytes()
                         .Number(messages_)
                         .Number(static_cast<uint16_t>(schemas_.size()))
                         .Number(static_cast<uint32_t>(channels_.size()))
                         .Number(uint32_t{0})  // attachments
                         .Number(uint32_t{0})  // metadata
                         .Number(static_cast<uint32_t>(chunks_.size()))
                         .Number(messages_ == 0 ? 0 : start_)
                         .Number(end_)
                         .Map(counts)
                         .Record(kStatistics));
  for (const ChunkIndex& chunk : chunks_) {
    McapBytes index_offsets;
    for (const auto& [channel, offset] : chunk.index_offsets) {
      index_offsets.Number(channel).Number(offset);
    }
    records += McapBytes()
                   .Number(chunk.start_time)
                   .Number(chunk.end_time)
                   .Number(chunk.offset)
                   .Number(chunk.length)
                   .Map(index_offsets)
                   .Number(chunk.index_length)
                   .Text(kZstd)
                   .Number(chunk.compressed)
                   .Number(chunk.uncompressed)
                   .Record(kChunkIndex);
  }
  group(kChunkIndex, records);
  const uint64_t offsets_start = summary_start + summary.size();
  // The footer's CRC covers the summary and the footer's own first fields.
  const std::string footer_head = McapBytes()
                                      .Number(uint8_t{kFooter})
                                      .Number(uint64_t{20})
                                      .Number(summary_start)
                                      .Number(offsets_start)
                                      .text();
  const std::string end = summary + offset_records + footer_head;
  const uint32_t crc = Crc(0, end);
  if (absl::Status status = Put(end + McapBytes().Number(crc).text() + std::string(kMcapMagic));
      !status.ok()) {
    return status;
  }
  const int file = std::exchange(file_, -1);
  const bool synced = fdatasync(file) == 0 || errno == EINVAL || errno == ENOSYS;
  const int error = errno;
  if (close(file) != 0) return absl::ErrnoToStatus(errno, path_);
  return synced ? absl::OkStatus() : absl::ErrnoToStatus(error, path_);
}

}  // namespace voxeld::recording
