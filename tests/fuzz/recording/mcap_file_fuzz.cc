// Recordings: read from front to end, and replayed. A daemon decodes the result.

#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/strings/str_cat.h"
#include "daemon/wire/decode.h"
#include "tests/fuzz/expect.h"
#include "tools/recording/mcap.h"
#include "tools/recording/putting_up.h"
#include "tools/recording/scene_recording.h"

namespace voxeld::fuzz {
namespace {

void Run(const std::string& path) {
  auto opened = recording::McapReader::Open(path);
  if (!opened.ok()) return ExpectSays(opened.status());
  recording::McapReader& reader = **opened;
  const auto summary = reader.Summarise();
  ExpectSays(summary.status());
  uint64_t messages = 0;
  const absl::Status read = reader.Read([&](const recording::McapMessage& message) {
    ++messages;
    uint32_t sum = 0;
    for (const char c : message.data) sum += static_cast<uint8_t>(c);
    return sum != 1;
  });
  ExpectSays(read);
  if (summary.ok() && read.ok()) EXPECT_THAT_HOLDS(messages <= summary->messages);
  reader.Rewind();
  recording::PuttingUp scene("r: "), later("r: ");
  const daemon::Limits limits;
  uint64_t sets = 0;
  ExpectSays(recording::ReadScene(reader, [&](const recording::ChangeSet& set) {
    std::vector<v1::StreamRequest> requests = scene.Step(set.changes);
    later.Skip(set.changes);
    for (const v1::StreamRequest& request : later.Whole()) requests.push_back(request);
    for (const v1::StreamRequest& request : requests) {
      const auto decoded = daemon::wire::DecodeStreamRequest(request, limits, 0);
      ExpectSays(decoded.status);
    }
    for (const std::string& layer : scene.TakeEmptied()) EXPECT_THAT_HOLDS(!layer.empty());
    return ++sets < 32;
  }));
}

}  // namespace
}  // namespace voxeld::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const int file = memfd_create("fuzz", MFD_CLOEXEC);
  EXPECT_THAT_HOLDS(write(file, data, size) == static_cast<ssize_t>(size));
  voxeld::fuzz::Run(absl::StrCat("/proc/self/fd/", file));
  close(file);
  return 0;
}
