// The chemical elements as molecules are drawn. Covalent radii are those of Cordero and others
// (2008), van der Waals radii those of Bondi and of the Blue Obelisk or otherwise 2, and colours
// those of Jmol.
#pragma once

#include "absl/strings/string_view.h"
#include "tools/voxelctl/import/model.h"

namespace voxeld::voxelctl {

struct ChemicalElement {
  int number = 0;            // of protons; 0 if unknown
  absl::string_view symbol;  // such as "Cl"; empty if unknown
  double covalent = 0;       // radii, in ångström
  double van_der_waals = 0;
  Rgb color;          // by Corey, Pauling and Koltun, or of Jmol for other elements
  bool bonds = true;  // ions near others are not bonded to them
};

// Returns: the element with a symbol (case-insensitive) or a number of protons; null if it is
// unknown.
const ChemicalElement* FindElement(absl::string_view symbol);
const ChemicalElement* FindElement(int number);
const ChemicalElement& UnknownElement();

}  // namespace voxeld::voxelctl
