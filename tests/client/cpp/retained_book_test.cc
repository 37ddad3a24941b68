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

// One word for each operation.
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
  void Apply(const std::vector<Operation>& operations, const std::vector<Issue>& issues = {}) {
    book_.Apply(operations, issues, now_);
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
  Apply({Put("l", "a"), LayerOperation{"l", {.opacity = uint8_t{9}, .order = 3}}});
  Apply({TransformOperation{"l", "a", Affine::Translate({1, 2, 3})},
         TransformOperation{"l", "none", Affine()}, LayerOperation{"l", {.order = -1}}});
  const std::vector<Operation> restored = book_.Restore(now_);
  ASSERT_EQ(restored.size(), 2u);
  const LayerLook& look = std::get<LayerOperation>(restored[0]).look;
  EXPECT_EQ(look.opacity, 9);
  EXPECT_EQ(look.order, -1);
  EXPECT_FALSE(look.visible.has_value());
  EXPECT_EQ(std::get<UpsertOperation>(restored[1]).transform, Affine::Translate({1, 2, 3}));
}

TEST_F(RetainedBookTest, WhatWasRefusedIsNotThere) {
  Issue issue;
  issue.layer = "l";
  issue.id = "bad";
  Issue object;
  object.id = "no";
  Apply({Put("l", "good"), Put("l", "bad"), *EncodeDefinition("no", {})}, {issue, object});
  EXPECT_THAT(Restored(), ElementsAre("l", "l/good"));
}

TEST_F(RetainedBookTest, ObjectsComeBeforeThoseThatDrawThem) {
  const auto define = [](const std::string& name, const std::vector<std::string>& uses) {
    std::vector<Part> parts;
    for (const std::string& used : uses) parts.push_back({.shape = Instance{used}});
    return *EncodeDefinition(name, parts);
  };
  Apply({define("a", {}), define("b", {}), define("c", {"a"}), define("a", {"b"}),
         Put("l", "i", Instance{"c"}), Put("l", "j", Instance{"a"}), Put("l", "k")});
  EXPECT_THAT(Restored(), ElementsAre("=b", "=a", "=c", "l", "l/i", "l/j", "l/k"));
  Apply({RemoveObjectOperation{"c", true}});
  EXPECT_THAT(Restored(), ElementsAre("=b", "=a", "l", "l/j", "l/k"));
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
