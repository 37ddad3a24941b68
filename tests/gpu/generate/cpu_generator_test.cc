// Compares the CPU's generator with the definition in rational numbers, and tests what it refuses.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "gpu/generate/cpu_kernel.h"
#include "gpu/generate/generator.h"
#include "gpu/generate/stride.h"
#include "hwy/highway.h"
#include "tests/gpu/generate/rational_reference.h"
#include "tests/gpu/generate/segment_samples.h"

namespace voxeld::gpu::generate {
namespace {

using testing::Adversarial;
using testing::Cell;
using ::testing::HasSubstr;
using testing::RandomSegments;
using testing::SegmentD;
using testing::SegmentF;
using testing::SegmentI;

std::vector<std::byte> Generated(Generator& generator, const Batch& batch, Format format) {
  const absl::StatusOr<Plan> plan = generator.Prepare(batch, format);
  EXPECT_TRUE(plan.ok()) << plan.status();
  if (!plan.ok()) return {};
  std::vector<std::byte> out(plan->voxels() * BytesOf(format.output), std::byte{0xA5});
  const absl::Status status = generator.Generate(batch, *plan, format, out);
  EXPECT_TRUE(status.ok()) << status;
  return out;
}

std::vector<Cell> CellsOf(const std::vector<std::byte>& bytes) {
  std::vector<int32_t> words(bytes.size() / 4);
  std::memcpy(words.data(), bytes.data(), bytes.size());
  std::vector<Cell> cells;
  for (size_t i = 0; i + 2 < words.size(); i += 3)
    cells.push_back({words[i], words[i + 1], words[i + 2]});
  return cells;
}

std::vector<Cell> Expected(const std::vector<SegmentD>& segments, Sampling sampling) {
  std::vector<Cell> cells;
  for (const SegmentD& segment : segments) {
    const auto g = testing::ReferenceOf(segment.start, segment.end);
    const std::vector<Cell> of = sampling == Sampling::kCover ? testing::Crossed(g)
                                 : sampling == Sampling::kThin
                                     ? testing::Steps(g, testing::ThinSteps(g))
                                     : testing::Steps(g, testing::EuclideanSteps(g));
    cells.insert(cells.end(), of.begin(), of.end());
  }
  return cells;
}

constexpr Sampling kSamplings[] = {Sampling::kEuclidean, Sampling::kThin, Sampling::kCover};

class CpuGenerator : public ::testing::TestWithParam<Sampling> {
 protected:
  void ExpectExact(const std::vector<SegmentD>& segments) {
    const auto got = CellsOf(Generated(*generator_, segments, {GetParam(), Output::kI32x3}));
    const auto expected = Expected(segments, GetParam());
    ASSERT_EQ(got.size(), expected.size());
    size_t wrong = 0;
    for (size_t i = 0; i < got.size(); ++i) wrong += got[i] != expected[i];
    EXPECT_EQ(wrong, 0u) << "of " << got.size();
  }
  const std::unique_ptr<Generator> generator_ = MakeCpuGenerator(1);
};
INSTANTIATE_TEST_SUITE_P(
    Samplings, CpuGenerator, ::testing::ValuesIn(kSamplings), [](const auto& info) {
      return std::string(std::array{"Euclidean", "Thin", "Cover"}[static_cast<size_t>(info.param)]);
    });

TEST_P(CpuGenerator, AdversarialSegmentsAreExact) {
  ExpectExact(Adversarial(0, 30));
  ExpectExact(Adversarial(-7, 210));
  ExpectExact(Adversarial(1000.25, 300));
}

TEST_P(CpuGenerator, RandomSegmentsAreExact) {
  ExpectExact(RandomSegments(1, 300, 20, false));
  ExpectExact(RandomSegments(2, 300, 20, true));
  ExpectExact(RandomSegments(3, 20, 2000, false));
  ExpectExact(RandomSegments(4, 20, 2000, true));
}

TEST_P(CpuGenerator, FarOutSegmentsAreExact) {
  std::vector<SegmentD> segments = RandomSegments(5, 60, 100, false);
  for (size_t i = 0; i < segments.size(); ++i) {
    const double at = i % 2 == 0 ? 1073741000.0 : -1073741000.0;
    for (auto* p : {&segments[i].start, &segments[i].end}) {
      for (double& v : *p) v = std::clamp(v + at, -1073741824.0, 1073741824.0);
    }
  }
  ExpectExact(segments);
}

// Single voxels of segments that are so long that 64 fraction bits do not decide: there the
// definition is used.
TEST_P(CpuGenerator, VoxelsOfTheLongestSegmentsAreExact) {
  if (GetParam() == Sampling::kCover) return;  // tested by its own case below
  constexpr int32_t kFar = 1 << 29;
  const std::vector<SegmentD> segments = {
      {{-kFar + 20000.25, 3, -7}, {kFar - 1, 4 - 1.0 / 65536, 5'000'000.5}},
      {{-kFar, -kFar, -kFar}, {kFar - 1, -kFar + 1, -kFar}},
      {{kFar - 20'000'000, 0, 0.5}, {-kFar + 1.0 / 65536, kFar / 3, -100}},
      {{-kFar / 2, -kFar / 2, -kFar / 2}, {kFar / 2, kFar / 2, kFar / 2}},
  };
  const Format format = {GetParam(), Output::kI32x3};
  const auto plan = generator_->Prepare(segments, format);
  ASSERT_TRUE(plan.ok()) << plan.status();
  std::mt19937_64 random(6);
  for (size_t i = 0; i < segments.size(); ++i) {
    const auto g = testing::ReferenceOf(segments[i].start, segments[i].end);
    const testing::Integer n =
        GetParam() == Sampling::kThin ? testing::ThinSteps(g) : testing::EuclideanSteps(g);
    const uint64_t count = plan->offsets[i + 1] - plan->offsets[i];
    ASSERT_EQ(testing::Integer(count), n + 1);
    std::vector<uint64_t> starts = {0, count - 300, count / 2, count / 3};
    for (int more = 0; more < 12; ++more) starts.push_back(random() % (count - 300));
    for (const uint64_t k : starts) {
      std::vector<std::byte> out(300 * 12);
      EmitVoxels(segments, format, plan->offsets, plan->offsets[i] + k, 300, true, out.data());
      const std::vector<Cell> got = CellsOf(out);
      for (uint64_t j = 0; j < 300; ++j)
        ASSERT_EQ(got[j], testing::CellAt(g, k + j, n)) << i << " " << k + j;
    }
  }
}

TEST(CpuGeneratorCover, AnyCellOfALongSegmentIsTheOneWhichThatManyCrossingsLeadTo) {
  const std::vector<SegmentD> segments = {{{0.3, 0, 0}, {20000, -7000.5, 3333.25}},
                                          {{9, 9, 9}, {-6000, 6018, 9}}};
  const Format format = {Sampling::kCover, Output::kI32x3};
  const auto generator = MakeCpuGenerator(1);
  const auto plan = generator->Prepare(segments, format);
  ASSERT_TRUE(plan.ok());
  const std::vector<Cell> expected = Expected(segments, Sampling::kCover);
  ASSERT_EQ(plan->voxels(), expected.size());
  std::mt19937_64 random(7);
  for (int i = 0; i < 5000; ++i) {
    const uint64_t at = random() % expected.size();
    std::vector<std::byte> out(12);
    EmitVoxels(segments, format, plan->offsets, at, 1, false, out.data());
    ASSERT_EQ(CellsOf(out)[0], expected[at]) << at;
  }
}

TEST_P(CpuGenerator, TheOtherFormsHoldTheSameVoxels) {
  std::vector<SegmentD> segments = RandomSegments(8, 200, 500, false);
  for (SegmentD& g : segments) {
    for (auto* p : {&g.start, &g.end}) {
      for (double& v : *p) v = std::abs(v) * 2;  // 0 to 1,000
    }
  }
  const Sampling sampling = GetParam();
  const auto cells = CellsOf(Generated(*generator_, segments, {sampling, Output::kI32x3}));
  const auto floats = Generated(*generator_, segments, {sampling, Output::kF32x3});
  const auto shorts = Generated(*generator_, segments, {sampling, Output::kI16x3});
  const auto packed = Generated(*generator_, segments, {sampling, Output::kPacked});
  ASSERT_EQ(floats.size(), cells.size() * 12);
  ASSERT_EQ(shorts.size(), cells.size() * 6);
  ASSERT_EQ(packed.size(), cells.size() * 4);
  for (size_t i = 0; i < cells.size(); ++i) {
    float f[3];
    int16_t s[3];
    uint32_t p = 0;
    std::memcpy(f, floats.data() + i * 12, 12);
    std::memcpy(s, shorts.data() + i * 6, 6);
    std::memcpy(&p, packed.data() + i * 4, 4);
    for (size_t a = 0; a < 3; ++a) {
      ASSERT_EQ(f[a], static_cast<float>(cells[i][a]));
      ASSERT_EQ(s[a], cells[i][a]);
    }
    ASSERT_EQ(p & 2047, cells[i][0]);
    ASSERT_EQ(p >> 11 & 2047, cells[i][1]);
    ASSERT_EQ(p >> 22, cells[i][2]);
  }
}

// Every instruction set that is compiled and that this processor supports.
TEST_P(CpuGenerator, AllVectorsGiveTheSameBytes) {
  auto segments = RandomSegments(11, 600, 150, false);
  const auto adversarial = Adversarial(3, 300), longer = RandomSegments(12, 40, 3000, false);
  segments.insert(segments.end(), adversarial.begin(), adversarial.end());
  segments.insert(segments.end(), longer.begin(), longer.end());
  for (SegmentD& g : segments) {  // moved to where every form can hold them
    for (auto* p : {&g.start, &g.end}) {
      for (double& v : *p) v = std::min(std::abs(v), 1023.75);
    }
  }
  for (const Output output : {Output::kI32x3, Output::kF32x3, Output::kI16x3, Output::kPacked}) {
    const Format format = {GetParam(), output};
    const auto expected = Generated(*generator_, segments, format);
    int targets = 0;
    for (int64_t left = hwy::SupportedTargets(); left != 0; left &= left - 1) {
      const int64_t target = left & -left;
      hwy::SetSupportedTargetsForTest(target);
      hwy::GetChosenTarget().Update(hwy::SupportedTargets());
      // Not all that the processor supports are compiled.
      if (VectorTarget() == hwy::TargetName(target)) {
        ++targets;
        EXPECT_TRUE(Generated(*generator_, segments, format) == expected)
            << hwy::TargetName(target);
      }
      hwy::SetSupportedTargetsForTest(0);
      hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    }
    EXPECT_GE(targets, 2);
  }
}

// Large outputs bypass the caches, threads share them, and chunks divide them: the bytes are the
// same.
TEST_P(CpuGenerator, ThreadsChunksAndPlacesInMemoryChangeNothing) {
  auto segments = RandomSegments(9, 1500, 1000, false);
  for (SegmentD& g : segments) {
    for (auto* p : {&g.start, &g.end}) {
      for (double& v : *p) v = std::abs(v);
    }
  }
  for (const Output output : {Output::kI32x3, Output::kI16x3, Output::kPacked}) {
    const Format format = {GetParam(), output};
    const auto one = Generated(*generator_, segments, format);
    const auto several = MakeCpuGenerator(3);
    EXPECT_EQ(Generated(*several, segments, format), one);

    const auto plan = several->Prepare(segments, format);
    ASSERT_TRUE(plan.ok());
    std::vector<std::byte> chunks;
    uint64_t next = 0;
    const absl::Status status = several->Stream(
        segments, *plan, format, 5 * 8192, [&](uint64_t first, std::span<const std::byte> voxels) {
          EXPECT_EQ(first, next);
          next += voxels.size() / BytesOf(output);
          chunks.insert(chunks.end(), voxels.begin(), voxels.end());
          return absl::OkStatus();
        });
    EXPECT_TRUE(status.ok()) << status;
    EXPECT_EQ(chunks, one);

    for (const size_t shift : {1, 12, 63}) {
      std::vector<std::byte> out(one.size() + shift + 64, std::byte{0x5A});
      ASSERT_TRUE(
          generator_->Generate(segments, *plan, format, std::span(out).subspan(shift, one.size()))
              .ok());
      EXPECT_EQ(std::memcmp(out.data() + shift, one.data(), one.size()), 0);
      for (size_t i = 0; i < 64; ++i) ASSERT_EQ(out[shift + one.size() + i], std::byte{0x5A});
      for (size_t i = 0; i < shift; ++i) ASSERT_EQ(out[i], std::byte{0x5A});
    }
  }
}

TEST_P(CpuGenerator, WholeEndPointsAreTheSameFromIntegersFloatsAndDoubles) {
  const auto doubles = RandomSegments(10, 100, 4000, true);
  std::vector<SegmentI> integers;
  std::vector<SegmentF> floats;
  for (const SegmentD& g : doubles) {
    SegmentI i;
    SegmentF f;
    for (size_t a = 0; a < 3; ++a) {
      i.start[a] = static_cast<int32_t>(g.start[a]), i.end[a] = static_cast<int32_t>(g.end[a]);
      f.start[a] = static_cast<float>(g.start[a]), f.end[a] = static_cast<float>(g.end[a]);
    }
    integers.push_back(i);
    floats.push_back(f);
  }
  const Format format = {GetParam(), Output::kI32x3};
  const auto expected = Generated(*generator_, doubles, format);
  EXPECT_EQ(Generated(*generator_, integers, format), expected);
  EXPECT_EQ(Generated(*generator_, floats, format), expected);
}

TEST(Generator, WhatCannotBeIsRefusedWithItsPlaceAndValue) {
  const auto generator = MakeCpuGenerator(1);
  const auto message = [&](std::vector<SegmentD> segments, Format format = {}) {
    const auto plan = generator->Prepare(segments, format);
    EXPECT_EQ(plan.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(plan.status().message());
  };
  const SegmentD fine = {{0, 0, 0}, {5, 5, 5}};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message({fine, {{0, 0, 0}, {1, nan, 2}}}), HasSubstr("segments[1].end.y is nan"));
  EXPECT_THAT(message({{{0, 0, -INFINITY}, {1, 1, 2}}}), HasSubstr("segments[0].start.z is -inf"));
  EXPECT_THAT(message({{{2e9, 0, 0}, {1, 1, 2}}}), HasSubstr("within ±2^30"));
  EXPECT_THAT(message({{{-1e9, 0, 0}, {1e9, 1, 2}}}),
              HasSubstr("segments[0] has 2000000000 steps; at most 2^30"));
  EXPECT_THAT(message({{{0, 0, 0}, {17e6, 1, 2}}}, {Sampling::kThin, Output::kF32x3}),
              HasSubstr("x goes from 0 to 17000000; f32x3 holds -16777216 to 16777216"));
  EXPECT_THAT(message({{{0, 0, 0}, {10, 40000, 2}}}, {Sampling::kThin, Output::kI16x3}),
              HasSubstr("y goes from 0 to 40000; i16x3 holds -32768 to 32767"));
  EXPECT_THAT(message({{{0, 0, 0}, {10, 10, 1024}}}, {Sampling::kThin, Output::kPacked}),
              HasSubstr("z goes from 0 to 1024; packed holds 0 to 1023"));
  EXPECT_THAT(message({{{-0.1, 0, 0}, {10, 10, 4}}}, {Sampling::kThin, Output::kPacked}),
              HasSubstr("x goes from -1 to 10"));
  EXPECT_THAT(message(std::vector<SegmentD>(1100, {{0, 0, 0}, {1e9, 0, 0}})),
              HasSubstr("1100 segments have 1100000001100 voxels; at most 2^40"));
}

TEST(Generator, AnOutputThatIsTooSmallIsLeftAsItWas) {
  const auto generator = MakeCpuGenerator(1);
  const std::vector<SegmentD> segments = {{{0, 0, 0}, {9, 0, 0}}};
  const auto plan = generator->Prepare(segments, {});
  ASSERT_TRUE(plan.ok());
  std::vector<std::byte> out(119, std::byte{7});
  const absl::Status status = generator->Generate(segments, *plan, {}, out);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("the output has 119 bytes; 10 voxels of 12 bytes (i32x3) need 120"));
  EXPECT_EQ(out, std::vector<std::byte>(119, std::byte{7}));
  EXPECT_THAT(std::string(generator->Stream(segments, *plan, {}, 100, nullptr).message()),
              HasSubstr("multiple of 8192"));
}

TEST(Generator, APlanOfAnotherBatchSamplingOrFormIsRefused) {
  const auto generator = MakeCpuGenerator(1);
  const std::vector<SegmentD> segments = {{{0, 0, 0}, {5000, 0.9, 0.9}}}, two(2, segments[0]);
  const auto plan = generator->Prepare(segments, {});
  ASSERT_TRUE(plan.ok());
  std::vector<std::byte> out(100'000, std::byte{7});
  const auto message = [&](const std::vector<SegmentD>& of, Format format) {
    const absl::Status status = generator->Generate(of, *plan, format, out);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_EQ(generator->Stream(of, *plan, format, 8192, nullptr), status);
    return std::string(status.message());
  };
  EXPECT_THAT(message(two, {}), HasSubstr("the plan is of 1 segments; the batch has 2"));
  EXPECT_THAT(message(segments, {Sampling::kCover, Output::kI32x3}), HasSubstr("another sampling"));
  EXPECT_THAT(message(segments, {Sampling::kEuclidean, Output::kPacked}),
              HasSubstr("x goes from 0 to 5000; packed holds 0 to 2047"));
  EXPECT_EQ(out, std::vector<std::byte>(100'000, std::byte{7}));
}

TEST(Generator, TheFirstOfSeveralFaultsIsNamedWithItsWholeValue) {
  const auto generator = MakeCpuGenerator(1);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<SegmentD> several = {{{-1e9, 0, 0}, {1e9, 0, 0}}, {{nan, 0, 0}, {1, 1, 1}}};
  EXPECT_THAT(std::string(generator->Prepare(several, {}).status().message()),
              HasSubstr("segments[0] has"));
  const std::vector<SegmentD> just = {{{0, 0, 1073741825.0}, {0, 0, 1073741824.0}}};
  EXPECT_THAT(std::string(generator->Prepare(just, {}).status().message()),
              HasSubstr("start.z is 1073741825;"));
}

TEST(Generator, AChunkMayBeLargerThanAllThereIs) {
  const auto generator = MakeCpuGenerator(1);
  const std::vector<SegmentD> segments = {{{0, 0, 0}, {10'000, 0, 0}}};
  const auto plan = generator->Prepare(segments, {});
  uint64_t voxels = 0;
  EXPECT_TRUE(generator
                  ->Stream(segments, *plan, {}, ~uint64_t{8191},
                           [&](uint64_t, std::span<const std::byte> chunk) {
                             voxels += chunk.size() / 12;
                             return absl::OkStatus();
                           })
                  .ok());
  EXPECT_EQ(voxels, 10'001u);
}

TEST(Generator, NoSegmentsAreNoVoxels) {
  const auto generator = MakeCpuGenerator(2);
  const std::vector<SegmentF> none;
  const auto plan = generator->Prepare(none, {});
  ASSERT_TRUE(plan.ok());
  EXPECT_EQ(plan->voxels(), 0u);
  EXPECT_TRUE(generator->Generate(none, *plan, {}, {}).ok());
}

TEST(Generator, AnErrorOfWhoTakesChunksEndsTheWork) {
  const auto generator = MakeCpuGenerator(1);
  const std::vector<SegmentD> segments = {{{0, 0, 0}, {50'000, 0, 0}}};
  const auto plan = generator->Prepare(segments, {});
  int chunks = 0;
  const absl::Status status = generator->Stream(segments, *plan, {}, 8192, [&](uint64_t, auto) {
    return ++chunks == 3 ? absl::CancelledError("enough") : absl::OkStatus();
  });
  EXPECT_EQ(status, absl::CancelledError("enough"));
  EXPECT_EQ(chunks, 3);
}

}  // namespace
}  // namespace voxeld::gpu::generate
