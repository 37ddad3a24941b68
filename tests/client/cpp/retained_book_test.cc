#include "client/cpp/src/retained_book.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/cpp/src/encode.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::client {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using What = DeleteOperation::What;

UpsertOperation Put(const std::string& layer, const std::string& id, const Shape& shape = Sphere{},
                    int64_t lifetime_ns = 0) {
  return {.layer = layer,
          .id = id,
          .primitive = *EncodePrimitive(shape, {}),
          .lifetime_ns = lifetime_ns,
          .label = {}};
}

// Returns one word for each operation.
std::vector<std::string> Words(const std::vector<Operation>& operations) {
  std::vector<std::string> words;
  for (const Operation& operation : operations) {
    if (const auto* upsert = std::get_if<UpsertOperation>(&operation)) {
      words.push_back(upsert->layer + "/" + upsert->id);
    } else if (const auto* layer = std::get_if<LayerOperation>(&operation)) {
      words.push_back(layer->layer);
    } else if (const auto* define = std::get_if<DefineOperation>(&operation)) {
      words.push_back("=" + define->object);
    } else {
      words.push_back("?");
    }
  }
  return words;
}

class RetainedBookTest : public testing::Test {
 protected:
  void Apply(const std::vector<Operation>& operations, const Refusals& refusals = {}) {
    book_.Apply(operations, refusals, now_);
  }
  std::vector<std::string> Restored() { return Words(book_.Restore(now_)); }

  RetainedBook book_;
  int64_t now_ = 1000;
};

TEST_F(RetainedBookTest, KeepsTheOrderInWhichThingsCame) {
  EXPECT_THAT(Restored(), IsEmpty());
  Apply({Put("z", "2"), Put("a", "1"), Put("z", "1")});
  EXPECT_THAT(Restored(), ElementsAre("z", "z/2", "z/1", "a", "a/1"));
  Apply({Put("z", "2")});
  EXPECT_THAT(Restored(), ElementsAre("z", "z/1", "z/2", "a", "a/1"));
}

TEST_F(RetainedBookTest, Deletes) {
  Apply({Put("l", "a1"), Put("l", "a2"), Put("l", "b"), Put("m", "a1"), Put("n", "x")});
  Apply({DeleteOperation{"l", What::kPrefix, "a"}, DeleteOperation{"m", What::kId, "a1"},
         DeleteOperation{"n", What::kLayer, ""}, DeleteOperation{"none", What::kLayer, ""}});
  EXPECT_THAT(Restored(), ElementsAre("l", "l/b", "m", "n"));
  Apply({DeleteOperation{"", What::kAllMine, ""}});
  EXPECT_THAT(Restored(), ElementsAre("l", "m", "n"));
}

TEST_F(RetainedBookTest, FramesReplaceAndThoseGivenUpDoNot) {
  Apply({Put("l", "old")});
  Apply({FrameOperation{"l", {Put("l", "f1"), Put("l", "f2")}}});
  EXPECT_THAT(Restored(), ElementsAre("l", "l/f1", "l/f2"));
  Apply({FrameOperation{}});
  EXPECT_THAT(Restored(), ElementsAre("l", "l/f1", "l/f2"));
}

TEST_F(RetainedBookTest, TransformsAndLooksAreThoseOfNow) {
  Apply({Put("l", "a"), LayerOperation{"l", {.opacity = uint8_t{9}, .order = 3, .mask = "m"}}});
  Apply({TransformOperation{"l", "a", Affine::Translate({1, 2, 3})},
         TransformOperation{"l", "none", Affine()}, LayerOperation{"l", {.order = -1}}});
  const std::vector<Operation> restored = book_.Restore(now_);
  ASSERT_EQ(restored.size(), 2u);
  const LayerLook& look = std::get<LayerOperation>(restored[0]).look;
  EXPECT_EQ(look.opacity, 9);
  EXPECT_EQ(look.order, -1);
  EXPECT_EQ(look.mask, "m");
  EXPECT_FALSE(look.visible.has_value());
  EXPECT_EQ(std::get<UpsertOperation>(restored[1]).transform, Affine::Translate({1, 2, 3}));
}

TEST_F(RetainedBookTest, WhatWasRefusedIsNotThere) {
  Apply({Put("l", "good"), Put("l", "bad"), *EncodeDefinition("no", {})},
        {.requests = {{7, 2}, {8, 1}}, .refused = {{7, "l", "bad"}, {8, "", "no"}}});
  EXPECT_THAT(Restored(), ElementsAre("l", "l/good"));
}

