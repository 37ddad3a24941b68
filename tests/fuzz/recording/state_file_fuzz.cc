// The state file: whatever the file contains, the daemon has a usable file afterwards, or reports
// why not; wrong rows are left out.

#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/state/restore.h"
#include "daemon/state/state_file.h"
#include "tests/fuzz/expect.h"

namespace voxeld::fuzz {
namespace {

using namespace voxeld::daemon;         // NOLINT(google-build-using-namespace)
using namespace voxeld::daemon::state;  // NOLINT(google-build-using-namespace)

// Returns a folder in memory that disappears with the process.
const std::string& Folder() {
  static const std::string& folder = *new std::string([] {
    char name[] = "/dev/shm/voxeld-fuzz-XXXXXX";
    EXPECT_THAT_HOLDS(mkdtemp(name) != nullptr);
    std::atexit([] { std::filesystem::remove_all(Folder()); });
    return std::string(name);
  }());
  return folder;
}

void Run(const uint8_t* data, size_t size) {
  const std::string path = Folder() + "/state.db";
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  int64_t second = 0;
  auto opened = StateFile::Open({.path = path, .vfs = "", .now = [&] { return ++second; }});
  if (!opened.ok()) return ExpectSays(opened.status());
  StateFile& file = **opened;
  Limits limits;
  limits.max_vertices_per_entity = 2048;
  limits.max_indices_per_entity = 4096;
  const auto restored =
      ReadState(file, {.monotonic_ns = 1, .unix_ns = 1}, limits, nullptr, nullptr);
  if (!restored.ok()) {
    EXPECT_THAT_HOLDS(absl::IsDataLoss(restored.status()), restored.status().ToString());
    ExpectSays(restored.status());
    EXPECT_THAT_HOLDS(file.StartAnew("fuzz").ok());
  } else {
    EXPECT_THAT_HOLDS(restored->why.size() <= RestoredState::kMostSaid &&
                      restored->why.size() <= restored->left_out);
    for (const std::string& why : restored->why) ExpectSays(absl::InvalidArgumentError(why));
  }
  // It can be used.
  const RowKey key{.kind = RowKind::kLayer, .owner = 77, .name = "fuzz", .id = ""};
  bool given = false;
  const absl::Status applied = file.Apply([&]() -> std::vector<Change> {
    if (std::exchange(given, true)) return {};
    return {{.what = Change::What::kPut, .key = key, .bytes = "bytes"}};
  });
  if (!applied.ok()) {
    EXPECT_THAT_HOLDS(absl::IsDataLoss(applied), applied.ToString());
    ExpectSays(applied);
    return;
  }
  bool found = false;
  const absl::Status read = file.Read([&](const RowKey& row, std::string_view bytes) {
    found = found || (row == key && bytes == "bytes");
  });
  EXPECT_THAT_HOLDS(!read.ok() || found, "a row that was put is not there");
  // No other process can open it in the meantime.
  const auto other = StateFile::Open({.path = path, .vfs = "", .now = [&] { return ++second; }});
  EXPECT_THAT_HOLDS(absl::IsAlreadyExists(other.status()), other.status().ToString());
  for (const Change::What what :
       {Change::What::kRemove, Change::What::kRemoveLayer, Change::What::kRemoveAll}) {
    given = false;
    const absl::Status removed = file.Apply([&]() -> std::vector<Change> {
      if (std::exchange(given, true)) return {};
      return {{.what = Change::What::kPut, .key = key, .bytes = "bytes"},
              {.what = what, .key = key}};
    });
    ExpectSays(removed);
    if (!removed.ok()) continue;
    size_t left = 0, all = 0;
    const absl::Status again = file.Read([&](const RowKey& row, std::string_view) {
      left += row == key ? 1 : 0;
      ++all;
    });
    EXPECT_THAT_HOLDS(!again.ok() || left == 0, "a row that was removed is there");
    if (what == Change::What::kRemoveAll) EXPECT_THAT_HOLDS(!again.ok() || all == 0, all, " rows");
  }
}

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxeld::fuzz::Run(data, size);
  for (const auto& entry : std::filesystem::directory_iterator(voxeld::fuzz::Folder())) {
    std::filesystem::remove(entry.path());
  }
  return 0;
}
