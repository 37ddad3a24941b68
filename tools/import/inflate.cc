#include "tools/import/inflate.h"

#include <zlib.h>

#include <algorithm>
#include <memory>

#include "absl/strings/str_cat.h"

namespace voxeld::voxelctl {
namespace {

// zlib's window bits, which also select the header: of gzip, of gzip or zlib, or none; each with
// the largest window.
constexpr int kGzipAlone = 15 + 16, kGzipOrZlib = 15 + 32, kNoHeader = -15;
constexpr uint64_t kStep = 1 << 20;

}  // namespace

absl::Status InflatePieces(const SourceFile& file, absl::string_view packed, uint64_t most,
                           Deflated kind, const std::function<void(absl::string_view)>& take) {
  z_stream stream = {};
  const int window = kind == Deflated::kGzip     ? kGzipAlone
                     : kind == Deflated::kEither ? kGzipOrZlib
                                                 : kNoHeader;
  if (inflateInit2(&stream, window) != Z_OK) {
    return absl::ResourceExhaustedError(absl::StrCat(file.path, ": no memory to decompress it"));
  }
  const std::unique_ptr<z_stream, int (*)(z_stream*)> end(&stream, inflateEnd);
  const auto piece = std::make_unique_for_overwrite<char[]>(kStep);
  size_t read = 0;
  uint64_t written = 0;
  while (written < most) {
    const size_t given = std::min<size_t>(packed.size() - read, uint64_t{1} << 30);
    const size_t room = std::min(kStep, most - written);
    // zlib does not write to the input.
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data() + read));
    stream.avail_in = static_cast<uInt>(given);
    stream.next_out = reinterpret_cast<Bytef*>(piece.get());
    stream.avail_out = static_cast<uInt>(room);
    const int result = inflate(&stream, Z_NO_FLUSH);
    const size_t made = room - stream.avail_out;
    read += given - stream.avail_in;
    written += made;
    if (made > 0) take({piece.get(), made});
    if (result == Z_STREAM_END) {
      // Some programs write several streams, one after another.
      if (kind == Deflated::kRaw || packed.size() - read < 2 ||
          packed.substr(read, 2) != "\x1f\x8b")
        break;
      if (inflateReset(&stream) != Z_OK) break;
      continue;
    }
    if (result != Z_OK || (made == 0 && read == packed.size())) {
      return FileError(file,
                       absl::StrCat("its compressed data are ",
                                    read == packed.size() ? "cut off" : "damaged", " after byte ",
                                    read, " (", stream.msg != nullptr ? stream.msg : "no end", ")"),
                       "copy the file again");
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> Inflate(const SourceFile& file, absl::string_view packed, uint64_t most,
                                    Deflated kind) {
  std::string out;
  const absl::Status status = InflatePieces(file, packed, most, kind, [&](absl::string_view piece) {
    // The output grows with the data, so a short file that declares a large size takes little
    // memory.
    const uint64_t size = out.size() + piece.size();
    if (out.capacity() < size) out.reserve(std::max(size, std::min<uint64_t>(most, 2 * size)));
    out.append(piece.data(), piece.size());
  });
  if (!status.ok()) return status;
  return out;
}

}  // namespace voxeld::voxelctl
