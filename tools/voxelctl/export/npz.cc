#include <zlib.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "common/text/printable.h"
#include "tools/voxelctl/export/export_files.h"
#include "tools/voxelctl/export/lit_pixels.h"
#include "tools/voxelctl/export/little_endian.h"
#include "tools/voxelctl/files/whole_file.h"

namespace voxeld::voxelctl {
namespace {

// The limit without ZIP64.
constexpr uint64_t kMost = std::numeric_limits<uint32_t>::max() - uint64_t{1};
constexpr uint16_t kDeflated = 8, kZipVersion = 20;
constexpr uint32_t kFirstOfJanuary1980 = 0x0021'0000;  // ZIP cannot omit the time

// Returns the header of an array file in "NPY" 1.0; the data after it begin at a multiple of 64.
std::string NpyHeader(const std::string& type, const std::string& shape) {
  std::string text =
      absl::StrCat("{'descr': '", type, "', 'fortran_order': False, 'shape': (", shape, "), }");
  constexpr size_t kBefore = 10;
  text.append(63 - (kBefore + text.size()) % 64, ' ');
  text += '\n';
  std::string out("\x93NUMPY\x01\x00", 8);
  PutU16(&out, static_cast<uint16_t>(text.size()));
  return out + text;
}

// Entries one after another, then the directory of all of them.
class Zip {
 public:
  Zip(std::string path, WholeFile* file) : path_(std::move(path)), file_(file) {}

  absl::Status Add(const std::string& name, const std::string& header, absl::string_view data) {
    const uint64_t size = header.size() + uint64_t{data.size()};
    if (size > kMost) return TooLarge(name, size);
    uLong crc = ::crc32_z(0, reinterpret_cast<const Bytef*>(header.data()), header.size());
    crc = ::crc32_z(crc, reinterpret_cast<const Bytef*>(data.data()), data.size());
    std::string packed;
    if (absl::Status status = Deflate(header, data, &packed); !status.ok()) return status;
    if (at_ + packed.size() > kMost) return TooLarge("the file", at_ + packed.size());

    std::string about;
    PutU16(&about, kZipVersion);
    PutU16(&about, 0);
    PutU16(&about, kDeflated);
    PutU32(&about, kFirstOfJanuary1980);
    PutU32(&about, static_cast<uint32_t>(crc));
    PutU32(&about, static_cast<uint32_t>(packed.size()));
    PutU32(&about, static_cast<uint32_t>(size));
    PutU16(&about, static_cast<uint16_t>(name.size()));
    PutU16(&about, 0);

    directory_ += "PK\x01\x02";
    PutU16(&directory_, kZipVersion);
    directory_ += about;
    directory_.append(10, '\0');  // no comment, the first disk, no attributes
    PutU32(&directory_, static_cast<uint32_t>(at_));
    directory_ += name;
    ++entries_;
    if (absl::Status status = Put(absl::StrCat("PK\x03\x04", about, name)); !status.ok())
      return status;
    return Put(packed);
  }

  absl::Status Finish(uint64_t* bytes) {
    std::string end = directory_;
    end += "PK\x05\x06";
    PutU32(&end, 0);
    PutU16(&end, entries_);
    PutU16(&end, entries_);
    PutU32(&end, static_cast<uint32_t>(directory_.size()));
    PutU32(&end, static_cast<uint32_t>(at_));
    PutU16(&end, 0);
    absl::Status status = Put(end);
    *bytes = at_;
    return status;
  }

 private:
  absl::Status Put(absl::string_view bytes) {
    at_ += bytes.size();
    return file_->Write(bytes);
  }

  absl::Status TooLarge(const std::string& what, uint64_t size) const {
    return absl::OutOfRangeError(absl::StrCat(EscapeForTerminal(path_), ": ", what, " has ", size,
                                              " bytes; ", kMost, " fit in, a .ply may"));
  }

