#include "daemon/viewer/page_files.h"

#include <zlib.h>

#include <array>

#ifdef VOXELD_PAGE
// The files are embedded unchanged; VOXELD_PAGE is their folder.
#define VOXELD_EMBED(name, file)                               \
  asm(".pushsection .rodata\n"                                 \
      ".global voxeld_page_" #name                             \
      "\n"                                                     \
      ".global voxeld_page_" #name                             \
      "_end\n"                                                 \
      "voxeld_page_" #name ": .incbin \"" VOXELD_PAGE "/" file \
      "\"\n"                                                   \
      "voxeld_page_" #name                                     \
      "_end: .byte 0\n"                                        \
      ".popsection\n");                                        \
  extern "C" const char voxeld_page_##name[], voxeld_page_##name##_end[];

VOXELD_EMBED(html, "index.html.gz")
VOXELD_EMBED(css, "page.css.gz")
VOXELD_EMBED(page, "page.js.gz")
VOXELD_EMBED(worker, "splat_worker.js.gz")
#undef VOXELD_EMBED
#endif

namespace voxeld::daemon::viewer {

#ifdef VOXELD_PAGE
std::span<const PageFile> PageFiles() {
  const auto between = [](const char* from, const char* to) {
    return std::string_view(from, static_cast<size_t>(to - from));
  };
  static const std::array<PageFile, 4> files = {{
      {"/", "text/html; charset=utf-8", between(voxeld_page_html, voxeld_page_html_end)},
      {"/page.css", "text/css; charset=utf-8", between(voxeld_page_css, voxeld_page_css_end)},
      {"/page.js", "text/javascript; charset=utf-8",
       between(voxeld_page_page, voxeld_page_page_end)},
      {"/splat_worker.js", "text/javascript; charset=utf-8",
       between(voxeld_page_worker, voxeld_page_worker_end)},
  }};
  return files;
}
#else
std::span<const PageFile> PageFiles() { return {}; }
#endif

std::string Unpack(std::string_view gzipped) {
  constexpr int kGzip = 16 + MAX_WBITS;
  std::string out;
  z_stream stream = {};
  if (inflateInit2(&stream, kGzip) != Z_OK) return out;
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(gzipped.data()));
  stream.avail_in = static_cast<uInt>(gzipped.size());
  std::array<char, 1 << 16> part;
  int result = Z_OK;
  while (result == Z_OK) {
    stream.next_out = reinterpret_cast<Bytef*>(part.data());
    stream.avail_out = part.size();
    result = inflate(&stream, Z_NO_FLUSH);
    out.append(part.data(), part.size() - stream.avail_out);
  }
  inflateEnd(&stream);
  return out;
}

}  // namespace voxeld::daemon::viewer
