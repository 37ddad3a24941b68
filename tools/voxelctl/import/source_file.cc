#include "tools/voxelctl/import/source_file.h"

#include <fcntl.h>
#include <linux/openat2.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "common/text/printable.h"
#include "daemon/address/descriptor.h"

namespace voxeld::voxelctl {
namespace {

// Opens a regular file relative to `folder`. With `beneath`, the kernel refuses "..", absolute
// paths and links that lead out of it. First only looks the file up (O_PATH), because opening a
// device or a FIFO can have side effects.
daemon::Descriptor OpenRegularFile(int folder, const std::string& name, bool beneath) {
  open_how how = {};
  how.flags = O_PATH | O_CLOEXEC;
  how.resolve = RESOLVE_NO_MAGICLINKS;
  if (beneath) how.resolve |= RESOLVE_BENEATH;
  const daemon::Descriptor found(
      static_cast<int>(::syscall(SYS_openat2, folder, name.c_str(), &how, sizeof(how))));
  struct stat info {};
  if (!found.ok() || ::fstat(found.get(), &info) != 0 || !S_ISREG(info.st_mode)) return {};
  return daemon::Descriptor(
      ::open(absl::StrCat("/proc/self/fd/", found.get()).c_str(), O_RDONLY | O_CLOEXEC));
}

// Reads a file of 1 to kMaxFileBytes bytes.
bool ReadWhole(int descriptor, std::string* bytes) {
  struct stat info {};
  if (::fstat(descriptor, &info) != 0 || info.st_size <= 0 ||
      static_cast<uint64_t>(info.st_size) > kMaxFileBytes) {
    return false;
  }
  bytes->resize(static_cast<size_t>(info.st_size));
  size_t at = 0;
  while (at < bytes->size()) {
    const ssize_t got = ::read(descriptor, bytes->data() + at, bytes->size() - at);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    at += static_cast<size_t>(got);
  }
  return true;
}

}  // namespace

std::string ExtensionOf(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  return absl::AsciiStrToLower(extension.empty() ? extension : extension.substr(1));
}

absl::StatusOr<SourceFile> ReadSourceFile(const std::string& path, OtherFiles other_files) {
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0) {
    const int error = errno;
    const std::string text = absl::StrCat(path, ": ", std::strerror(error));
    return error == ENOENT ? absl::NotFoundError(text) : absl::PermissionDeniedError(text);
  }
  if (!S_ISREG(info.st_mode)) {
    return absl::InvalidArgumentError(absl::StrCat(path, S_ISDIR(info.st_mode)
                                                             ? ": is a directory; a file is wanted"
                                                             : ": is not a regular file"));
  }
  const auto size = static_cast<uint64_t>(info.st_size);
  if (size == 0) return absl::InvalidArgumentError(absl::StrCat(path, ": the file is empty"));
  if (size > kMaxFileBytes) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": the file has ", size,
                                                   " bytes; at most ", kMaxFileBytes, " are read"));
  }
  SourceFile file{
      .path = path, .extension = ExtensionOf(path), .bytes = {}, .other_files = other_files};
  std::ifstream in(path, std::ios::binary);
  file.bytes.resize(size);
  if (!in.read(file.bytes.data(), static_cast<std::streamsize>(size))) {
    return absl::PermissionDeniedError(absl::StrCat(path, ": could not be read to its end (",
                                                    in.gcount(), " of ", size, " bytes)"));
  }
  return file;
}

absl::StatusOr<SourceFile> ReadOtherFile(const SourceFile& file, const std::string& name) {
  if (file.other_files == OtherFiles::kNone) {
    return absl::FailedPreconditionError(
        "files that a file names are not read here; use one file that holds everything, such as "
        ".glb");
  }
  const bool below = file.other_files == OtherFiles::kBelow;
  const std::filesystem::path parent = std::filesystem::path(file.path).parent_path();
  const daemon::Descriptor folder(
      ::open(parent.empty() ? "." : parent.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
  const daemon::Descriptor other =
      folder.ok() ? OpenRegularFile(folder.get(), name, below) : daemon::Descriptor();
  SourceFile found{.path = (parent / name).string(),
                   .extension = ExtensionOf(name),
                   .bytes = {},
                   .other_files = file.other_files};
  if (other.ok() && ReadWhole(other.get(), &found.bytes)) return found;
  return absl::FailedPreconditionError(
      below ? "a regular file in its folder or below is expected (--other-files any allows others)"
            : "a regular file that can be read is expected");
}

std::string DescribeContents(absl::string_view bytes) {
  struct Magic {
    absl::string_view begins;
    absl::string_view name;
  };
  static constexpr Magic kMagics[] = {
      {"\x89PNG", "a PNG picture"},
      {"\xff\xd8\xff", "a JPEG picture"},
      {"GIF8", "a GIF picture"},
      {"%PDF", "a PDF document"},
      {"PK\x03\x04", "a ZIP archive"},
      {"\x1f\x8b", "gzip-compressed data"},
      {"\x7f"
       "ELF",
       "a program"},
      {"glTF", "glTF binary (GLB)"},
      {"ply", "a PLY file"},
      {"solid", "text as in an ASCII STL"},
      {"Kaydara FBX", "an FBX file"},
      {"BLENDER", "a Blender file"},
      {"\xff\xfe", "UTF-16 text"},
      {"\xfe\xff", "UTF-16 text"},
      {"<?xml", "XML text"},
      {"<!DOCTYPE", "an HTML page"},
      {"<html", "an HTML page"},
  };
  for (const Magic& magic : kMagics) {
    if (absl::StartsWith(bytes, magic.begins)) return std::string(magic.name);
  }
  const absl::string_view text = absl::StripLeadingAsciiWhitespace(bytes);
  if (text.empty()) return "nothing but white space";
  if (text.front() == '{' || text.front() == '[') return "JSON text";
  const absl::string_view head = bytes.substr(0, 512);
  for (const char c : head) {
    const auto u = static_cast<unsigned char>(c);
    if (u < 0x20 && c != '\n' && c != '\r' && c != '\t') return "binary data";
  }
  const absl::string_view line = text.substr(0, std::min<size_t>(text.find('\n'), 24));
  return absl::StrCat("text that begins with \"",
                      EscapeForTerminal(absl::StripTrailingAsciiWhitespace(line)), "\"");
}

absl::string_view TakeLine(absl::string_view* text) {
  const size_t end = std::min(text->find_first_of("\r\n"), text->size());
  const absl::string_view line = text->substr(0, end);
  text->remove_prefix(end);
  if (!absl::ConsumePrefix(text, "\r\n") && !text->empty()) text->remove_prefix(1);
  return line;
}

std::string TextModeHint(absl::string_view bytes) {
  // In binary data of this size, some LF follows a CR by chance.
  constexpr std::ptrdiff_t kTelling = 100;
  if (std::count(bytes.begin(), bytes.end(), '\n') < kTelling || absl::StrContains(bytes, "\r\n"))
    return "";
  return " (it holds no CR LF at all: it was probably copied as text, which drops bytes; copy it "
         "as "
         "binary)";
}

absl::Status FileError(const SourceFile& file, absl::string_view found,
                       absl::string_view expected) {
  return absl::InvalidArgumentError(absl::StrCat(file.path, ": ", found, "; ", expected));
}

}  // namespace voxeld::voxelctl
