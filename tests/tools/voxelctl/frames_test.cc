// Tests sequences of models: which files form a sequence, and one placement for all of them.
#include "tools/voxelctl/import/frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/scene/placement.h"

namespace voxeld::voxelctl {
namespace frames_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Sequences, AreFoundByTheirNumbers) {
  TempFolder folder;
  for (const char* name : {"a_010.xyz", "a_002.xyz", "a_1000.xyz", "a_02.xyz", "a_0003.xyz",
                           "a_x01.xyz", "b_001.xyz", "a_001.xyz.bak"})
    folder.Write(name, "1 2 3\n");
  const auto three = FindSequence(folder.Path("a_###.xyz"));
  ASSERT_THAT(three, IsOk());
  EXPECT_THAT(*three, ElementsAre(folder.Path("a_002.xyz"), folder.Path("a_010.xyz"),
                                  folder.Path("a_1000.xyz")));
  EXPECT_EQ(*FindSequence(folder.Path("a_%03d.xyz")), *three);
  EXPECT_THAT(*FindSequence(folder.Path("a_##.xyz")),
              ElementsAre(folder.Path("a_02.xyz"), folder.Path("a_1000.xyz")));
  EXPECT_THAT(std::string(FindSequence(folder.Path("c_##.xyz")).status().message()),
              HasSubstr("there is no such file; names with 2 digits"));
  EXPECT_THAT(std::string(FindSequence("/nowhere/c_##.xyz").status().message()),
              HasSubstr("/nowhere: No such file"));
}

TEST(Sequences, AreNamedWithAPlaceForANumber) {
  TempFolder folder;
  EXPECT_TRUE(IsSequence("a##.obj"));
  EXPECT_TRUE(IsSequence("a%d.obj"));
  EXPECT_TRUE(IsSequence("a%04d.obj"));
  for (const char* name : {"a.obj", "a%s.obj", "100%.obj", "a%4d.obj", "a%099d.obj", "a##/b.obj"})
    EXPECT_FALSE(IsSequence(name)) << name;
  EXPECT_FALSE(IsSequence(folder.Write("c#1.obj", "x"))) << "a file of that name";
}

TEST(Sequences, AreReadAhead) {
  TempFolder folder;
  FileFrames frames({folder.Write("a.xyz", "1 2 3\n"), folder.Path("gone.xyz")}, {}, nullptr);
  FrameAhead ahead(frames);
  ahead.Ask(0);
  const auto first = ahead.Take();
  ASSERT_THAT(first, IsOk());
  EXPECT_EQ(first->parts[0].positions[0], (Point3{1, 2, 3}));
  ahead.Ask(1);
  EXPECT_THAT(std::string(ahead.Take().status().message()), HasSubstr("gone.xyz"));
}

TEST(Sequences, HaveOnePlace) {
  const auto at = [](double x) {
    Model model;
    model.parts.push_back({.kind = Kind::kPoints, .positions = {{x, 0, 0}, {x, 0, 1}}});
    return model;
  };
  FramePlacement placement(Up::kAuto);
  placement.Measure(at(0));
  placement.Measure(at(4));
  placement.Fit(DisplaySpace(), false);
  for (const auto& [x, there] : {std::pair(0.0, -0.97), {1.0, -0.485}, {4.0, 0.97}}) {
    Model model = at(x);
    placement.Place(&model);
    EXPECT_NEAR(model.parts[0].positions[0].x, there, 1e-12);
  }
}

}  // namespace frames_test
}  // namespace voxeld::voxelctl
