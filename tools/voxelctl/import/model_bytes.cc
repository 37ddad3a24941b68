#include "tools/voxelctl/import/model_bytes.h"

#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::voxelctl {
namespace {

constexpr uint64_t kMostMessageBytes = 64 << 10;

class ModelWriter {
 public:
  explicit ModelWriter(int descriptor) : descriptor_(descriptor) {}
  bool ok() const { return ok_; }

  void Bytes(const void* bytes, size_t size) {
    const char* at = static_cast<const char*>(bytes);
    while (size > 0 && ok_) {
      const ssize_t written = ::write(descriptor_, at, size);
      if (written < 0 && errno == EINTR) continue;
      ok_ = written > 0;
      if (ok_) at += written, size -= static_cast<size_t>(written);
    }
  }
  template <typename Vector>
  void All(const Vector& values) {
    const uint64_t count = values.size();
    Bytes(&count, sizeof(count));
    Bytes(values.data(), count * sizeof(values[0]));
  }

 private:
  const int descriptor_;
  bool ok_ = true;
};

class ModelReader {
 public:
  ModelReader(const char* at, size_t size) : at_(at), left_(size) {}
  bool ok() const { return ok_; }

  void Bytes(void* out, size_t size) {
    ok_ &= size <= left_;
    if (!ok_ || size == 0) return;
    std::memcpy(out, at_, size);
    at_ += size;
    left_ -= size;
  }
  template <typename Vector>
  void All(Vector* values) {
    uint64_t count = 0;
    Bytes(&count, sizeof(count));
    ok_ &= count <= left_ / sizeof((*values)[0]);
    if (!ok_) return;
    values->resize(count);
    Bytes(values->data(), count * sizeof((*values)[0]));
  }

 private:
  const char* at_;
  size_t left_;
  bool ok_ = true;
};

void WriteVolume(const SampledVolume& volume, ModelWriter& writer) {
  const uint8_t has_window = volume.window.has_value();
  writer.Bytes(&volume.size, sizeof(volume.size));
  writer.Bytes(&volume.corners, sizeof(volume.corners));
  writer.Bytes(&has_window, 1);
  if (has_window) writer.Bytes(&*volume.window, sizeof(*volume.window));
  writer.All(volume.samples);
  writer.All(volume.colors);
}

SampledVolume ReadVolume(ModelReader& reader) {
  SampledVolume volume;
  uint8_t has_window = 0;
  reader.Bytes(&volume.size, sizeof(volume.size));
  reader.Bytes(&volume.corners, sizeof(volume.corners));
  reader.Bytes(&has_window, 1);
  if (has_window != 0) reader.Bytes(&volume.window.emplace(), sizeof(*volume.window));
  reader.All(&volume.samples);
  reader.All(&volume.colors);
  return volume;
}

}  // namespace

bool WriteModel(const absl::StatusOr<Model>& model, int descriptor) {
  ModelWriter writer(descriptor);
  const int code = model.status().raw_code();
  writer.Bytes(&code, sizeof(code));
  if (!model.ok()) {
    writer.All(std::string(model.status().message()));
    return writer.ok();
  }
  const uint64_t parts = model->parts.size(), volumes = model->volumes.size();
  writer.All(model->path);
  writer.All(model->format);
  writer.All(model->note);
  const uint64_t kinds = model->left_out.size();
  writer.Bytes(&kinds, sizeof(kinds));
  for (const LeftOut& one : model->left_out) {
    writer.All(one.kind);
    writer.Bytes(&one.count, sizeof(one.count));
  }
  writer.Bytes(&model->up, sizeof(model->up));
  writer.Bytes(&model->globe, sizeof(model->globe));
  writer.Bytes(&model->molecule, sizeof(model->molecule));
  writer.Bytes(&model->lit_already, sizeof(model->lit_already));
  writer.Bytes(&parts, sizeof(parts));
  for (const Part& part : model->parts) {
    writer.Bytes(&part.kind, sizeof(part.kind));
    writer.Bytes(&part.thickness, sizeof(part.thickness));
    writer.All(part.positions);
    writer.All(part.normals);
    writer.All(part.colors);
    writer.All(part.indices);
    writer.All(part.texture_coordinates);
    writer.Bytes(&part.picture, sizeof(part.picture));
    const uint64_t attributes = part.attributes.size();
    writer.Bytes(&attributes, sizeof(attributes));
    for (const Attribute& attribute : part.attributes) {
      writer.All(attribute.name);
      writer.All(attribute.values);
    }
  }
  writer.Bytes(&volumes, sizeof(volumes));
  for (const SampledVolume& volume : model->volumes) WriteVolume(volume, writer);
  const uint64_t pictures = model->pictures.size();
  writer.Bytes(&pictures, sizeof(pictures));
  for (const std::string& picture : model->pictures) writer.All(picture);
  return writer.ok();
}

