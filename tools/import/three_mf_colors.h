// Reads colours and textures of 3MF. assimp reads them only for a whole object, and only of one
// kind.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "tools/import/mesh_parts.h"
#include "tools/voxelctl/import/model.h"
#include "tools/voxelctl/import/source_file.h"

namespace voxeld::voxelctl {

class ThreeMfColors {
 public:
  // Reads base materials, colour groups and texture groups of the archive's model with libxml2, and
  // its pictures into `model`. Counts there what is not shown: composite materials, layers, beam
  // lattices, slices, and objects in other models of the archive. Damaged groups have no colour:
  // assimp reports the damage.
  ThreeMfColors(const SourceFile& file, Model* model);

  // Splits `part`, which has an object's triangles in the file's order and no colours, into parts
  // with the object's colours.
  std::vector<Part> Paint(const std::string& object, Part part, Model* model) const;

 private:
  struct Group {
    std::vector<Rgb> colors;                        // for base materials and colour groups
    bool one_a_triangle = false;                    // for base materials
    std::vector<std::array<float, 2>> coordinates;  // for texture groups
    uint32_t picture = kNoPicture;
    Wrap wrap_u = Wrap::kRepeat, wrap_v = Wrap::kRepeat;
    std::vector<uint32_t> layers;  // for layered properties: the layers' groups, from below
    std::vector<std::vector<uint32_t>> entries;  // for layered properties: an entry of each layer
  };
  // A group's number, and an entry for each corner.
  struct Property {
    uint32_t group = UINT32_MAX;
    std::array<uint32_t, 3> entries = {};
  };
  struct Object {
    Property common;
    std::vector<Property> triangles;
  };

  // Returns the uppermost layer with colours or a texture if `property` is of a group of layers,
  // otherwise `property` itself.
  Property UppermostOf(const Property& property) const;

  // `read_entry` returns an entry of the archive.
  void ReadModel(const std::string& text,
                 const std::function<std::string(const std::string&)>& read_entry, Model* model);

  std::map<uint32_t, Group> groups_;
  std::map<std::string, Object> objects_;
  std::map<uint32_t, Group> textures_;  // pictures and their rules
};

}  // namespace voxeld::voxelctl
