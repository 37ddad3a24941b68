#include "tools/import/inflate.h"

#include <zlib.h>

#include <algorithm>
#include <memory>

#include "absl/strings/str_cat.h"

namespace voxeld::voxelctl {
namespace {

// zlib's words for: the largest window; a header of gzip, or none.
constexpr int kGzipAlone = 15 + 16, kNoHeader = -15;
constexpr uint64_t kStep = 1 << 20;

}  // namespace

absl::StatusOr<std::string> Inflate(const SourceFile& file, absl::string_view packed, uint64_t most,
                                    Deflated kind) {
  z_stream stream = {};
  if (inflateInit2(&stream, kind == Deflated::kGzip ? kGzipAlone : kNoHeader) != Z_OK) {
    return absl::ResourceExhaustedError(absl::StrCat(file.path, ": no memory to decompress it"));
  }
  const std::unique_ptr<z_stream, int (*)(z_stream*)> end(&stream, inflateEnd);
  std::string out;
  size_t read = 0;
  uint64_t written = 0;  // of `out`, the rest of which is room
  while (written < most) {
    // Grows with what comes, so that a short file that promises much takes little; and only then, since streams may be many
    // and empty.
    if (written == out.size()) out.resize(std::min(most, written + std::max(kStep, written)));
    const uint64_t before = written;
    const size_t given = std::min<size_t>(packed.size() - read, uint64_t{1} << 30);
    const size_t room = std::min<size_t>(out.size() - before, uint64_t{1} << 30);
    // zlib does not write there.
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data() + read));
    stream.avail_in = static_cast<uInt>(given);
    stream.next_out = reinterpret_cast<Bytef*>(out.data() + before);
    stream.avail_out = static_cast<uInt>(room);
    const int result = inflate(&stream, Z_NO_FLUSH);
    read += given - stream.avail_in;
    written = before + room - stream.avail_out;
    if (result == Z_STREAM_END) {
      // Some programs write several streams, one after another.
      if (kind == Deflated::kRaw || packed.size() - read < 2 ||
          packed.substr(read, 2) != "\x1f\x8b")
        break;
      if (inflateReset(&stream) != Z_OK) break;
      continue;
    }
    if (result != Z_OK || (written == before && read == packed.size())) {
      return FileError(file,
                       absl::StrCat("its compressed data are ",
                                    read == packed.size() ? "cut off" : "damaged", " after byte ",
                                    read, " (", stream.msg != nullptr ? stream.msg : "no end", ")"),
                       "copy the file again");
    }
  }
  out.resize(written);
  return out;
}

}  // namespace voxeld::voxelctl