absl::Status Spoilt(const SourceFile& file, absl::string_view how) {
  return FileError(file, absl::StrCat("the library that reads it ", how),
                   "the file is damaged or not what its name says");
}

namespace {

// One of those that readers use.
absl::StatusCode CodeOf(int code) {
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

}  // namespace

absl::StatusOr<Model> ReadModel(const SourceFile& file, const char* bytes, size_t size) {
  ModelReader reader(bytes, size);
  int code = 0;
  reader.Bytes(&code, sizeof(code));
  if (code != 0) {
    std::string message;
    reader.All(&message);
    if (!reader.ok() || message.size() > kMostMessageBytes) return Spoilt(file, "gave up");
    return absl::Status(CodeOf(code), message);
  }
  Model model;
  uint64_t parts = 0, volumes = 0;
  uint8_t up = 0, globe = 0, molecule = 0, lit_already = 0;
  reader.All(&model.path);
  reader.All(&model.format);
  reader.All(&model.note);
  uint64_t kinds = 0;
  reader.Bytes(&kinds, sizeof(kinds));
  for (uint64_t i = 0; i < kinds && reader.ok(); ++i) {
    LeftOut one;
    reader.All(&one.kind);
    reader.Bytes(&one.count, sizeof(one.count));
    model.left_out.push_back(std::move(one));
  }
  reader.Bytes(&up, 1);
  reader.Bytes(&globe, 1);
  reader.Bytes(&molecule, 1);
  reader.Bytes(&lit_already, 1);
  if (up > static_cast<uint8_t>(Up::kZ)) return Spoilt(file, "gave up halfway");
  model.up = static_cast<Up>(up);
  model.globe = globe != 0;
  model.molecule = molecule != 0;
  model.lit_already = lit_already != 0;
  reader.Bytes(&parts, sizeof(parts));
  for (uint64_t i = 0; i < parts && reader.ok(); ++i) {
    Part part;
    uint8_t kind = 0;
    reader.Bytes(&kind, 1);
    if (kind > static_cast<uint8_t>(Kind::kTriangles)) return Spoilt(file, "gave up halfway");
    part.kind = static_cast<Kind>(kind);
    reader.Bytes(&part.thickness, sizeof(part.thickness));
    reader.All(&part.positions);
    reader.All(&part.normals);
    reader.All(&part.colors);
    reader.All(&part.indices);
    reader.All(&part.texture_coordinates);
    reader.Bytes(&part.picture, sizeof(part.picture));
    uint64_t attributes = 0;
    reader.Bytes(&attributes, sizeof(attributes));
    for (uint64_t a = 0; a < attributes && reader.ok(); ++a) {
      Attribute attribute;
      reader.All(&attribute.name);
      reader.All(&attribute.values);
      part.attributes.push_back(std::move(attribute));
    }
    model.parts.push_back(std::move(part));
  }
  reader.Bytes(&volumes, sizeof(volumes));
  for (uint64_t i = 0; i < volumes && reader.ok(); ++i) model.volumes.push_back(ReadVolume(reader));
  uint64_t pictures = 0;
  reader.Bytes(&pictures, sizeof(pictures));
  for (uint64_t i = 0; i < pictures && reader.ok(); ++i) reader.All(&model.pictures.emplace_back());
  if (!reader.ok()) return Spoilt(file, "gave up halfway");
  return model;
}

}  // namespace voxeld::voxelctl
