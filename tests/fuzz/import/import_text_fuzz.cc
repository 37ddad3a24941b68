// Text files: maps, points, molecules, drawings.

#include <cstdint>
#include <nlohmann/json.hpp>

#include "tests/fuzz/import/check_model.h"
#include "tools/import/gemmi_molecule.h"
#include "tools/import/rsvg_drawing.h"
#include "tools/voxelctl/import/geojson.h"
#include "tools/voxelctl/import/json_text.h"
#include "tools/voxelctl/import/molecule.h"
#include "tools/voxelctl/import/text_points.h"

// fontconfig keeps its data on the system's configuration until the process ends, and libxml2 leaks
// texts of damaged entities. A reader process ends after its file. LeakSanitizer calls this.
extern "C" const char* __lsan_default_suppressions();  // NOLINT: its name
extern "C" const char* __lsan_default_suppressions() {
  return "leak:libfontconfig\nleak:xmlParseEntityValue\n";
}  // NOLINT

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace voxeld::voxelctl;  // NOLINT(google-build-using-namespace)
  static constexpr const char* kExtensions[] = {"geojson", "topojson", "xyz", "csv",
                                                "pdb",     "svg",      "cif"};
  size_t which = 0;
  const SourceFile file = voxeld::fuzz::FileOf(data, size, kExtensions, 7, &which);
  switch (which) {
    case 0:
    case 1: {
      const absl::StatusOr<nlohmann::json> document = ParseJson(file, file.bytes);
      if (!document.ok()) {
        voxeld::fuzz::ExpectSays(document.status());
        break;
      }
      // Its callers have checked this.
      if (!document->is_object() || !document->contains("type") || !(*document)["type"].is_string())
        break;
      for (const bool globe : {false, true}) {
        voxeld::fuzz::CheckModel(which == 0 ? ReadGeoJson(file, *document, globe)
                                            : ReadTopoJson(file, *document, globe));
      }
      break;
    }
    case 2:
    case 3:
      voxeld::fuzz::CheckModel(IsXyzMolecule(file.bytes)
                                   ? ReadXyzMolecule(file, MoleculeStyle::kBalls)
                                   : ReadTextPoints(file));
      break;
    case 4:
    case 6:
      voxeld::fuzz::CheckModel(ReadMolecule(file, MoleculeStyle::kBalls));
      break;
    default:
      voxeld::fuzz::CheckModel(ReadSvgDrawing(file, {16, 16}));
      break;
  }
  return 0;
}
