// Breaks text into lines, in reading order.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace voxeld::text {

// A run of characters that is not broken: a word, or the space between two words.
struct Word {
  size_t begin = 0, end = 0;  // character indices
  double advance = 0;
  bool space = false;
};

struct TextLine {
  size_t begin = 0, end = 0;  // word indices, without spaces at either end
};

// Puts as many words on a line as fit into `width` (0: all). A word that is longer gets its own
// line.
std::vector<TextLine> BreakLines(std::span<const Word> words, double width);

}  // namespace voxeld::text
