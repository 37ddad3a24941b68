// Assets: uploads that overlap, are interrupted, continue and lie. A complete asset has its hash;
// statistics add up; nothing exceeds the limits.

#include <fcntl.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "daemon/assets/asset_file.h"
#include "daemon/assets/asset_store.h"
#include "daemon/log/logger.h"
#include "display/sync/fake_clock.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/script.h"

namespace voxeld::fuzz {
namespace {

using namespace voxeld::daemon::assets;  // NOLINT(google-build-using-namespace)

constexpr int kMostSteps = 96;
constexpr size_t kContents = 6;
constexpr uint64_t kMostBytes = 24 << 10;

// Returns contents of several sizes, one of them empty.
std::string ContentOf(size_t number) {
  constexpr size_t kSizes[kContents] = {0, 1, 100, 4096, 5000, 8192};
  return std::string(kSizes[number], static_cast<char>('a' + number));
}

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

// Returns the hash that a stray file with an asset's name would have to have.
const std::string& StrayDigest() {
  static const std::string& digest = *new std::string(32, '\xAA');
  return digest;
}

daemon::Logger& Log() {
  static const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
  static daemon::Logger log(daemon::Logger::Level::kInfo, daemon::Logger::Format::kText, nowhere);
  return log;
}

// Changes a byte of one of the files, truncates one, or adds a file. `runs`: while the store
// exists, which checks the whole of an asset once; then a file is removed or truncated.
void Damage(const std::string& folder, Script& script, bool runs) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.is_regular_file()) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  uint8_t how = script.Byte();
  if (runs) {
    if (files.empty()) return;
    if (how >= 64) {
      const std::filesystem::path path = files[script.Byte() % files.size()];
      std::filesystem::remove(path);
      if (how >= 128) std::filesystem::create_directory(path);  // in its place
      return;
    }
    how = 64;
  }
  if (files.empty() || how < 32) {
    std::ofstream(folder + "/" + std::string(how % 80, 'a') + (how % 2 == 0 ? ".part" : ""))
        << "stray";
    return;
  }
  const std::filesystem::path& path = files[script.Byte() % files.size()];
  const uintmax_t size = std::filesystem::file_size(path);
  if (how < 128) return std::filesystem::resize_file(path, size / 2);
  if (size == 0) return;
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(static_cast<std::streamoff>(script.Below(65536) % size));
  file.put('!');
}

