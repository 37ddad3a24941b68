// Words that claim to be a program: refused, or run without harm.

#include <cstdint>
#include <cstring>
#include <vector>

#include "gpu/implicit/program_check.h"
#include "tests/fuzz/expect.h"
#include "tests/fuzz/expression/evaluate.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxeld;  // NOLINT(google-build-using-namespace)
  if (size < 5 || size > 16 << 10) return 0;
  const uint32_t positions = data[0];
  std::vector<uint32_t> words((size - 1) / sizeof(uint32_t));
  std::memcpy(words.data(), data + 1, words.size() * sizeof(uint32_t));
  const absl::Status status = gpu::implicit::CheckProgram(words, positions);
  if (!status.ok()) {
    EXPECT_THAT_HOLDS(absl::IsInvalidArgument(status), status.ToString());
    fuzz::ExpectSays(status);
    return 0;
  }
  const float low[3] = {-2, 0.5f, 3}, length[3] = {4, 0.25f, 0};
  fuzz::Evaluate(words, low, length, 0.375f);
  return 0;
}
