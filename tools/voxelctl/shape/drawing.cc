#include "tools/voxelctl/shape/drawing.h"

#include <map>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"
#include "tools/voxelctl/shape/shape_text.h"

namespace voxeld::voxelctl {
namespace {

constexpr size_t kLabelBytes = 200;

// The contents of a drawing in the order in which they take effect: objects, then what draws them.
class Drawing {
 public:
  absl::Status Add(const std::string& text) {
    std::string rest = text;
    std::string object;
    const bool mask = absl::StartsWith(rest, kMaskWord);
    if (mask) rest = std::string(absl::StripLeadingAsciiWhitespace(rest.substr(kMaskWord.size())));
    if (absl::StartsWith(rest, kObjectWord)) {
      const size_t colon = rest.find(':');
      if (mask || colon == std::string::npos || colon == kObjectWord.size()) {
        return absl::InvalidArgumentError("object NAME: SHAPE would be right");
      }
      object = rest.substr(kObjectWord.size(), colon - kObjectWord.size());
      rest = rest.substr(colon + 1);
    }
    if (!mask && object.empty()) {
      const absl::StatusOr<bool> clip = ParseClipText(rest, &clip_);
      if (!clip.ok()) return clip.status();
      if (*clip) return absl::OkStatus();
    }
    absl::StatusOr<v1::Entity> entity = ParseShapeText(rest);
    if (!entity.ok()) return entity.status();
    if (!object.empty()) {
      v1::Object::Part* const part = objects_[object].add_parts();
      *part->mutable_primitive() = std::move(*entity->mutable_primitive());
      *part->mutable_transform() = std::move(*entity->mutable_transform());
      return absl::OkStatus();
    }
    if (entity->label().empty() && text.size() <= kLabelBytes) entity->set_label(text);
    v1::Upsert& upsert = mask ? masks_.emplace_back() : shapes_.emplace_back();
    upsert.set_layer(mask ? kMaskLayer : kLayer);
    upsert.set_id(absl::StrCat(mask ? "mask " : "draw ", (mask ? masks_ : shapes_).size()));
    *upsert.mutable_entity() = *std::move(entity);
    return absl::OkStatus();
  }

  bool empty() const { return shapes_.empty(); }

  v1::ApplyUpdateRequest Request() && {
    v1::ApplyUpdateRequest request;
    for (auto& [name, definition] : objects_) {
      v1::DefineObject* const define = request.add_operations()->mutable_define_object();
      define->set_object(name);
      *define->mutable_definition() = std::move(definition);
    }
    for (std::vector<v1::Upsert>* const upserts : {&masks_, &shapes_}) {
      for (v1::Upsert& upsert : *upserts)
        *request.add_operations()->mutable_upsert() = std::move(upsert);
    }
    if (!masks_.empty()) {
      v1::LayerState* const hidden = request.add_operations()->mutable_layer_state();
      hidden->set_layer(kMaskLayer);
      hidden->set_visible(false);
    }
    const bool clipped = clip_.planes_size() + clip_.boxes_size() + clip_.cylinders_size() > 0;
    if (!masks_.empty() || clipped) {
      v1::LayerState* const state = request.add_operations()->mutable_layer_state();
      state->set_layer(kLayer);
      if (!masks_.empty()) state->set_mask_layer(kMaskLayer);
      if (clipped) *state->mutable_clip() = std::move(clip_);
    }
    return request;
  }

 private:
  inline static const std::string kMaskWord = "mask:", kObjectWord = "object ";

  std::map<std::string, v1::Object> objects_;
  std::vector<v1::Upsert> masks_, shapes_;
  v1::Clip clip_;
};

}  // namespace

absl::StatusOr<v1::ApplyUpdateRequest> ShapesRequest(std::span<const std::string> shapes) {
  Drawing drawing;
  std::vector<std::string> errors;
  for (const std::string& shape : shapes) {
    const absl::Status status = drawing.Add(shape);
    if (status.ok()) continue;
    errors.push_back(absl::StrCat("\"", EscapeForTerminal(shape), "\": ", status.message()));
  }
  if (errors.empty() && drawing.empty()) {
    errors.push_back("nothing is drawn: there is no shape beside objects, masks and clips");
  }
  if (!errors.empty()) return absl::InvalidArgumentError(absl::StrJoin(errors, "\n"));
  v1::ApplyUpdateRequest request = std::move(drawing).Request();
  request.mutable_open()->set_client_name("voxelctl draw");
  request.mutable_open()->set_strict(true);
  return request;
}

}  // namespace voxeld::voxelctl
