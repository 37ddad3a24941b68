// Tests the generator on a GPU: it gives the CPU's bytes, for every sampling and form; and what it
// refuses.
//
// VOXELD_SEGMENTS: how many random ones (default 200,000; where a CPU plays the GPU 5,000);
// VOXELD_SEED: the seed for them.
#include "gpu/cuda/cuda_generator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <thread>

#include "tests/gpu/generate/segment_samples.h"

namespace voxeld::gpu::cuda {
namespace {

using generate::Batch;
using generate::BytesOf;
using generate::Format;
using generate::Generator;
using generate::Output;
using generate::Sampling;
using generate::Segment;
using generate::testing::Adversarial;
using generate::testing::RandomSegments;
using generate::testing::SegmentD;
using ::testing::HasSubstr;

#if defined(VOXELD_TEST_SIMT)
constexpr uint64_t kSegments = 5'000;
#else
constexpr uint64_t kSegments = 200'000;
#endif

uint64_t Number(const char* name, uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text != nullptr ? std::strtoull(text, nullptr, 10) : otherwise;
}

int Threads() { return static_cast<int>(std::thread::hardware_concurrency()); }

class CudaGeneratorTest : public ::testing::TestWithParam<std::tuple<Sampling, Output>> {
 protected:
  CudaGeneratorTest() : cpu_(generate::MakeCpuGenerator(Threads())) {
    auto cuda = CudaGenerator::Open(0, Threads());
    EXPECT_TRUE(cuda.ok()) << cuda.status();
    if (cuda.ok()) cuda_ = *std::move(cuda);
  }

  Format format() const { return {std::get<0>(GetParam()), std::get<1>(GetParam())}; }

  // Compares chunk by chunk, since both stream them.
  void ExpectEqual(const Batch& batch) {
    const auto plan = cpu_->Prepare(batch, format());
    ASSERT_TRUE(plan.ok()) << plan.status();
    uint64_t compared = 0, wrong = 0;
    const auto placed = cuda_->Place(batch, *plan);
    ASSERT_TRUE(placed.ok()) << placed.status();
    // The GPU's chunks are compared with the CPU's result for the same range.
    std::vector<std::byte> all(plan->voxels() * BytesOf(format().output));
    ASSERT_TRUE(cpu_->Generate(batch, *plan, format(), all).ok());
    const absl::Status status =
        cuda_->StreamFrom(*placed, format(), Generator::kChunkVoxels,
                          [&](uint64_t first, std::span<const std::byte> voxels) {
                            const std::byte* at = all.data() + first * BytesOf(format().output);
                            compared += voxels.size();
                            if (std::memcmp(at, voxels.data(), voxels.size()) == 0)
                              return absl::OkStatus();
                            for (size_t i = 0; i < voxels.size(); ++i) wrong += at[i] != voxels[i];
                            return absl::OkStatus();
                          });
    EXPECT_TRUE(status.ok()) << status;
    EXPECT_EQ(compared, all.size());
    EXPECT_EQ(wrong, 0u) << "bytes of " << compared;
  }

  // Returns segments moved to where every form can hold them.
  static std::vector<SegmentD> Held(std::vector<SegmentD> segments) {
    for (SegmentD& g : segments) {
      for (auto* p : {&g.start, &g.end}) {
        for (double& v : *p) v = std::clamp(v + 500, 0.0, 1023.99);
      }
    }
    return segments;
  }

