#include <array>

#include "tools/voxelctl/demo/clock_scene.h"
#include "tools/voxelctl/demo/gyroid_scene.h"
#include "tools/voxelctl/demo/life_scene.h"
#include "tools/voxelctl/demo/model_scenes.h"
#include "tools/voxelctl/demo/scene.h"
#include "tools/voxelctl/demo/scene_names.h"
#include "tools/voxelctl/import/import_program.h"

namespace voxeld::voxelctl {
namespace {

SceneFile Atlas() {
  return {{"world-atlas/countries-50m.json", "world-atlas/land-110m.json"},
          "tools/setup (npm's world-atlas)"};
}

}  // namespace

std::span<const SceneAbout> Scenes() {
  static const std::array<SceneAbout, kSceneNames.size()> scenes = {{
      {"globe",
       "the Earth's coasts and borders, turning on its tilted axis",
       "Natural Earth (npm's world-atlas)",
       {Atlas()},
       false,
       MakeGlobe},
      {"earthquakes",
       "a week of earthquakes in their true depth inside the globe: yellow at the surface, red at "
       "100 km, blue at 650 km; the stronger, the larger",
       "USGS, 31 January to 7 February 2018 (npm's vega-datasets); Natural Earth",
       {Atlas(),
        {{"vega-datasets/data/earthquakes.json", "vega-datasets/earthquakes.json"},
         "tools/setup --import (npm's vega-datasets)"}},
       false,
       MakeEarthquakes},
      {"house",
       "a house, cut open from the front by a plane that comes and goes",
       "KIT's FZK-Haus, IFC (Debian's assimp-testmodels)",
       {{{"assimp/models/IFC/AC14-FZK-Haus.ifc"}, "Debian's package assimp-testmodels"}},
       true,
       MakeHouse},
      {"engine",
       "an engine of two cylinders, turning",
       "2CylinderEngine, glTF (Debian's assimp-testmodels)",
       {{{"assimp/models/glTF2/2CylinderEngine-glTF-Binary/2CylinderEngine.glb"},
         "Debian's package assimp-testmodels"}},
       true,
       MakeEngine},
      {"brain",
       "a brain by magnetic resonance, cut from above by a plane that sinks and rises",
       "Colin Holmes' brain, NIfTI (Debian's mricron-data)",
       {{{"mricron/templates/ch2bet.nii.gz", "mricron/templates/ch2better.nii.gz"},
         "Debian's package mricron-data"}},
       true,
       MakeBrain},
      {"molecule",
       "HIV's protease with a drug in it, balls and bonds, turning",
       "1HPV of the Protein Data Bank (Debian's pymol-data)",
       {{{"pymol/data/tut/1hpv.pdb"}, "Debian's package pymol-data"}},
       true,
       MakeMolecule},
      {"gyroid", "a gyroid whose level breathes", "an expression", {}, false, MakeGyroid},
      {"galaxy",
       "a spiral galaxy, turning",
       "made up by code, no measured one",
       {},
       false,
       MakeGalaxy},
      {"life",
       "life in three dimensions: stays and comes to life with 4 neighbours of 26, fades in 3 "
       "steps",
       "a cellular automaton, sown by chance",
       {},
       false,
       MakeLife},
      {"clock",
       "the local time, in a ring that turns",
       "this machine's clock",
       {},
       false,
       MakeClock},
  }};
  return scenes;
}

absl::StatusOr<std::vector<std::string>> FindWhatSceneNeeds(const SceneAbout& scene,
                                                            const std::vector<std::string>& roots) {
  if (scene.needs_importers) {
    if (absl::Status status = CheckImporters(scene.name); !status.ok()) return status;
  }
  return FindSceneFiles(scene.needs, roots);
}

}  // namespace voxeld::voxelctl
