#include "tools/voxelctl/shape/shape_text.h"

#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "absl/algorithm/container.h"
#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/text/printable.h"
#include "common/text/suggest.h"
#include "gpu/affine.h"
#include "tools/voxelctl/shape/field_text.h"

namespace voxeld::voxelctl {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

// Where a shape is placed: it is scaled, then rotated about x, y and z, then moved.
struct Placement {
  v1::Vec3 at, scale, turn;

  Placement() {
    scale.set_x(1);
    scale.set_y(1);
    scale.set_z(1);
  }

  void Write(v1::Affine* out) const {
    gpu::Affine map;
    map.m[0] = scale.x();
    map.m[5] = scale.y();
    map.m[10] = scale.z();
    const double degrees[3] = {turn.x(), turn.y(), turn.z()};
    for (int axis = 0; axis < 3; ++axis) {
      const double radians = degrees[axis] * std::numbers::pi / 180;
      const int b = (axis + 1) % 3, c = (axis + 2) % 3;
      gpu::Affine turned;
      turned.m[b * 4 + b] = turned.m[c * 4 + c] = std::cos(radians);
      turned.m[c * 4 + b] = std::sin(radians);
      turned.m[b * 4 + c] = -std::sin(radians);
      map = gpu::Compose(turned, map);
    }
    map.m[3] = at.x();
    map.m[7] = at.y();
    map.m[11] = at.z();
    out->mutable_m()->Assign(std::begin(map.m), std::end(map.m));
  }
};

// Finds a field by its name, or by a dotted path through messages, which are created:
// "grid.size_a". Returns null if it does not exist.
const FieldDescriptor* FindField(absl::string_view name, Message** within) {
  for (;;) {
    const std::pair<absl::string_view, absl::string_view> parts =
        absl::StrSplit(name, absl::MaxSplits('.', 1));
    const FieldDescriptor* const field =
        (*within)->GetDescriptor()->FindFieldByName(std::string(parts.first));
    if (field == nullptr || !absl::StrContains(name, '.')) return field;
    if (field->message_type() == nullptr || field->is_repeated()) return nullptr;
    *within = (*within)->GetReflection()->MutableMessage(*within, field);
    name = parts.second;
  }
}

// Sets at, scale and turn. Returns false if `setting` is none of them.
absl::StatusOr<bool> SetPlacement(const Setting& setting, Placement* out) {
  v1::Vec3* const part = setting.name == "at"      ? &out->at
                         : setting.name == "scale" ? &out->scale
                         : setting.name == "turn"  ? &out->turn
                                                   : nullptr;
  if (part == nullptr) return false;
  if (absl::Status status = SetVec3(setting.name, setting.value, part); !status.ok()) return status;
  return true;
}

// Sets properties that every shape has. Returns false if `setting` is none of them.
absl::StatusOr<bool> SetCommon(const Setting& setting, Placement* placement, v1::Entity* out) {
  const auto& [name, value] = setting;
  absl::Status status;
  double number = 0;
  if (absl::StartsWith(name, "color_scale.")) {
    Message* within = out->mutable_primitive();
    const FieldDescriptor* const field = FindField(name, &within);
    if (field == nullptr) return false;
    status = SetField(*field, value, within);
  } else if (name == "color") {
    status = SetColor(name, value, out->mutable_primitive()->mutable_color());
  } else if (name == "label") {
    out->set_label(value);
  } else if (name == "erase") {
    if (value != "true" && value != "false")
      return Wrong(name, value, "true or false would be right");
    out->set_erase(value == "true");
  } else if (name == "priority" || name == "lifetime") {
    if (!absl::SimpleAtod(value, &number) || !(number >= 0) || number > 1e9) {
      return Wrong(name, value, "a number from 0 would be right");
    }
    if (name == "priority") out->set_priority(static_cast<uint32_t>(number));
    if (name == "lifetime") out->set_lifetime_ns(std::llround(number * 1e9));
  } else {
    return SetPlacement(setting, placement);
  }
  if (!status.ok()) return status;
  return true;
}

// Parses NAME=VALUE in each word after the first.
absl::StatusOr<std::vector<Setting>> SettingsOf(const std::vector<std::string>& words) {
  std::vector<Setting> settings;
  for (size_t w = 1; w < words.size(); ++w) {
    const std::pair<std::string, std::string> parts =
        absl::StrSplit(words[w], absl::MaxSplits('=', 1));
    if (!absl::StrContains(words[w], '=')) {
      return Wrong(absl::StrCat("after ", words.front()), words[w], "NAME=VALUE would be right");
    }
    for (const Setting& before : settings) {
      if (before.name != parts.first) continue;
      return absl::InvalidArgumentError(
          absl::StrCat(words.front(), " has ", EscapeForTerminal(parts.first), " twice, \"",
                       EscapeForTerminal(before.value), "\" and \"",
                       EscapeForTerminal(parts.second), "\"; one of them would be right"));
    }
    settings.push_back({parts.first, parts.second});
  }
  // Types are set first, because the bytes of arrays depend on them wherever they are written.
  absl::c_stable_partition(settings,
                           [](const Setting& s) { return absl::EndsWith(s.name, "type"); });
  return settings;
}

absl::Status NoSuchField(absl::string_view kind, const Message& message, const std::string& name,
                         std::initializer_list<const char*> besides) {
  std::vector<std::string> known(besides.begin(), besides.end());
  for (int i = 0; i < message.GetDescriptor()->field_count(); ++i)
    known.emplace_back(message.GetDescriptor()->field(i)->name());
  return absl::InvalidArgumentError(
      absl::StrCat(kind, " has no ", EscapeForTerminal(name), Suggestion(name, known)));
}

absl::Status SetShape(const FieldDescriptor& kind, const std::vector<Setting>& settings,
                      Placement* placement, v1::Entity* out) {
  v1::Primitive* const primitive = out->mutable_primitive();
  Message* const shape = primitive->GetReflection()->MutableMessage(primitive, &kind);
  for (const Setting& setting : settings) {
    Message* within = shape;
    if (const FieldDescriptor* field = FindField(setting.name, &within)) {
      if (absl::Status status = SetField(*field, setting.value, within); !status.ok()) {
        return status;
      }
      continue;
    }
    const absl::StatusOr<bool> common = SetCommon(setting, placement, out);
    if (!common.ok()) return common.status();
    if (*common) continue;
    return NoSuchField(kind.name(), *shape, setting.name,
                       {"color", "color_scale.colormap", "color_scale.along", "at", "scale", "turn",
                        "priority", "erase", "label", "lifetime"});
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<v1::Entity> ParseShapeText(absl::string_view text) {
  const absl::StatusOr<std::vector<std::string>> words = Words(text);
  if (!words.ok()) return words.status();
  if (words->empty()) return absl::InvalidArgumentError("a shape is expected, or an expression");
  const google::protobuf::OneofDescriptor& kinds = *v1::Primitive::descriptor()->oneof_decl(0);
  v1::Entity entity;
  for (int i = 0; i < kinds.field_count(); ++i) {
    const FieldDescriptor& kind = *kinds.field(i);
    if (kind.name() != words->front()) continue;
    const absl::StatusOr<std::vector<Setting>> settings = SettingsOf(*words);
    if (!settings.ok()) return settings.status();
    Placement placement;
    if (absl::Status status = SetShape(kind, *settings, &placement, &entity); !status.ok())
      return status;
    placement.Write(entity.mutable_transform());
    return entity;
  }
  // A misspelt shape name does not begin an expression.
  const std::string& first = words->front();
  if (words->size() == 1 || absl::StrContains((*words)[1], '=')) {
    std::vector<std::string> names(static_cast<size_t>(kinds.field_count()));
    for (int i = 0; i < kinds.field_count(); ++i)
      names[static_cast<size_t>(i)] = kinds.field(i)->name();
    const bool name = absl::c_all_of(first, [](char c) {
      return absl::ascii_isalpha(static_cast<unsigned char>(c)) || c == '_';
    });
    if (name && first.size() > 2) {
      return absl::InvalidArgumentError(
          absl::StrCat("there is no shape ", EscapeForTerminal(first), Suggestion(first, names)));
    }
  }
  entity.mutable_primitive()->mutable_implicit()->mutable_surface()->set_text(std::string(text));
  return entity;
}

absl::StatusOr<bool> ParseClipText(absl::string_view text, v1::Clip* out) {
  const absl::StatusOr<std::vector<std::string>> words = Words(text);
  if (!words.ok()) return words.status();
  if (words->empty()) return false;
  const std::string& kind = words->front();
  Message* const part = kind == "clip_plane"      ? static_cast<Message*>(out->add_planes())
                        : kind == "clip_box"      ? static_cast<Message*>(out->add_boxes())
                        : kind == "clip_cylinder" ? static_cast<Message*>(out->add_cylinders())
                                                  : nullptr;
  if (part == nullptr) return false;
  const absl::StatusOr<std::vector<Setting>> settings = SettingsOf(*words);
  if (!settings.ok()) return settings.status();
  const bool placed = kind == "clip_box";
  Placement placement;
  for (const Setting& setting : *settings) {
    const FieldDescriptor* const field = part->GetDescriptor()->FindFieldByName(setting.name);
    absl::StatusOr<bool> known = placed ? SetPlacement(setting, &placement) : false;
    if (!known.ok()) return known.status();
    if (*known) continue;
    if (field == nullptr) {
      return NoSuchField(kind, *part, setting.name,
                         placed ? std::initializer_list<const char*>{"at", "scale", "turn"}
                                : std::initializer_list<const char*>{});
    }
    if (absl::Status status = SetField(*field, setting.value, part); !status.ok()) return status;
  }
  if (placed) placement.Write(out->mutable_boxes(out->boxes_size() - 1)->mutable_transform());
  return true;
}

}  // namespace voxeld::voxelctl
