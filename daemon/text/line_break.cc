#include "daemon/text/line_break.h"

namespace voxeld::text {

std::vector<TextLine> BreakLines(std::span<const Word> words, double width) {
  std::vector<TextLine> lines;
  TextLine line;
  double advance = 0, pending = 0;  // width of the spaces since the last word
  bool any = false;
  for (size_t i = 0; i < words.size(); ++i) {
    const Word& word = words[i];
    if (word.space) {
      if (any) pending += word.advance;
      continue;
    }
    if (any && width > 0 && advance + pending + word.advance > width) {
      lines.push_back(line);
      any = false;
    }
    if (!any) {
      line.begin = i;
      advance = pending = 0;
    }
    any = true;
    advance += pending + word.advance;
    pending = 0;
    line.end = i + 1;
  }
  if (any) lines.push_back(line);
  if (lines.empty()) lines.push_back({0, 0});
  return lines;
}

}  // namespace voxeld::text