  absl::Status Deflate(absl::string_view header, absl::string_view data, std::string* out) const {
    z_stream stream = {};
    // ZIP uses raw deflate.
    if (::deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, -MAX_WBITS, 8,
                       Z_DEFAULT_STRATEGY) != Z_OK) {
      return absl::ResourceExhaustedError(
          absl::StrCat(EscapeForTerminal(path_), ": there is no memory to pack it"));
    }
    std::string part(size_t{1} << 18, '\0');
    for (const absl::string_view in : {header, data}) {
      stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(in.data()));
      stream.avail_in = static_cast<uInt>(in.size());
      const int flush = in.data() == data.data() ? Z_FINISH : Z_NO_FLUSH;
      do {
        stream.next_out = reinterpret_cast<Bytef*>(part.data());
        stream.avail_out = static_cast<uInt>(part.size());
        ::deflate(&stream, flush);
        out->append(part.data(), part.size() - stream.avail_out);
      } while (stream.avail_out == 0);
    }
    ::deflateEnd(&stream);
    return absl::OkStatus();
  }

  const std::string path_;
  WholeFile* const file_;
  std::string directory_;
  uint64_t at_ = 0;
  uint16_t entries_ = 0;
};

const char* ShapeName(const display::Geometry& geometry) {
  if (std::holds_alternative<display::Rotor>(geometry.shape)) return "rotor";
  if (std::holds_alternative<display::Helix>(geometry.shape)) return "helix";
  if (std::holds_alternative<display::Lattice>(geometry.shape)) return "lattice";
  return "planar_stack";
}

std::string Metadata(const Volume& volume, uint64_t lit) {
  const display::VoxelGrid& grid = volume.geometry.grid;
  const nlohmann::ordered_json json = {
      {"display", volume.display},
      {"volume", volume.number},
      {"shape", ShapeName(volume.geometry)},
      {"slices", volume.slices},
      {"height", volume.height},
      {"width", volume.width},
      {"lit_pixels", lit},
      {"grid",
       {{"voxels", {grid.nx, grid.ny, grid.nz}},
        {"origin_mm", {grid.origin_mm.x, grid.origin_mm.y, grid.origin_mm.z}},
        {"pitch_mm", {grid.pitch_mm.x, grid.pitch_mm.y, grid.pitch_mm.z}}}}};
  return json.dump(-1, ' ', true, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace

absl::Status WriteNpz(const std::string& path, const Volume& volume, ExportSummary* summary) {
  *summary = {};
  std::string positions;
  ForEachLit(volume, [&](const display::Vec3& at, const uint8_t*) {
    ++summary->items;
    if (std::isnan(at.x)) ++summary->left_out;
    for (const double value : {at.x, at.y, at.z}) {
      PutF32(&positions, static_cast<float>(std::isnan(at.x) ? at.x : value));
    }
  });
  const absl::StatusOr<std::unique_ptr<WholeFile>> file = WholeFile::Create(path);
  if (!file.ok()) return file.status();
  Zip zip(path, file->get());
  absl::Status status = zip.Add(
      "rgb.npy",
      NpyHeader("|u1", absl::StrCat(volume.slices, ", ", volume.height, ", ", volume.width, ", 3")),
      {reinterpret_cast<const char*>(volume.rgb.data()), volume.rgb.size()});
  if (!status.ok()) return status;
  status =
      zip.Add("positions_mm.npy", NpyHeader("<f4", absl::StrCat(summary->items, ", 3")), positions);
  if (!status.ok()) return status;
  const std::string metadata = Metadata(volume, summary->items);
  status = zip.Add("metadata.npy", NpyHeader(absl::StrCat("|S", metadata.size()), ""), metadata);
  if (!status.ok()) return status;
  if (status = zip.Finish(&summary->bytes); !status.ok()) return status;
  return (*file)->Commit();
}

}  // namespace voxeld::voxelctl
