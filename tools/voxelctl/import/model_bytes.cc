#include "tools/voxelctl/import/model_bytes.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/text/printable.h"

namespace voxeld::voxelctl {
namespace {

constexpr std::array<char, 8> kMarker = {'V', 'X', 'M', 'O', 'D', 'E', 'L', kModelVersion};
constexpr char kOfAnotherRelease[] =
    ": voxeld-import and voxelctl are of different releases; install both packages of one release";

// Lists are written and read in chunks of this many bytes.
constexpr size_t kChunk = size_t{1} << 20;

// Limits of lists, in addition to those of the whole model (CheckModel).
constexpr uint64_t kMostTextBytes = 64 << 10, kMostItems = 1 << 20,
                   kMostPictureBytes = uint64_t{1} << 30;

// Releases the whole pages among these unused bytes to the system. Their
// contents become zero.
void GiveBackPages(const char* bytes, size_t size) {
  static const auto page = static_cast<uintptr_t>(::sysconf(_SC_PAGESIZE));
  const auto at = reinterpret_cast<uintptr_t>(bytes);
  const uintptr_t begin = (at + page - 1) / page * page, end = (at + size) / page * page;
  if (begin < end) ::madvise(reinterpret_cast<void*>(begin), end - begin, MADV_DONTNEED);
}

class ModelWriter {
 public:
  explicit ModelWriter(int descriptor) : descriptor_(descriptor) { buffer_.reserve(kBuffered); }

  // Flushes at the end. Returns: whether everything could be written.
  bool Finish() {
    Flush();
    return ok_;
  }

  void Bytes(const void* bytes, size_t size) {
    if (size > kBuffered - buffer_.size()) Flush();
    if (size > kBuffered) {
      Write(static_cast<const char*>(bytes), size);
    } else {
      buffer_.append(static_cast<const char*>(bytes), size);
    }
  }
  template <typename Number>
  void Value(Number number) {
    Bytes(&number, sizeof(number));
  }
  // Writes at most kMostTextBytes of it.
  void Text(absl::string_view text) { All(text.substr(0, kMostTextBytes)); }
  template <typename Values>
  void All(Values values) {
    Value(uint64_t{values.size()});
    const char* const bytes = reinterpret_cast<const char*>(values.data());
    const size_t size = values.size() * sizeof(values[0]);
    for (size_t from = 0; from < size; from += kChunk) {
      const size_t some = std::min(kChunk, size - from);
      Bytes(bytes + from, some);
      if (some == kChunk) GiveBackPages(bytes + from, some);
    }
  }

 private:
  static constexpr size_t kBuffered = size_t{64} << 10;

  void Flush() {
    Write(buffer_.data(), buffer_.size());
    buffer_.clear();
  }
  void Write(const char* at, size_t size) {
    while (size > 0 && ok_) {
      const ssize_t written = ::write(descriptor_, at, size);
      if (written < 0 && errno == EINTR) continue;
      ok_ = written > 0;
      if (ok_) at += written, size -= static_cast<size_t>(written);
    }
  }

  const int descriptor_;
  std::string buffer_;
  bool ok_ = true;
};

class ModelReader {
 public:
  explicit ModelReader(const TakeBytes& take) : take_(take) {}
  bool ok() const { return ok_; }

  void Bytes(void* out, size_t size) { ok_ = ok_ && (size == 0 || take_(out, size)); }
  template <typename Number>
  Number Value() {
    Number number = {};
    Bytes(&number, sizeof(number));
    return ok_ ? number : Number{};
  }
  bool Flag() { return Value<uint8_t>() != 0; }
  // Returns the number of a list's items, of which `most` are possible.
  uint64_t Count(uint64_t most) {
    const auto count = Value<uint64_t>();
    ok_ = ok_ && count <= most;
    return ok_ ? count : 0;
  }
  template <typename Values>
  void All(Values* values, uint64_t most) {
    const uint64_t count = Count(most);
    // Untouched memory is only address space, so a list's declared length costs nothing until the
    // items arrive.
    values->reserve(count);
    constexpr size_t kSome = kChunk / sizeof((*values)[0]);
    while (ok_ && values->size() < count) {
      const size_t from = values->size(), some = std::min<uint64_t>(kSome, count - from);
      values->resize(from + some);
      Bytes(values->data() + from, some * sizeof((*values)[0]));
    }
  }
  std::string Text() {
    std::string text;
    All(&text, kMostTextBytes);
    return text;
  }
  // Reads an enumeration whose last enumerator is `last`.
  template <typename Enum>
  Enum OneOf(Enum last) {
    const auto number = Value<uint8_t>();
    ok_ = ok_ && number <= static_cast<uint8_t>(last);
    return ok_ ? static_cast<Enum>(number) : Enum{};
  }