void Run(Script script) {
  sync::FakeClock clock;
  const AssetLimits limits{.max_asset_bytes = 8192,
                           .max_bytes = kMostBytes,
                           .max_assets = 4,
                           .max_uploads = 3,
                           .idle_limit_ns = sync::kSecond};
  // In memory, or in a folder, which may have other files, or which is not a folder.
  const uint8_t where = script.Byte();
  const std::string folder = (where & 1) != 0 ? Folder() : "";
  const std::string none = Folder() + "/none";
  if ((where & 0x80) != 0) std::ofstream(none) << "no folder";
  std::unique_ptr<AssetStore> store =
      AssetStore::Open((where & 0x80) != 0 ? none : folder, limits, clock, &Log());
  std::string contents[kContents], digests[kContents];
  for (size_t i = 0; i < kContents; ++i) {
    contents[i] = ContentOf(i);
    digests[i] = HashBytes(contents[i]);
  }
  bool damaged = false;  // a complete file is checked when it is used
  struct Upload {
    size_t content = 0;
    uint64_t at = 0;
    bool true_so_far = true;
  };
  std::map<AssetStore::UploadId, Upload> uploads;
  const auto any = [&]() -> std::map<AssetStore::UploadId, Upload>::iterator {
    if (uploads.empty()) return uploads.end();
    auto it = uploads.begin();
    std::advance(it, script.Byte() % uploads.size());
    return it;
  };
  for (int step = 0; step < kMostSteps && !script.done(); ++step) {
    switch (script.Byte() % 8) {
      case 0:
      case 1: {
        const size_t content = script.Byte() % kContents;
        const uint8_t choice = script.Byte();
        uint64_t size = contents[content].size(), offset = 0;
        if (choice == 1) size = script.Number(8);
        if (choice == 2) offset = script.Number(8);
        if (choice > 128) {
          for (const AssetState& state : store->List({&digests[content], 1})) offset = state.stored;
        }
        const auto begun = store->Begin(digests[content], size, offset);
        ExpectSays(begun.status());
        if (begun.ok()) uploads[*begun] = {content, offset, size == contents[content].size()};
        break;
      }
      case 2:
      case 3: {
        const auto it = any();
        if (it == uploads.end()) break;
        Upload& upload = it->second;
        const std::string& content = contents[upload.content];
        const uint8_t choice = script.Byte();
        std::string bytes =
            content.substr(std::min<size_t>(upload.at, content.size()), script.Below(65536) % 8193);
        uint64_t offset = upload.at;
        if (choice == 1) bytes = script.Text();
        if (choice == 2) offset = script.Number(8);
        const absl::Status status = store->Append(it->first, offset, bytes);
        ExpectSays(status);
        if (!status.ok()) break;
        EXPECT_THAT_HOLDS(offset == upload.at && !bytes.empty());
        // Its stated size may have been too large.
        upload.true_so_far &=
            upload.at <= content.size() && content.compare(upload.at, bytes.size(), bytes) == 0;
        upload.at += bytes.size();
        break;
      }
      case 4: {
        const auto it = any();
        if (it == uploads.end()) break;
        const auto finished = store->Finish(it->first);
        ExpectSays(finished.status());
        if (finished.ok()) EXPECT_THAT_HOLDS(*finished == contents[it->second.content].size());
        uploads.erase(it);
        break;
      }
      case 5: {
        const auto it = any();
        if (it == uploads.end()) break;
        store->Abandon(it->first);
        uploads.erase(it);
        break;
      }
      case 6: {
        if (const uint8_t choice = script.Byte(); choice < 32) {  // the daemon restarts
          store = nullptr;
          uploads.clear();
          if (!folder.empty() && choice < 16) {
            Damage(folder, script, false);
            damaged = true;
          }
          store = AssetStore::Open(folder, limits, clock, &Log());
        } else if (choice < 48 && !folder.empty()) {
          Damage(folder, script, true);
          damaged = true;
        }
        clock.Advance(script.Byte() * 20 * sync::kMillisecond);
        const auto it = any();
        if (it != uploads.end()) store->Heard(it->first);
        break;
      }
      default: {
        const size_t content = script.Byte() % kContents;
        const uint64_t offset = script.Flag() ? script.Number(8) : script.Byte(),
                       size = script.Number(2);
        const auto found = store->FindAsset(digests[content], offset, size);
        ExpectSays(found.status());
        if (found.ok()) {
          EXPECT_THAT_HOLDS(found->bytes ==
                            std::string_view(contents[content]).substr(offset, size));
        }
        break;
      }
    }
    uint64_t bytes = 0;
    const std::vector<AssetState> all = store->ListAll();
    EXPECT_THAT_HOLDS(all.size() <= limits.max_assets, all.size(), " assets");
    for (const AssetState& state : all) {
      bytes += state.stored;
      const auto* const known = std::find(digests, digests + kContents, state.digest);
      if (known == digests + kContents) {
        // A foreign file that has an asset's name: its content is checked when it is used.
        EXPECT_THAT_HOLDS(damaged && state.digest == StrayDigest());
        continue;
      }
      if (state.complete && !damaged)
        EXPECT_THAT_HOLDS(state.stored == contents[known - digests].size());
    }
    EXPECT_THAT_HOLDS(bytes <= limits.max_bytes, bytes, " bytes");
  }
  const auto stray = store->FindAsset(StrayDigest(), 0, 1);
  ExpectSays(stray.status());
  EXPECT_THAT_HOLDS(!stray.ok(), "content is served that has not its hash");
  const daemon::AssetFigures figures = store->figures();
  EXPECT_THAT_HOLDS(figures.count <= limits.max_assets && figures.bytes <= limits.max_bytes);
}

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  voxeld::fuzz::Run(voxeld::fuzz::Script(data, size));
  for (const auto& entry : std::filesystem::directory_iterator(voxeld::fuzz::Folder())) {
    std::filesystem::remove_all(entry.path());
  }
  return 0;
}
