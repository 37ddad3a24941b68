#include "tests/daemon/core/model/actions.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "tests/daemon/fakes/operations.h"

namespace voxeld::daemon::model {
namespace {

constexpr double kFar = 1e12;  // outside of every display

std::string LayerName(Chance& chance) {
  static const char* const kNames[] = {"a", "b", "c"};
  return kNames[chance.Pick(3)];
}
std::string Id(Chance& chance) {
  static const char* const kIds[] = {"x", "xa", "xb", "y"};
  return kIds[chance.Pick(4)];
}
std::string ObjectName(Chance& chance) { return absl::StrCat("o", chance.Pick(3)); }

gpu::Affine RandomMap(Chance& chance) {
  switch (chance.Pick(24)) {
    case 0:
      return testing::Scale(1, 0, 1);  // singular
    case 1: {
      gpu::Affine map;
      map.m[chance.Pick(12)] = chance.OneIn(2) ? NAN : INFINITY;
      return map;
    }
    case 2:
      return testing::Shift(kFar);
    case 3:
      return testing::Scale(2, 1, 4);
    case 4:
    case 5:
      return testing::Shift(chance.Pick(3), chance.Pick(2));
    default:
      return {};
  }
}

GeometryPtr RandomDots(Chance& chance) {
  const float x = chance.OneIn(25) ? static_cast<float>(kFar) : static_cast<float>(chance.Pick(3));
  return testing::Dots(x, chance.OneIn(3) ? 0xFF0000 : 0xFFFFFF, 1 + chance.Pick(2));
}

EntityData RandomEntity(Chance& chance, const Palette& palette) {
  EntityData data;
  if (chance.OneIn(4)) {
    data.content = InstanceRef{ObjectName(chance)};
  } else {
    data.content = palette.geometry(chance);
  }
  if (chance.OneIn(3)) data.transform = palette.map(chance);
  data.priority = chance.OneIn(4) ? chance.Pick(127) : 0;
  data.erase = chance.OneIn(10);
  if (chance.OneIn(5)) data.lifetime_ns = (1 + chance.Pick(40)) * 25 * sync::kMillisecond;
  if (chance.OneIn(6)) data.label = "label";
  return data;
}

LayerState RandomState(Chance& chance, const Palette& palette) {
  LayerState state;
  state.layer = LayerName(chance);
  switch (chance.Pick(8)) {
    case 0:
    case 1:
      state.visible = !chance.OneIn(4);
      break;
    case 2:
      state.opacity = chance.Pick(256);
      break;
    case 3:
      state.order = static_cast<int32_t>(chance.Pick(3)) - 1;
      break;
    case 4:
      state.blend = static_cast<gpu::BlendMode>(chance.Pick(3));
      break;
    case 5:
      state.transform = palette.map(chance);
      break;
    case 6: {
      Clip clip;
      clip.count = chance.Pick(3);
      for (uint32_t i = 0; i < clip.count; ++i) {
        clip.planes[i] = {static_cast<double>(chance.Pick(2)), chance.OneIn(4) ? 0.0 : 1.0, 0, 1};
      }
      state.clip = std::make_shared<Clip>(clip);
      break;
    }
    case 7: {
      std::optional<gpu::Region> region;
      if (!chance.OneIn(3)) {
        const double low = -1 - static_cast<double>(chance.Pick(2));
        region = {{low, low, low}, {1, 1, chance.OneIn(4) ? low : 1}};
      }
      state.region = region;
      break;
    }
  }
  return state;
}

Delete RandomDelete(Chance& chance, uint64_t last_sequence) {
  Delete del;
  del.layer = LayerName(chance);
  switch (chance.Pick(8)) {
    case 0:
    case 1:
      del.what = Delete::What::kPrefix;
      del.id_or_prefix = std::string(1, 'x');
      break;
    case 2:
      del.what = Delete::What::kAllOfLayer;
      break;
    case 3:
      del.what = Delete::What::kAllMine;
      del.layer.clear();
      break;
    default:
      del.id_or_prefix = Id(chance);
  }
  if (chance.OneIn(4))
    del.guard_sequence = 1 + chance.Pick(static_cast<uint32_t>(last_sequence + 1));
  return del;
}

DefineObject RandomDefinition(Chance& chance, const Palette& palette) {
  auto data = std::make_shared<ObjectData>();
  for (uint32_t i = chance.Pick(4); i > 0; --i) {
    ObjectPart part;
    if (chance.OneIn(3)) {
      part.content = InstanceRef{ObjectName(chance)};
    } else {
      part.content = palette.geometry(chance);
    }
    if (chance.OneIn(3)) part.transform = testing::Shift(0, chance.Pick(3));
    data->parts.push_back(std::move(part));
  }
  return {ObjectName(chance), std::move(data)};
}

const char* NameOf(const Operation& operation) {
  static const char* const kNames[] = {"upsert", "delete", "set_transform", "layer_state", "begin",
                                       "end",    "define", "undefine",      "commit"};
  return kNames[operation.op.index()];
}

std::string Describe(const Operation& operation) {
  std::string text = absl::StrCat(operation.sequence, ":", NameOf(operation));
  if (const auto* op = std::get_if<Upsert>(&operation.op)) {
    const auto* instance = std::get_if<InstanceRef>(&op->entity.content);
    absl::StrAppend(&text, " ", op->layer, "/", op->id);
    if (instance != nullptr) absl::StrAppend(&text, " of ", instance->object);
    if (op->entity.lifetime_ns > 0) {
      absl::StrAppend(&text, " for ", op->entity.lifetime_ns / sync::kMillisecond, " ms");
    }
  } else if (const auto* op = std::get_if<Delete>(&operation.op)) {
    absl::StrAppend(&text, " ", op->layer, "/", op->id_or_prefix, " what ",
                    static_cast<int>(op->what), " guard ", op->guard_sequence);
  } else if (const auto* op = std::get_if<SetTransform>(&operation.op)) {
    absl::StrAppend(&text, " ", op->layer, "/", op->id);
  } else if (const auto* op = std::get_if<LayerState>(&operation.op)) {
    absl::StrAppend(&text, " ", op->layer);
    if (op->visible.has_value()) absl::StrAppend(&text, *op->visible ? " show" : " hide");
  } else if (const auto* op = std::get_if<FrameBegin>(&operation.op)) {
    absl::StrAppend(&text, " ", op->layer);
  } else if (const auto* op = std::get_if<FrameEnd>(&operation.op)) {
    absl::StrAppend(&text, " ", op->layer);
  } else if (const auto* op = std::get_if<DefineObject>(&operation.op)) {
    absl::StrAppend(&text, " ", op->object, " of ", op->data->parts.size());
  } else if (const auto* op = std::get_if<DeleteObject>(&operation.op)) {
    absl::StrAppend(&text, " ", op->object, op->cascade ? " cascade" : "");
  } else if (const auto* op = std::get_if<Commit>(&operation.op)) {
    absl::StrAppend(&text, " ", op->frame_id, op->must_show ? " must_show" : "");
    if (op->present_at_ns != 0) absl::StrAppend(&text, " at ", op->present_at_ns);
  }
  return text;
}

}  // namespace

const Palette& DotPalette() {
  static const Palette palette{RandomDots, RandomMap};
  return palette;
}

Script MakeScript(uint32_t seed) {
  Chance chance(seed);
  Script script;
  script.seed = seed;
  script.displays = chance.OneIn(20) ? 0 : 1 + static_cast<int>(chance.Pick(2));
  script.settles = !chance.OneIn(4);
  Limits& l = script.limits;
  const auto tight = [&](auto& limit, std::initializer_list<uint64_t> values) {
    if (chance.OneIn(6)) {
      limit = static_cast<std::decay_t<decltype(limit)>>(
          values.begin()[chance.Pick(static_cast<uint32_t>(values.size()))]);
    }
  };
  tight(l.max_entities_per_owner, {3, 6});
  tight(l.max_entities, {5, 12});
  tight(l.max_layers_per_owner, {1, 2});
  tight(l.max_layers, {2, 4});
  tight(l.max_bytes_per_owner, {2500, 6000});
  tight(l.max_scene_bytes, {4000, 12'000});
  tight(l.max_operations_per_commit, {2, 5});
  tight(l.max_uncommitted_bytes, {1200, 3000});
  tight(l.max_uncommitted_bytes_total, {1500, 4000});
  tight(l.max_issues_per_commit, {1, 2});
  tight(l.max_instance_depth, {2, 3});
  tight(l.max_vertices_per_entity, {1});
  tight(l.max_sessions, {2, 3});
  tight(l.credit_bytes, {3, 200, 1000});
  tight(l.max_riding_commits, {1, 2, 3});
  tight(l.max_timed_commits, {1, 2});
  if (chance.OneIn(3)) l.max_present_at_horizon_ns = 200 * sync::kMillisecond;
  if (chance.OneIn(3)) l.must_show_timeout_ns = 200 * sync::kMillisecond;

  static constexpr std::pair<ActionKind, uint32_t> kWeights[] = {
      {ActionKind::kOpen, 8},       {ActionKind::kResume, 2},     {ActionKind::kSend, 70},
      {ActionKind::kClose, 3},      {ActionKind::kCrowd, 5},      {ActionKind::kStep, 6},
      {ActionKind::kAdvance, 10},   {ActionKind::kShow, 36},      {ActionKind::kAbort, 2},
      {ActionKind::kCable, 7},      {ActionKind::kBlank, 6},      {ActionKind::kPattern, 5},
      {ActionKind::kEngineMode, 3}, {ActionKind::kEngineRun, 10}, {ActionKind::kEngineFail, 2},
      {ActionKind::kClearLayer, 2}, {ActionKind::kControl, 3},    {ActionKind::kEvict, 1}};
  uint32_t sum = 0;
  for (const auto& [kind, weight] : kWeights) sum += weight;
  // Some clients are there from the beginning.
  for (uint32_t i = 0; i < 3; ++i) script.actions.push_back({ActionKind::kOpen, i, chance.Next()});
  const uint32_t length = 80 + chance.Pick(320);
  while (script.actions.size() < length) {
    uint32_t at = chance.Pick(sum);
    for (const auto& [kind, weight] : kWeights) {
      if (at < weight) {
        script.actions.push_back({kind, chance.Pick(kPlaces), chance.Next()});
        break;
      }
      at -= weight;
    }
  }
  return script;
}

OpenOptions RandomOpen(Chance& chance) {
  OpenOptions options;
  options.client_name = absl::StrCat("client", chance.Pick(3));
  options.on_disconnect = static_cast<DisconnectPolicy>(chance.Pick(3));
  options.linger_ns = chance.Pick(3) * 400 * sync::kMillisecond;
  if (chance.OneIn(8)) options.linger_ns = 30 * sync::kSecond;
  options.strict = chance.OneIn(8);
  options.no_outcomes = chance.OneIn(10);
  options.flow = static_cast<FlowPolicy>(chance.Pick(3));
  options.drop_oldest_frames = 1 + chance.Pick(2);
  return options;
}

RandomMessage MakeMessage(Chance& chance, uint64_t last_sequence, uint64_t* next_frame_id,
                          sync::TimeNs now, const Palette& palette) {
  RandomMessage message;
  uint64_t sequence = last_sequence;
  const auto add = [&](auto op) { message.operations.push_back({++sequence, std::move(op)}); };
  const auto upsert = [&](const std::string& layer) {
    add(Upsert{layer, Id(chance), RandomEntity(chance, palette)});
  };
  const auto any = [&] {
    switch (chance.Pick(20)) {
      case 0:
      case 1:
      case 2:
        return add(RandomDelete(chance, last_sequence));
      case 3:
      case 4:
        return add(SetTransform{LayerName(chance), Id(chance), palette.map(chance)});
      case 5:
      case 6:
      case 7:
        return add(RandomState(chance, palette));
      case 8:
      case 9:
      case 10:
        return add(RandomDefinition(chance, palette));
      case 11:
        if (chance.OneIn(2)) return add(DeleteObject{ObjectName(chance), chance.OneIn(2)});
        if (chance.OneIn(2)) return add(FrameBegin{LayerName(chance)});
        return add(FrameEnd{LayerName(chance)});
      default:
        return upsert(LayerName(chance));
    }
  };
  const auto commit = [&] {
    Commit commit;
    commit.frame_id = ++*next_frame_id;
    commit.must_show = chance.OneIn(5);
    if (chance.OneIn(7)) {
      commit.present_at_ns =
          now + (static_cast<sync::TimeNs>(chance.Pick(12)) - 2) * 30 * sync::kMillisecond;
    }
    if (chance.OneIn(10)) commit.client_drops = chance.Pick(3);
    add(commit);
  };
  const bool frame = chance.OneIn(3);
  if (frame) {
    const std::string layer = LayerName(chance);
    add(FrameBegin{layer});
    for (uint32_t i = chance.Pick(3); i > 0; --i) upsert(layer);
    if (chance.OneIn(6)) any();
    if (!chance.OneIn(20)) add(FrameEnd{layer});
  } else {
    for (uint32_t i = 1 + chance.Pick(3); i > 0; --i) any();
  }
  if (frame || chance.OneIn(2)) {
    commit();
    if (chance.OneIn(8)) {
      any();
      if (chance.OneIn(2)) commit();
    }
  } else if (chance.OneIn(10)) {
    Issue issue;
    issue.sequence = ++sequence;
    issue.field = "upsert";
    issue.reason = Reason::kInvalidValue;
    message.malformed.push_back(issue);
  }
  message.bytes = 20 + chance.Pick(100);
  for (const Operation& operation : message.operations) {
    absl::StrAppend(&message.text, " [", Describe(operation), "]");
  }
  if (!message.malformed.empty()) absl::StrAppend(&message.text, " [malformed]");
  return message;
}

}  // namespace voxeld::daemon::model