 private:
  const TakeBytes& take_;
  bool ok_ = true;
};

void WriteStatus(const absl::Status& status, ModelWriter& writer) {
  writer.Bytes(kMarker.data(), kMarker.size());
  writer.Value(static_cast<uint32_t>(status.code()));
  if (!status.ok()) writer.Text(status.message());
}

// Returns a code that readers use.
absl::StatusCode CodeOf(uint32_t code) {
  switch (static_cast<absl::StatusCode>(code)) {
    case absl::StatusCode::kNotFound:
    case absl::StatusCode::kPermissionDenied:
    case absl::StatusCode::kFailedPrecondition:
    case absl::StatusCode::kUnimplemented:
    case absl::StatusCode::kResourceExhausted:
      return static_cast<absl::StatusCode>(code);
    default:
      return absl::StatusCode::kInvalidArgument;
  }
}

// Reads the beginning of an answer: the error that was written, or OK if the result follows.
absl::Status ReadStatus(const SourceFile& file, ModelReader& reader, absl::Status* written) {
  std::array<char, kMarker.size()> marker = {};
  reader.Bytes(marker.data(), marker.size());
  if (!reader.ok()) return Spoilt(file, "gave up");
  if (std::equal(marker.begin(), marker.end() - 1, kMarker.begin()) &&
      marker.back() != kMarker.back()) {
    return absl::FailedPreconditionError(
        absl::StrCat(EscapeForTerminal(file.path), kOfAnotherRelease));
  }
  if (marker != kMarker) return Spoilt(file, "gave an answer that is none");
  const auto code = reader.Value<uint32_t>();
  if (code != 0) *written = absl::Status(CodeOf(code), reader.Text());
  return reader.ok() ? absl::OkStatus() : Spoilt(file, "gave up");
}

void WritePart(Part part, ModelWriter& writer) {
  writer.Value(part.kind);
  writer.Value(part.thickness);
  writer.All(std::move(part.positions));
  writer.All(std::move(part.normals));
  writer.All(std::move(part.colors));
  writer.All(std::move(part.indices));
  writer.All(std::move(part.texture_coordinates));
  writer.Value(part.picture);
  writer.Value(uint64_t{part.attributes.size()});
  for (Attribute& attribute : part.attributes) {
    writer.Text(attribute.name);
    writer.All(std::move(attribute.values));
  }
}

Part ReadPart(ModelReader& reader) {
  Part part;
  part.kind = reader.OneOf(Kind::kTriangles);
  part.thickness = reader.Value<double>();
  reader.All(&part.positions, kMaxModelVertices);
  reader.All(&part.normals, kMaxModelVertices);
  reader.All(&part.colors, kMaxModelVertices);
  reader.All(&part.indices, kMaxModelIndices);
  reader.All(&part.texture_coordinates, kMaxModelVertices);
  part.picture = reader.Value<uint32_t>();
  const uint64_t attributes = reader.Count(kMostItems);
  for (uint64_t i = 0; i < attributes && reader.ok(); ++i) {
    Attribute& attribute = part.attributes.emplace_back();
    attribute.name = reader.Text();
    reader.All(&attribute.values, kMaxModelVertices);
  }
  return part;
}

void WriteVolume(SampledVolume volume, ModelWriter& writer) {
  writer.Value(volume.size);
  writer.Value(volume.corners);
  writer.Value(static_cast<uint8_t>(volume.window.has_value()));
  if (volume.window) writer.Value(*volume.window);
  writer.All(std::move(volume.samples));
  writer.All(std::move(volume.colors));
}

SampledVolume ReadVolume(ModelReader& reader) {
  SampledVolume volume;
  volume.size = reader.Value<decltype(volume.size)>();
  volume.corners = reader.Value<decltype(volume.corners)>();
  if (reader.Flag()) volume.window = reader.Value<std::array<double, 2>>();
  reader.All(&volume.samples, kMaxModelSamples);
  reader.All(&volume.colors, kMaxModelSamples);
  return volume;
}

}  // namespace

absl::Status Spoilt(const SourceFile& file, absl::string_view how) {
  return FileError(file, absl::StrCat("the library that reads it ", how),
                   "the file is damaged or not what its name says");
}

bool WriteModel(absl::StatusOr<Model> model, int descriptor) {
  ModelWriter writer(descriptor);
  WriteStatus(model.status(), writer);
  if (!model.ok()) return writer.Finish();
  writer.Text(model->path);
  writer.Text(model->format);
  writer.Text(model->note);
  writer.Value(uint64_t{model->left_out.size()});
  for (const LeftOut& one : model->left_out) {
    writer.Text(one.kind);
    writer.Value(one.count);
  }
  writer.Value(model->up);
  writer.Value(model->unit);
  for (const bool flag : {model->globe, model->molecule, model->lit_already})
    writer.Value(static_cast<uint8_t>(flag));
  writer.Value(uint64_t{model->parts.size()});
  for (Part& part : model->parts) WritePart(std::move(part), writer);
  writer.Value(uint64_t{model->volumes.size()});
  for (SampledVolume& volume : model->volumes) WriteVolume(std::move(volume), writer);
  writer.Value(uint64_t{model->pictures.size()});
  for (std::string& picture : model->pictures) writer.All(std::move(picture));
  return writer.Finish();
}

bool WriteFrameCount(const absl::StatusOr<int64_t>& count, int descriptor) {
  ModelWriter writer(descriptor);
  WriteStatus(count.status(), writer);
  if (count.ok()) writer.Value(*count);
  return writer.Finish();
}

absl::Status ReadModel(const SourceFile& file, const TakeBytes& take,
                       absl::StatusOr<Model>* model) {
  ModelReader reader(take);
  absl::Status error;
  if (absl::Status status = ReadStatus(file, reader, &error); !status.ok()) return status;
  if (!error.ok()) {
    *model = std::move(error);
    return absl::OkStatus();
  }
  Model read;
  read.path = reader.Text();
  read.format = reader.Text();
  read.note = reader.Text();
  const uint64_t kinds = reader.Count(kMostItems);
  for (uint64_t i = 0; i < kinds && reader.ok(); ++i) {
    LeftOut& one = read.left_out.emplace_back();
    one.kind = reader.Text();
    one.count = reader.Value<uint64_t>();
  }
  read.up = reader.OneOf(Up::kZ);
  read.unit = reader.Value<double>();
  read.globe = reader.Flag();
  read.molecule = reader.Flag();
  read.lit_already = reader.Flag();
  const uint64_t parts = reader.Count(kMaxModelVertices);
  for (uint64_t i = 0; i < parts && reader.ok(); ++i) read.parts.push_back(ReadPart(reader));
  const uint64_t volumes = reader.Count(kMostItems);
  for (uint64_t i = 0; i < volumes && reader.ok(); ++i) read.volumes.push_back(ReadVolume(reader));
  const uint64_t pictures = reader.Count(kMostItems);
  for (uint64_t i = 0; i < pictures && reader.ok(); ++i)
    reader.All(&read.pictures.emplace_back(), kMostPictureBytes);
  if (!reader.ok()) return Spoilt(file, "gave up halfway");
  *model = std::move(read);
  return absl::OkStatus();
}

absl::Status ReadFrameCount(const SourceFile& file, const TakeBytes& take,
                            absl::StatusOr<int64_t>* count) {
  ModelReader reader(take);
  absl::Status error;
  if (absl::Status status = ReadStatus(file, reader, &error); !status.ok()) return status;
  const auto read = error.ok() ? reader.Value<int64_t>() : 0;
  if (!reader.ok()) return Spoilt(file, "gave up");
  if (error.ok()) {
    *count = read;
  } else {
    *count = std::move(error);
  }
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
