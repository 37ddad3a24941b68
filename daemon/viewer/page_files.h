// The page's files, bundled when the daemon was built.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace voxeld::daemon::viewer {

struct PageFile {
  std::string_view path, content_type;
  std::string_view gzipped;  // contents as gzip (RFC 1952)
};

// Returns: nothing if the daemon was built without the page.
std::span<const PageFile> PageFiles();

// Returns: the decompressed contents. Requires: valid gzip.
std::string Unpack(std::string_view gzipped);

}  // namespace voxeld::daemon::viewer
