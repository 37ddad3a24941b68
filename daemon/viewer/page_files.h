// The page's files, as they were bundled when the daemon was built.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace voxeld::daemon::viewer {

struct PageFile {
  std::string_view path, content_type;
  std::string_view gzipped;  // its contents, as gzip (RFC 1952)
};

// None: the daemon was built without the page.
std::span<const PageFile> PageFiles();

// The contents as they were before. The bytes are gzip.
std::string Unpack(std::string_view gzipped);

}  // namespace voxeld::daemon::viewer
