// Where a text's lines end. Works in the order in which text is read.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace voxeld::text {

// A run of characters that is kept together: a word, or the space between two.
struct Word {
  size_t begin = 0, end = 0;  // characters
  double advance = 0;
  bool space = false;
};

struct TextLine {
  size_t begin = 0, end = 0;  // of words, without spaces at either end
};

// Greedily: as many words a line as fit `width` (0: all). A word that is longer has a line of its own.
std::vector<TextLine> BreakLines(std::span<const Word> words, double width);

}  // namespace voxeld::text