TEST_F(RetainedBookTest, ARefusalIsOfOneOperationAndNotOfAllOnItsEntity) {
  Apply({Put("l", "a"), TransformOperation{"l", "a", Affine::Scale(2)}},
        {.requests = {{7, 1}, {8, 1}}, .refused = {{8, "l", "a"}}});
  ASSERT_THAT(Restored(), ElementsAre("l", "l/a"));
  EXPECT_EQ(std::get<UpsertOperation>(book_.Restore(now_)[1]).transform, Affine());
  // If two entities replace each other, only the other is written; removals do not shift the order.
  Apply({Put("l", "b"), Put("l", "a", Sphere{}, 500), Put("l", "a", Sphere{}, 600),
         DeleteOperation{"l", What::kId, "b"}},
        {.requests = {{10, 2}, {11, 1}, {12, 1}}, .refused = {{11, "l", "a"}, {12, "l", ""}}});
  ASSERT_THAT(Restored(), ElementsAre("l", "l/b", "l/a"));
  EXPECT_EQ(std::get<UpsertOperation>(book_.Restore(now_)[2]).lifetime_ns, 500);
}

TEST_F(RetainedBookTest, RefusalsWithinAFrameAndOfAFrame) {
  const FrameOperation frame{"l", {Put("l", "x"), Put("l", "y"), Put("l", "z")}};
  Apply({FrameOperation{}, frame, Put("m", "after")},
        {.requests = {{5, 1}, {6, 2}, {7, 1}, {8, 1}, {9, 1}}, .refused = {{6, "l", "y"}}});
  EXPECT_THAT(Restored(), ElementsAre("l", "l/x", "l/z", "m", "m/after"));
  Apply({FrameOperation{"n", {Put("n", "x")}}},
        {.requests = {{15, 1}, {16, 1}, {17, 1}}, .refused = {{15, "n", ""}}});
  EXPECT_THAT(Restored(), ElementsAre("l", "l/x", "l/z", "m", "m/after"));
}

TEST_F(RetainedBookTest, WhatIsInDoubtKeepsItsPlace) {
  Apply({Put("l", "before")});
  book_.Doubt(4, {Put("l", "a", Sphere{}, 500), Put("l", "gone")}, now_);
  book_.Doubt(5, {Put("l", "never")}, now_);
  Apply({Put("l", "a", Sphere{}, 600), DeleteOperation{"l", What::kId, "gone"}});
  EXPECT_THAT(Restored(), ElementsAre("l", "l/before"));
  book_.WasApplied(77);
  book_.WasApplied(4);
  EXPECT_THAT(Restored(), ElementsAre("l", "l/before", "l/a", "l/gone"));
  book_.EndDoubts();
  ASSERT_THAT(Restored(), ElementsAre("l", "l/before", "l/a"));
  EXPECT_EQ(std::get<UpsertOperation>(book_.Restore(now_)[2]).lifetime_ns, 600);
  Apply({Put("l", "after")});
  EXPECT_THAT(Restored(), ElementsAre("l", "l/before", "l/a", "l/after"));
}

TEST_F(RetainedBookTest, ObjectsComeBeforeThoseThatDrawThem) {
  const auto define = [](const std::string& name, const std::vector<std::string>& uses) {
    std::vector<Part> parts;
    parts.reserve(uses.size());
    for (const std::string& used : uses) parts.push_back({.shape = Instance{used}});
    return *EncodeDefinition(name, parts);
  };
  Apply({define("a", {}), define("b", {}), define("c", {"a"}), define("a", {"b"}),
         Put("l", "i", Instance{"c"}), Put("l", "j", Instance{"a"}), Put("l", "k")});
  EXPECT_THAT(Restored(), ElementsAre("=b", "=a", "=c", "l", "l/i", "l/j", "l/k"));
  Apply({RemoveObjectOperation{"c", true}});
  EXPECT_THAT(Restored(), ElementsAre("=b", "=a", "l", "l/j", "l/k"));
}

TEST_F(RetainedBookTest, WhatIsOverIsForgotten) {
  Apply({Put("l", "stays")});
  for (int i = 0; i < 10'000; ++i) {
    Apply({Put("l", std::to_string(i), Sphere{}, 100), Put("l", "again", Sphere{}, 1'000'000)});
    ++now_;
    ASSERT_LE(book_.entities(), 102u);
  }
  // An entity that is inserted again lives on, and what was deleted in the meantime does not delete
  // another.
  Apply({Put("l", "9999", Sphere{}, 1000), DeleteOperation{"l", What::kId, "again"},
         Put("l", "again")});
  now_ += 999;
  Apply({});
  EXPECT_THAT(Restored(), ElementsAre("l", "l/stays", "l/9999", "l/again"));
  now_ += 1'000'000;
  Apply({});
  EXPECT_EQ(book_.entities(), 2u);
}

TEST_F(RetainedBookTest, LifetimesRunOn) {
  Apply({Put("l", "short", Sphere{}, 100), Put("l", "long", Sphere{}, 1000)});
  now_ += 100;
  const std::vector<Operation> restored = book_.Restore(now_);
  EXPECT_THAT(Words(restored), ElementsAre("l", "l/long"));
  EXPECT_EQ(std::get<UpsertOperation>(restored[1]).lifetime_ns, 900);
}

}  // namespace
}  // namespace voxeld::client
