#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <cerrno>
#include <memory>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "tools/recording/mcap.h"
#include "tools/recording/mcap_bytes.h"

namespace voxeld::recording {
namespace {

constexpr uint64_t kMostRecordBytes = (uint64_t{4} << 30) + (uint64_t{1} << 20);

// Returns how many bytes were read; fewer than `size` only at the end of the file.
absl::StatusOr<size_t> ReadAt(int file, uint64_t at, char* into, size_t size) {
  size_t got = 0;
  while (got < size) {
    const ssize_t n = pread(file, into + got, size - got, static_cast<off_t>(at + got));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return absl::ErrnoToStatus(errno, "reading");
    if (n == 0) break;
    got += static_cast<size_t>(n);
  }
  return got;
}

// Returns false unless the data expand to exactly `size` bytes. Memory grows with the actual data,
// whatever size is declared.
bool Unpack(std::string_view compressed, uint64_t size, std::string* plain) {
  const std::unique_ptr<ZSTD_DStream, size_t (*)(ZSTD_DStream*)> stream(ZSTD_createDStream(),
                                                                        &ZSTD_freeDStream);
  if (stream == nullptr) return false;
  ZSTD_inBuffer in = {compressed.data(), compressed.size(), 0};
  size_t left = 1;  // of the frame; 0: it is complete
  while (left > 0 || in.pos < in.size) {
    const size_t before = plain->size(), consumed = in.pos;
    plain->resize(std::min<uint64_t>(size, before + ZSTD_DStreamOutSize()));
    ZSTD_outBuffer out = {plain->data() + before, plain->size() - before, 0};
    left = ZSTD_decompressStream(stream.get(), &out, &in);
    plain->resize(before + out.pos);
    if (ZSTD_isError(left)) return false;
    if (out.pos == 0 && in.pos == consumed && left > 0) return false;  // too long, or truncated
  }
  return plain->size() == size;
}

}  // namespace

absl::StatusOr<std::unique_ptr<McapReader>> McapReader::Open(const std::string& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return absl::ErrnoToStatus(errno, path);
  std::unique_ptr<McapReader> reader(new McapReader(path, file));
  char magic[8] = {};
  const absl::StatusOr<size_t> got = ReadAt(file, 0, magic, sizeof(magic));
  if (!got.ok()) return got.status();
  if (std::string_view(magic, *got) != kMcapMagic) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, " is no MCAP file: it does not begin with its magic bytes"));
  }
  reader->Rewind();
  return reader;
}

McapReader::~McapReader() { close(file_); }

void McapReader::Rewind() { at_ = kMcapMagic.size(); }

absl::Status McapReader::Damaged(std::string_view what) const {
  return absl::DataLossError(absl::StrCat(path_, " is damaged at byte ", at_, ": ",
                                          absl::string_view(what.data(), what.size())));
}

absl::StatusOr<bool> McapReader::NextRecord(uint8_t* kind, std::string* content) {
  char head[kRecordHead];
  const absl::StatusOr<size_t> got = ReadAt(file_, at_, head, sizeof(head));
  if (!got.ok()) return got.status();
  if (*got < sizeof(head)) return false;
  McapParse parse(std::string_view(head, sizeof(head)));
  *kind = parse.Number<uint8_t>();
  const uint64_t size = parse.Number<uint64_t>();
  if (*kind == 0 || size > kMostRecordBytes) return Damaged("it has no record there");
  struct stat found;
  if (fstat(file_, &found) == 0 &&
      static_cast<uint64_t>(found.st_size) < at_ + kRecordHead + size) {
    return false;  // the file is truncated
  }
  content->resize(size);
  const absl::StatusOr<size_t> body = ReadAt(file_, at_ + kRecordHead, content->data(), size);
  if (!body.ok()) return body.status();
  if (*body < size) return false;
  return true;
}

absl::Status McapReader::Read(const std::function<bool(const McapMessage&)>& each) {
  bool go_on = true;
  std::string content;
  while (go_on) {
    uint8_t kind = 0;
    const absl::StatusOr<bool> more = NextRecord(&kind, &content);
    if (!more.ok()) return more.status();
    if (!*more) {
      summary_.whole = false;
      return absl::OkStatus();
    }
    if (kind == kDataEnd) {
      summary_.whole = true;
      return absl::OkStatus();
    }
    if (absl::Status status = TakeRecord(kind, content, each, &go_on); !status.ok()) return status;
    at_ += kRecordHead + content.size();
  }
  return absl::OkStatus();
}

