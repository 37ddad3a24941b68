// Shared by the tests of volume files.
#pragma once

#include <gtest/gtest.h>
#include <zlib.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

#include "absl/status/statusor.h"
#include "tests/tools/import/read_here.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {

inline std::string Gzip(const std::string& bytes) {
  z_stream stream = {};
  deflateInit2(&stream, 9, Z_DEFLATED, 15 + 16, 9, Z_DEFAULT_STRATEGY);
  std::string out(compressBound(bytes.size()) + 64, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

template <typename T>
void Put(std::string* out, size_t at, T value) {
  if (out->size() < at + sizeof(value)) out->resize(at + sizeof(value), '\0');
  std::memcpy(out->data() + at, &value, sizeof(value));
}

class Volumes : public testing::Test {
 protected:
  absl::StatusOr<Model> Import(const std::string& name, const std::string& bytes,
                               const ImportOptions& options = {}) {
    return ReadHere(folder_.Write(name, bytes), options);
  }
  SampledVolume Read(const std::string& name, const std::string& bytes,
                     const ImportOptions& options = {}) {
    const auto model = Import(name, bytes, options);
    EXPECT_TRUE(model.ok()) << model.status();
    return model.ok() ? model->volumes.at(0) : SampledVolume();
  }
  std::string Error(const std::string& name, const std::string& bytes,
                    const ImportOptions& options = {}) {
    return std::string(Import(name, bytes, options).status().message());
  }

  TempFolder folder_;
};

}  // namespace voxeld::voxelctl