  const std::unique_ptr<Generator> cpu_;
  std::unique_ptr<CudaGenerator> cuda_;
};
std::string NameOf(const ::testing::TestParamInfo<std::tuple<Sampling, Output>>& info) {
  constexpr const char* kSamplings[] = {"Euclidean", "Thin", "Cover"};
  constexpr const char* kOutputs[] = {"I32x3", "F32x3", "I16x3", "Packed"};
  return std::string(kSamplings[static_cast<size_t>(std::get<0>(info.param))]) +
         kOutputs[static_cast<size_t>(std::get<1>(info.param))];
}
constexpr Sampling kSamplings[] = {Sampling::kEuclidean, Sampling::kThin, Sampling::kCover};
constexpr Output kOutputs[] = {Output::kI32x3, Output::kF32x3, Output::kI16x3, Output::kPacked};
INSTANTIATE_TEST_SUITE_P(Forms, CudaGeneratorTest,
                         ::testing::Combine(::testing::ValuesIn(kSamplings),
                                            ::testing::ValuesIn(kOutputs)),
                         NameOf);

// Segments that only the widest form can hold.
class CudaGeneratorFar : public CudaGeneratorTest {};
INSTANTIATE_TEST_SUITE_P(Forms, CudaGeneratorFar,
                         ::testing::Combine(::testing::ValuesIn(kSamplings),
                                            ::testing::Values(Output::kI32x3)),
                         NameOf);

TEST_P(CudaGeneratorTest, ManyRandomSegmentsAreTheCpusBytes) {
  const uint64_t seed = Number("VOXELD_SEED", 1), count = Number("VOXELD_SEGMENTS", kSegments);
  // Nine in ten are short, the others longer; two in ten are on whole voxels.
  std::vector<SegmentD> segments = RandomSegments(seed, count, 12, false);
  const auto whole = RandomSegments(seed + 1, count / 5 + 1, 12, true);
  const auto longer = RandomSegments(seed + 2, count / 100 + 1, 480, false);
  for (size_t i = 0; i < count; i += 5) segments[i] = whole[i / 5];
  for (size_t i = 1; i < count; i += 100) segments[i] = longer[i / 100];
  ExpectEqual(Held(std::move(segments)));
}

// A few hundred voxels each: warps go from one segment to the next, some of them with many short
// ones in between.
TEST_P(CudaGeneratorTest, LongerSegmentsAndMixedLengthsAreTheCpusBytes) {
  const uint64_t seed = Number("VOXELD_SEED", 1),
                 count = Number("VOXELD_SEGMENTS", kSegments) / 10 * 13;
  std::vector<SegmentD> segments = RandomSegments(seed + 3, count, 430, false);
  const auto whole = RandomSegments(seed + 4, count / 3 + 1, 430, true);
  for (size_t i = 0; i < count; i += 3) segments[i] = whole[i / 3];
  // A tenth of them in one place, a few voxels long.
  for (size_t i = count / 2; i < count / 2 + count / 10; ++i) {
    for (size_t a = 0; a < 3; ++a)
      segments[i].end[a] = segments[i].start[a] + static_cast<double>((i + a) % 7) - 3;
  }
  ExpectEqual(Held(std::move(segments)));
}

TEST_P(CudaGeneratorTest, EverySizeAroundARoundAWarpAndABlockIsTheCpus) {
  ExpectEqual(std::vector<SegmentD>());
  for (const int voxels : {1, 2, 3, 4, 5, 127, 128, 129, 1023, 1024, 1025}) {
    ExpectEqual(std::vector<SegmentD>{{{0.25, 3, 5.5}, {voxels - 0.5, 3, 5.5}}});
    ExpectEqual(std::vector<SegmentD>(static_cast<size_t>(voxels), {{7, 8, 9}, {7, 8, 9}}));
  }
}

TEST_P(CudaGeneratorTest, ChunksAreTheSameHoweverLargeAndAnErrorEndsThem) {
  const auto segments = Held(RandomSegments(6, 3000, 400, false));
  const auto plan = cuda_->Prepare(segments, format());
  ASSERT_TRUE(plan.ok());
  std::vector<std::byte> expected(plan->voxels() * BytesOf(format().output));
  ASSERT_TRUE(cpu_->Generate(segments, *plan, format(), expected).ok());
  for (const uint64_t chunk : {uint64_t{8192}, uint64_t{5 * 8192}, ~uint64_t{8191}}) {
    std::vector<std::byte> got;
    const absl::Status status = cuda_->Stream(
        segments, *plan, format(), chunk, [&](uint64_t first, std::span<const std::byte> voxels) {
          EXPECT_EQ(first * BytesOf(format().output), got.size());
          got.insert(got.end(), voxels.begin(), voxels.end());
          return absl::OkStatus();
        });
    EXPECT_TRUE(status.ok()) << status;
    EXPECT_TRUE(got == expected);
  }
  int chunks = 0;
  EXPECT_EQ(cuda_->Stream(segments, *plan, format(), 8192,
                          [&](uint64_t, auto) {
                            return ++chunks == 5 ? absl::CancelledError("enough")
                                                 : absl::OkStatus();
                          }),
            absl::CancelledError("enough"));
  EXPECT_EQ(chunks, 5);
  EXPECT_EQ(cuda_->Stream(segments, *plan, format(), 100, nullptr).code(),
            absl::StatusCode::kInvalidArgument);
}

TEST_P(CudaGeneratorTest, AdversarialSegmentsAreTheCpusBytes) {
  ExpectEqual(Held(Adversarial(-200, 30)));
  ExpectEqual(Held(Adversarial(0, 400)));
}

TEST_P(CudaGeneratorFar, LongAndFarSegmentsAreTheCpusBytes) {
  ExpectEqual(RandomSegments(3, 40, 200'000, false));
  ExpectEqual(RandomSegments(4, 40, 200'000, true));
  const double far = 1 << 29;
  if (format().sampling == Sampling::kCover) return;  // too many to keep here
  // Beyond 2²⁴ steps, where 64 fraction bits do not decide.
  const std::vector<SegmentD> longest = {
      {{-20e6 + 0.25, 3, -7}, {20e6, 4 - 1.0 / 65536, 5'000'000.5}},
      {{far, far, far}, {far - 17'000'000, far - 17'000'000, far - 17'000'000}},
      {{0, 0, 0.5}, {18'000'000, 6'000'000, -100}}};
  ExpectEqual(longest);
}

TEST_P(CudaGeneratorTest, IntoDeviceMemoryAndThroughTheWholeCallTheyAreTheSame) {
  const auto segments = Held(RandomSegments(5, 3000, 200, false));
  const auto plan = cuda_->Prepare(segments, format());
  ASSERT_TRUE(plan.ok());
  const size_t bytes = plan->voxels() * BytesOf(format().output);
  std::vector<std::byte> expected(bytes), got(bytes), host(bytes);
  ASSERT_TRUE(cpu_->Generate(segments, *plan, format(), expected).ok());
  const auto placed = cuda_->Place(segments, *plan);
  ASSERT_TRUE(placed.ok());
  auto block = cuda_->device().pool().Acquire(bytes + 64);
  ASSERT_TRUE(block.ok());
  ASSERT_EQ(cudaMemset(block->as<std::byte>(), 0xA5, bytes + 64), cudaSuccess);
  // The generator's stream does not wait for the default one.
  ASSERT_EQ(cudaStreamSynchronize(nullptr), cudaSuccess);
  const absl::Status made =
      cuda_->GenerateOnDevice(*placed, format(), {block->as<std::byte>(), bytes});
  ASSERT_TRUE(made.ok()) << made;
  ASSERT_EQ(cudaMemcpy(got.data(), block->as<std::byte>(), bytes, cudaMemcpyDeviceToHost),
            cudaSuccess);
  EXPECT_EQ(got, expected);
  std::byte after[64];
  ASSERT_EQ(cudaMemcpy(after, block->as<std::byte>() + bytes, 64, cudaMemcpyDeviceToHost),
            cudaSuccess);
  for (const std::byte b : after) EXPECT_EQ(b, std::byte{0xA5}) << "written beyond the end";
  ASSERT_TRUE(cuda_->Generate(segments, *plan, format(), host).ok());
  EXPECT_EQ(host, expected);

  const absl::Status crooked =
      cuda_->GenerateOnDevice(*placed, format(), {block->as<std::byte>() + 4, bytes});
  EXPECT_THAT(std::string(crooked.message()), HasSubstr("multiple of 16 bytes"));
  const absl::Status small =
      cuda_->GenerateOnDevice(*placed, format(), {block->as<std::byte>(), bytes - 1});
  EXPECT_EQ(small.code(), absl::StatusCode::kInvalidArgument);
}

TEST(CudaGenerator, ADeviceThatIsNotThereIsSaidToBe) {
  const auto none = CudaGenerator::Open(99, 1);
  EXPECT_EQ(none.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(none.status().message()), HasSubstr("99"));
}

}  // namespace
}  // namespace voxeld::gpu::cuda
