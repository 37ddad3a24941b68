// A build without VOXELD_IMPORTERS names the option that adds a format, and reads the formats that every build reads.
#include <gtest/gtest.h>

#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/animation.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace {

TEST(ImportersNotBuilt, AFormatThatTheyAddIsAnsweredWithTheOption) {
  EXPECT_THAT(ImportFile(DataFile("arrow.obj"), {}),
              Fails(Words{"arrow.obj: this build reads ",
                          "configure with -DVOXELD_IMPORTERS=ON for .obj"}));
  EXPECT_THAT(ImportFile(DataFile("house.ifc"), {}), Fails(Words{"ON for .ifc"}));
}

TEST(ImportersNotBuilt, AFolderAndAnAnimationAreAnsweredWithTheOption) {
  TempFolder folder;
  EXPECT_THAT(ImportFile(folder.Path("."), {}), Fails(Words{"ON for folders of DICOM slices"}));
  EXPECT_THAT(OpenAnimation(DataFile("arrow.obj"), 1, 20), Fails(Words{"ON for --animate"}));
}

TEST(ImportersNotBuilt, AnUnknownExtensionIsNotSaidToBeAdded) {
  TempFolder folder;
  EXPECT_THAT(ImportFile(folder.Write("a.docx", "PK\x03\x04"), {}),
              Fails(Words{"files of type .docx are not read", ".geojson"}));
}

TEST(ImportersNotBuilt, OtherFormatsAreRead) {
  EXPECT_THAT(ImportFile(DataFile("points.ply"), {}), IsOk());
  EXPECT_THAT(ImportFile(DataFile("quad.topojson"), {}), IsOk());
}

}  // namespace
}  // namespace voxeld::voxelctl
