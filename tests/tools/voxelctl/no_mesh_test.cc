// A build without mesh importers says so, and still reads what it has readers of its own for.
#include <gtest/gtest.h>

#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/importer.h"

namespace voxeld::voxelctl {
namespace {

TEST(NoMeshImporter, SaysWhatItReads) {
  EXPECT_THAT(ImportFile(DataFile("arrow.obj"), {}),
              Fails(Words{"arrow.obj", "VOXELD_IMPORTERS=OFF", ".geojson"}));
  EXPECT_THAT(ImportFile(DataFile("points.ply"), {}), IsOk());
  EXPECT_THAT(ImportFile(DataFile("quad.topojson"), {}), IsOk());
}

TEST(NoMeshImporter, ChecksMeshesAllTheSame) {
  TempFolder folder;
  EXPECT_THAT(ImportFile(folder.Write("a.obj", "v 0 0 0\nf 1 2 3\n"), {}),
              Fails(Words{"line 2", "vertex 2"}));
}

}  // namespace
}  // namespace voxeld::voxelctl
