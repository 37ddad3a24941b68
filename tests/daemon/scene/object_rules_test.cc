// Tests objects and their instances.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/scene/engine_delta.h"
#include "tests/daemon/scene/store_fixture.h"

namespace voxeld::daemon {
namespace {

using testing::Begin;
using testing::CheckIndices;
using testing::Define;
using testing::DeleteId;
using testing::Dots;
using testing::End;
using ::testing::HasSubstr;
using testing::MakeAuthor;
using testing::PutInstance;
using testing::Scale;
using testing::Shift;
using testing::StoreFixture;
using testing::Undefine;

ObjectPart Part(float x) { return {Dots(x), {}}; }
ObjectPart Use(std::string object, gpu::Affine transform = {}) {
  return {InstanceRef{std::move(object)}, transform};
}

const Object* Find(const StoreFixture& f, const std::string& name) {
  return f.store.snapshot()->FindObject({1, name});
}

TEST(ObjectRules, AnInstanceNeedsItsObject) {
  StoreFixture f;
  const CommitResult result = f.Commit(PutInstance("a", "x", "o"), Define("o", {Part(1)}),
                                       PutInstance("a", "y", "o"), Define("p", {Use("nobody")}));
  ASSERT_EQ(result.issues.size(), 2u);
  EXPECT_EQ(result.issues[0].reason, Reason::kNotFound);
  EXPECT_EQ(result.issues[0].field, "upsert.entity.primitive.instance.object");
  EXPECT_EQ(result.issues[1].reason, Reason::kNotFound);
  EXPECT_EQ(result.issues[1].field, "define_object.definition.parts[0].primitive.instance.object");
  EXPECT_EQ(f.Scene(), "a: y");
  EXPECT_EQ(Find(f, "p"), nullptr);
}

TEST(ObjectRules, NamesInMessagesArePrintable) {
  StoreFixture f;
  const CommitResult result =
      f.Commit(PutInstance("a", "x", "o\x01\n"), Define("p\x1b", {Use("p\x1b")}),
               PutInstance("a", "y", std::string(100, 'z')));
  ASSERT_EQ(result.issues.size(), 3u);
  EXPECT_EQ(result.issues[0].message, "object \"o\\x01\\n\" is not defined; define it first");
  EXPECT_THAT(result.issues[1].message, HasSubstr("\"p\\x1b\" would contain itself"));
  EXPECT_THAT(result.issues[2].message, HasSubstr(std::string(64, 'z') + "…\""));
}

TEST(ObjectRules, ObjectsBelongToTheirOwner) {
  StoreFixture f;
  f.Commit(MakeAuthor(2, 22), Define("theirs", {Part(1)}));
  EXPECT_EQ(f.Commit(PutInstance("a", "x", "theirs")).issues[0].reason, Reason::kNotFound);
}

// A primitive of three geometries, like a text of three letters, each a step further along x.
Content Letters(float x) {
  auto group = std::make_shared<GroupData>();
  const Content dot = Dots(x);
  for (int i = 0; i < 3; ++i) {
    gpu::Affine step;
    step.m[3] = 10.0 * i;
    group->parts.push_back({std::get<GeometryPtr>(dot), step});
  }
  group->max[0] = double{x} + 20;
  group->kind = "text";
  return GroupPtr(std::move(group));
}

TEST(ObjectRules, AGroupCountsAsWhatItDraws) {
  StoreFixture f;
  f.Commit(Define("word", {{Letters(1), {}}, Part(1)}), PutInstance("a", "x", "word"),
           PutInstance("a", "y", "word"));
  EXPECT_EQ(Find(f, "word")->drawables, 4u);
  EXPECT_EQ(Find(f, "word")->bounds.max[0], 21);
  EXPECT_EQ(f.store.snapshot()->total.drawables, 8u);
  EngineScene scene;
  EXPECT_GT(scene.Plan(f.store.snapshot()), 0u);
  EXPECT_EQ(scene.geometries(), 2u) << "letters share theirs; the part has its own";
  const GroupPtr letters = std::get<GroupPtr>(Letters(2));
  EXPECT_GT(letters->bytes(), letters->parts[0].geometry->bytes());
  EXPECT_LT(letters->bytes(), 2 * letters->parts[0].geometry->bytes() + 1000) << "counted once";
}

TEST(ObjectRules, CyclesAreRefused) {
  StoreFixture f;
  f.Commit(Define("leaf", {Part(1)}), Define("middle", {Use("leaf")}),
           Define("top", {Use("middle")}));
  for (const char* child : {"leaf", "middle", "top"}) {
    const CommitResult result = f.Commit(Define("leaf", {Part(2), Use(child)}));
    ASSERT_EQ(result.issues.size(), 1u) << child;
    EXPECT_EQ(result.issues[0].reason, Reason::kCycle);
    EXPECT_EQ(result.issues[0].field,
              "define_object.definition.parts[1].primitive.instance.object");
  }
  EXPECT_EQ(Find(f, "leaf")->data->parts.size(), 1u);
  EXPECT_EQ(CheckIndices(*f.store.snapshot()), "");
}

TEST(ObjectRules, DepthIsLimitedFromBothEnds) {
  Limits limits;
  limits.max_instance_depth = 3;
  StoreFixture f(limits);
  EXPECT_EQ(f.Commit(Define("1", {Part(1)}), Define("2", {Use("1")}), Define("3", {Use("2")}))
                .refused_operations,
            0u);
  EXPECT_EQ(Find(f, "3")->depth, 3u);
  const CommitResult above = f.Commit(Define("4", {Use("3")}));
  ASSERT_EQ(above.issues.size(), 1u);
  EXPECT_EQ(above.issues[0].reason, Reason::kCycle);
  EXPECT_THAT(above.issues[0].message, HasSubstr("4 deep"));
  // Deepening the lower objects deepens the upper ones.
  f.Commit(Define("0", {Part(1)}));
  EXPECT_EQ(f.Commit(Define("1", {Use("0")})).issues[0].reason, Reason::kCycle);
  EXPECT_EQ(Find(f, "1")->depth, 1u);
  f.Commit(Define("3", {Part(1)}));
  EXPECT_EQ(f.Commit(Define("1", {Use("0")})).refused_operations, 0u);
  EXPECT_EQ(Find(f, "2")->depth, 3u);
}

TEST(ObjectRules, InstancesCountAsWhatTheyDraw) {
  Limits limits;
  limits.max_entities_per_owner = 100;
  StoreFixture f(limits);
  f.Commit(Define("five", {Part(1), Part(2), Part(3), Part(4), Part(5)}),
           Define("thirty",
                  {Use("five"), Use("five"), Use("five"), Use("five"), Use("five"), Use("five")}),
           Define("none", {}));
  EXPECT_EQ(f.Commit(PutInstance("a", "1", "thirty"), PutInstance("a", "2", "thirty"),
                     PutInstance("a", "3", "thirty"), PutInstance("a", "4", "none"))
                .refused_operations,
            0u);
  EXPECT_EQ(f.Tally().drawables, 91u);
  EXPECT_EQ(f.Commit(PutInstance("a", "5", "thirty")).issues[0].reason, Reason::kQuotaExceeded);
  // A definition that would take its instances over the quota is refused.
  const CommitResult grown =
      f.Commit(Define("five", {Part(1), Part(2), Part(3), Part(4), Part(5), Part(6)}));
  ASSERT_EQ(grown.issues.size(), 1u);
  EXPECT_EQ(grown.issues[0].reason, Reason::kQuotaExceeded);
  EXPECT_EQ(Find(f, "five")->data->parts.size(), 5u);
  EXPECT_EQ(f.Commit(Define("five", {Part(1)})).refused_operations, 0u);
  EXPECT_EQ(f.Tally().drawables, 19u);
  EXPECT_EQ(CheckIndices(*f.store.snapshot()), "");
}

TEST(ObjectRules, NestingCannotOverflowTheCount) {
  StoreFixture f;
  std::vector<ObjectPart> parts(4096, Part(1));
  f.Commit(Define("1", parts));
  for (int level = 2; level <= 8; ++level) {
    parts.assign(4096, Use(std::to_string(level - 1)));
    EXPECT_EQ(f.Commit(Define(std::to_string(level), parts)).refused_operations, 0u);
  }
  EXPECT_EQ(Find(f, "8")->drawables, UINT64_MAX);
  EXPECT_EQ(f.Commit(PutInstance("a", "x", "8")).issues[0].reason, Reason::kQuotaExceeded);
}

TEST(ObjectRules, RangeIsCheckedThroughInstances) {
  StoreFixture f;
  f.store.SetViews({{"d", gpu::Affine()}});
  f.Commit(Define("o", {{Dots(1), Shift(1000)}}), Define("p", {Use("o", Scale(1000, 1, 1))}));
  EXPECT_EQ(f.Commit(PutInstance("a", "far", "p", Scale(2000, 1, 1))).issues[0].reason,
            Reason::kOutOfRange);
  EXPECT_EQ(f.Commit(PutInstance("a", "near", "p")).refused_operations, 0u);
  const CommitResult result = f.Commit(Define("o", {{Dots(1), Shift(2e6)}}));
  ASSERT_EQ(result.issues.size(), 1u);
  EXPECT_EQ(result.issues[0].reason, Reason::kOutOfRange);
  EXPECT_THAT(result.issues[0].message, HasSubstr("instance \"near\" in layer \"a\""));
}

TEST(ObjectRules, AnObjectInUseIsDeletedOnlyWithCascade) {
  StoreFixture f;
  f.Commit(Define("o", {Part(1)}), Define("p", {Use("o"), Part(2), Use("o")}),
           Define("q", {Use("p")}), PutInstance("a", "x", "o"), PutInstance("b", "y", "q"));
  const CommitResult refused = f.Commit(Undefine("o"));
  ASSERT_EQ(refused.issues.size(), 1u);
  EXPECT_EQ(refused.issues[0].reason, Reason::kInUse);
  EXPECT_THAT(refused.issues[0].message, HasSubstr("1 instances and is part of 1 objects"));
  EXPECT_EQ(f.Commit(Undefine("nobody")).issues[0].reason, Reason::kNotFound);

  EXPECT_EQ(f.Commit(Undefine("o", true)).refused_operations, 0u);
  EXPECT_EQ(f.Scene(), "a:; b: y");
  EXPECT_EQ(Find(f, "o"), nullptr);
  EXPECT_EQ(Find(f, "p")->data->parts.size(), 1u);
  EXPECT_EQ(Find(f, "q")->drawables, 1u);
  EXPECT_EQ(CheckIndices(*f.store.snapshot()), "");
  f.Commit(DeleteId("b", "y"));
  EXPECT_EQ(f.Commit(Undefine("q"), Undefine("p")).refused_operations, 0u);
}

TEST(ObjectRules, AFramesInstancesAreCheckedAtItsEnd) {
  StoreFixture f;
  f.Commit(Define("o", {Part(1)}));
  const CommitResult result =
      f.Commit(Begin("a"), PutInstance("a", "x", "o"), PutInstance("a", "y", "late"),
               Define("late", {Part(2)}), Undefine("o"), End("a"));
  ASSERT_EQ(result.issues.size(), 1u);
  EXPECT_EQ(result.issues[0].id, "x");
  EXPECT_EQ(result.issues[0].reason, Reason::kNotFound);
  EXPECT_EQ(f.Scene(), "a: y");
}

TEST(ObjectRules, AForgottenOwnersObjectsGoOnceNothingIsLeft) {
  StoreFixture f;
  f.Commit(Define("o", {Part(1)}), Define("p", {Use("o")}), PutInstance("a", "x", "p"));
  f.store.ForgetOwner(1);
  EXPECT_NE(Find(f, "o"), nullptr);  // a remaining layer draws it
  f.store.RemoveLayers([](const OwnedName&, const Layer&) { return true; }, false);
  f.store.ForgetOwner(1);
  EXPECT_EQ(f.store.snapshot()->objects.size(), 0u);
  EXPECT_EQ(f.Tally(), OwnerTally());
  EXPECT_EQ(CheckIndices(*f.store.snapshot()), "");
}

}  // namespace
}  // namespace voxeld::daemon
