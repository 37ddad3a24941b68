// A build without VOXELD_IMPORTERS names the command that adds a format, and reads the formats that every build reads.
#include <gtest/gtest.h>

#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/animation.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace {

TEST(ImportersNotBuilt, UnsupportedFormatReportsCommandsThatAddIt) {
  EXPECT_THAT(
      ImportFile(DataFile("arrow.obj"), {}),
      Fails(Words{
          "arrow.obj: this build reads ",
          "; to add .obj, run in the source tree: tools/setup --import && cmake --preset demo "
          "-DVOXELD_IMPORTERS=ON && cmake --build --preset demo -j $(tools/jobs)"}));
  EXPECT_THAT(ImportFile(DataFile("house.ifc"), {}), Fails(Words{"to add .ifc, run"}));
}

TEST(ImportersNotBuilt, FolderAndAnimationReportCommandsThatAddThem) {
  TempFolder folder;
  EXPECT_THAT(ImportFile(folder.Path("."), {}),
              Fails(Words{"to add folders of DICOM slices, run"}));
  EXPECT_THAT(OpenAnimation(DataFile("arrow.obj"), 1, 20), Fails(Words{"to add --animate, run"}));
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
