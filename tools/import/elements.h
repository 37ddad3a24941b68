// The chemical elements as molecules are drawn.
#pragma once

#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {

struct ChemicalElement {
  absl::string_view symbol;  // as "Cl"; empty of what is not known
  double covalent = 0;       // radii, in ångström
  double van_der_waals = 0;
  Rgb color;          // by Corey, Pauling and Koltun, as programs have it
  bool bonds = true;  // ions next to others are not bound to them
};

// By its symbol in any case; null if there is none such.
const ChemicalElement* FindElement(absl::string_view symbol);
const ChemicalElement& UnknownElement();

}  // namespace voxeld::voxelctl
