#include "tools/voxelctl/import/model.h"

#include <algorithm>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace voxeld::voxelctl {

void AddLeftOut(std::string_view kind, uint64_t count, Model* model) {
  if (count == 0) return;
  const auto known = std::find_if(model->left_out.begin(), model->left_out.end(),
                                  [&](const LeftOut& one) { return one.kind == kind; });
  if (known == model->left_out.end()) {
    model->left_out.push_back({std::string(kind), count});
  } else {
    known->count += count;
  }
}

void AddNote(std::string_view text, Model* model) {
  model->note += model->note.empty() ? "" : "; ";
  model->note += text;
}

std::string NoteOf(const Model& model) {
  const std::string prefix = absl::StrCat(model.path, ": ");
  std::string text = model.note;
  if (!model.left_out.empty()) {
    const std::string list =
        absl::StrJoin(model.left_out, ", ", [](std::string* out, const LeftOut& one) {
          absl::StrAppend(out, one.kind, " (", one.count, ")");
        });
    absl::StrAppend(&text, text.empty() ? "" : "; ", "left out: ", list);
  }
  return text.empty() || absl::StartsWith(text, prefix) ? text : absl::StrCat(prefix, text);
}

}  // namespace voxeld::voxelctl