absl::Status McapReader::TakeRecord(uint8_t kind, std::string_view content,
                                    const std::function<bool(const McapMessage&)>& each,
                                    bool* go_on) {
  McapParse parse(content);
  switch (kind) {
    case kSchema: {
      const auto id = parse.Number<uint16_t>();
      McapSchema schema;
      schema.name = std::string(parse.Text());
      schema.encoding = std::string(parse.Text());
      schema.data = std::string(parse.Text());
      if (!parse.ok()) return Damaged("a schema is cut short");
      summary_.schemas[id] = std::move(schema);
      return absl::OkStatus();
    }
    case kChannel: {
      const auto id = parse.Number<uint16_t>();
      McapChannel channel;
      channel.schema = parse.Number<uint16_t>();
      channel.topic = std::string(parse.Text());
      channel.encoding = std::string(parse.Text());
      channel.metadata = parse.Map();
      if (!parse.ok()) return Damaged("a channel is cut short");
      summary_.channels[id] = std::move(channel);
      return absl::OkStatus();
    }
    case kMessage: {
      McapMessage message;
      message.channel = parse.Number<uint16_t>();
      message.sequence = parse.Number<uint32_t>();
      message.log_time_ns = parse.Number<uint64_t>();
      message.publish_time_ns = parse.Number<uint64_t>();
      message.data = parse.rest();
      if (!parse.ok()) return Damaged("a message is cut short");
      *go_on = each(message);
      return absl::OkStatus();
    }
    case kChunk:
      ++summary_.chunks;
      return ReadChunk(content, each, go_on);
    default:
      return absl::OkStatus();  // indexes, and records of later versions
  }
}

absl::Status McapReader::ReadChunk(std::string_view content,
                                   const std::function<bool(const McapMessage&)>& each,
                                   bool* go_on) {
  McapParse parse(content);
  parse.Number<uint64_t>();
  parse.Number<uint64_t>();
  const auto size = parse.Number<uint64_t>();
  const auto crc = parse.Number<uint32_t>();
  const std::string_view compression = parse.Text();
  const std::string_view compressed = parse.Bytes(parse.Number<uint64_t>());
  if (!parse.ok() || size > kMostChunkBytes) return Damaged("a chunk is cut short, or too large");
  std::string plain;
  if (compression == "zstd") {
    if (!Unpack(compressed, size, &plain)) return Damaged("a chunk cannot be unpacked");
  } else if (compression.empty()) {
    plain = std::string(compressed);
  } else {
    return absl::UnimplementedError(
        absl::StrCat(path_, " has a chunk packed by \"",
                     absl::CHexEscape(absl::string_view(compression.data(), compression.size())),
                     "\"; zstd and none are read"));
  }
  const auto found = static_cast<uint32_t>(
      crc32_z(0, reinterpret_cast<const unsigned char*>(plain.data()), plain.size()));
  if (crc != 0 && found != crc) return Damaged("a chunk's CRC is another");
  McapParse records(plain);
  while (*go_on && !records.rest().empty()) {
    const auto kind = records.Number<uint8_t>();
    const std::string_view record = records.Bytes(records.Number<uint64_t>());
    if (!records.ok() || kind == kChunk) return Damaged("a chunk's records are cut short");
    if (absl::Status status = TakeRecord(kind, record, each, go_on); !status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::StatusOr<McapSummary> McapReader::Summarise() {
  Rewind();
  summary_ = McapSummary();
  summary_.start_ns = UINT64_MAX;
  const absl::Status status = Read([this](const McapMessage& message) {
    ++summary_.messages;
    summary_.start_ns = std::min(summary_.start_ns, message.log_time_ns);
    summary_.end_ns = std::max(summary_.end_ns, message.log_time_ns);
    return true;
  });
  Rewind();
  if (!status.ok()) return status;
  if (summary_.messages == 0) summary_.start_ns = 0;
  return summary_;
}

}  // namespace voxeld::recording
