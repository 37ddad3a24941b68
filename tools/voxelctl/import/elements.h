// The chemical elements as molecules are drawn. Covalent radii are those of Cordero and others (2008), van der Waals' radii those of
// Bondi and of the Blue Obelisk, 2 where neither has one, and colours those of Jmol.
#pragma once

#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {

struct ChemicalElement {
  int number = 0;            // of protons; 0 if it is not known
  absl::string_view symbol;  // as "Cl"; empty of what is not known
  double covalent = 0;       // radii, in ångström
  double van_der_waals = 0;
  Rgb color;          // by Corey, Pauling and Koltun, and of Jmol for the others
  bool bonds = true;  // ions next to others are not bound to them
};

// Returns: the element with a symbol (in any case) or a number of protons; null if there is none.
const ChemicalElement* FindElement(absl::string_view symbol);
const ChemicalElement* FindElement(int number);
const ChemicalElement& UnknownElement();

}  // namespace voxeld::voxelctl
