#include "display/drivers/fadecandy/boards.h"

#include <algorithm>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace voxeld::display::fadecandy {

Boards ReadBoards(OptionReader& reader) {
  const std::string text = reader.Text("boards", "1");
  int64_t count = 0;
  if (absl::SimpleAtoi(text, &count)) {
    if (count < 1 || count > kMostBoards) {
      reader.Refuse("boards", absl::StrCat("from 1 to ", kMostBoards,
                                           ", or serial numbers with ';' "
                                           "between them"));
      count = 1;
    }
    return {std::vector<std::string>(static_cast<size_t>(count))};
  }
  Boards boards{absl::StrSplit(text, ';')};
  std::vector<std::string> sorted = boards.serials;
  std::sort(sorted.begin(), sorted.end());
  if (sorted.size() > static_cast<size_t>(kMostBoards) || sorted.front().empty() ||
      std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end()) {
    reader.Refuse("boards", absl::StrCat("1 to ", kMostBoards,
                                         " serial numbers, each once, with ';' between them"));
    return {{""}};
  }
  return boards;
}

}  // namespace voxeld::display::fadecandy
