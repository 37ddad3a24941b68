// Tests which generator is chosen, its cost, and where the choice is stored.
#include "gpu/generate/auto_generator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace voxeld::gpu::generate {
namespace {

// A generator that produces nothing and counts its calls.
class Counting final : public Generator {
 public:
  explicit Counting(int* calls) : calls_(calls) {}
  std::string name() const override { return "counting"; }
  absl::StatusOr<Plan> Prepare(const Batch& batch, Format format) override {
    return MakePlan(batch, format, *executor_);
  }
  absl::Status Generate(const Batch&, const Plan&, Format, std::span<std::byte>) override {
    ++*calls_;
    return absl::OkStatus();
  }
  absl::Status Stream(const Batch&, const Plan&, Format, uint64_t, const TakeChunk&) override {
    ++*calls_;
    return absl::OkStatus();
  }

 private:
  int* const calls_;
  const std::unique_ptr<Executor> executor_ = MakeSerialExecutor();
};

// One starts quickly and takes 1 ns a voxel; the other starts slowly and takes a tenth of that.
CostCurve Near() { return {{{1000, 1e-6}, {1'000'000, 1e-3}}, 10e-9}; }
CostCurve Far() { return {{{1000, 50e-6}, {1'000'000, 150e-6}}, 1e-9}; }

TEST(CostCurve, GoesThroughItsPointsAndOnBeyondThem) {
  EXPECT_NEAR(Near().SecondsFor(1000, 1), 1e-6, 1e-12);
  EXPECT_NEAR(Near().SecondsFor(31'623, 1), 31.6e-6, 1e-7);
  EXPECT_NEAR(Near().SecondsFor(10'000'000, 1), 10e-3, 1e-6);
  EXPECT_NEAR(Near().SecondsFor(1, 1), 1e-6, 1e-12) << "nothing is cheaper than the least";
  EXPECT_NEAR(Near().SecondsFor(1000, 101), 2e-6, 1e-12);
}

class AutoGeneratorTest : public ::testing::Test {
 protected:
  AutoGeneratorTest() {
    std::vector<Candidate> candidates;
    candidates.push_back({"near", std::make_unique<Counting>(&near_)});
    candidates.push_back({"far", std::make_unique<Counting>(&far_)});
    generator_ = std::make_unique<AutoGenerator>(
        std::move(candidates), std::vector<CostCurve>{Near(), Far(), Far(), Near()});
  }
  int near_ = 0, far_ = 0;
  std::unique_ptr<AutoGenerator> generator_;
};

TEST_F(AutoGeneratorTest, FewVoxelsAreMadeNearManyFarAndWhereTheyCrossItChanges) {
  EXPECT_EQ(generator_->Choose(1000, 1), 0u);
  EXPECT_EQ(generator_->Choose(1'000'000, 1), 1u);
  uint64_t crossing = 1000;
  while (generator_->Choose(crossing, 1) == 0) ++crossing;
  EXPECT_NEAR(Near().SecondsFor(crossing, 1), Far().SecondsFor(crossing, 1), 1e-8);
  EXPECT_EQ(generator_->Choose(2 * crossing, 1, {Sampling::kThin, Output::kPacked}), 0u)
      << "a third of the bytes";
  EXPECT_EQ(generator_->Choose(4 * crossing, 1, {Sampling::kThin, Output::kPacked}), 1u);
  EXPECT_EQ(generator_->Choose(1000, 1, {Sampling::kCover, Output::kI32x3}), 1u)
      << "whose cost differs";
  EXPECT_EQ(generator_->Choose(2000, 100'000), 1u) << "many segments count too";
}

TEST_F(AutoGeneratorTest, WhatIsChosenIsCalled) {
  const std::vector<Segment<int32_t>> few = {{{0, 0, 0}, {500, 0, 0}}},
                                      many = {{{0, 0, 0}, {5'000'000, 0, 0}}};
  for (const auto& [segments, near, far] : {std::tuple(few, 2, 0), std::tuple(many, 2, 2)}) {
    const auto plan = generator_->Prepare(segments, {});
    ASSERT_TRUE(plan.ok());
    EXPECT_TRUE(generator_->Generate(segments, *plan, {}, {}).ok());
    EXPECT_TRUE(generator_->Stream(segments, *plan, {}, 8192, nullptr).ok());
    EXPECT_EQ(near_, near);
    EXPECT_EQ(far_, far);
  }
}

TEST(CostText, IsReadBackAndWhatIsNotItsOwnIsRefused) {
  const std::string text = ToText("machine", {{"near", Near()}, {"far", Far()}});
  const auto curves = FromText(text, "machine", {"near", "far"});
  ASSERT_TRUE(curves.ok()) << curves.status();
  ASSERT_EQ(curves->size(), 2u);
  EXPECT_EQ((*curves)[1].points, Far().points);
  EXPECT_EQ((*curves)[0].seconds_a_segment, 10e-9);
  EXPECT_EQ(FromText(text, "another", {"near", "far"}).status().code(),
            absl::StatusCode::kNotFound);
  EXPECT_EQ(FromText(text, "machine", {"near", "other"}).status().code(),
            absl::StatusCode::kNotFound);
  EXPECT_EQ(FromText("", "machine", {"near"}).status().code(), absl::StatusCode::kDataLoss);
  std::string bad = text;
  bad.replace(bad.find("1000 "), 5, "abcd ");
  EXPECT_EQ(FromText(bad, "machine", {"near", "far"}).status().code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(FromText(text.substr(0, text.size() / 2), "machine", {"near", "far"}).ok(), false);
}

TEST(AutoGenerator, MeasuresOnceAndKeepsItForTheNextTime) {
  const std::filesystem::path folder = ::testing::TempDir() + "voxeld-costs-test";
  std::filesystem::remove_all(folder);
  const std::string file = folder / "below" / "costs";
  int calls = 0;
  const auto make = [&] {
    std::vector<Candidate> candidates;
    candidates.push_back({"one", std::make_unique<Counting>(&calls)});
    return AutoGenerator::Make(std::move(candidates), file);
  };
  ASSERT_TRUE(make().ok());
  EXPECT_GT(calls, 10) << "measured";
  const int measured = calls;
  ASSERT_TRUE(make().ok());
  EXPECT_EQ(calls, measured) << "read";
  std::ofstream(file) << "something else";
  ASSERT_TRUE(make().ok());
  EXPECT_GT(calls, measured) << "measured again";
  EXPECT_TRUE(AutoGenerator::Make({}, "").status().code() == absl::StatusCode::kInvalidArgument);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace voxeld::gpu::generate
