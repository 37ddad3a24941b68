#include "daemon/services/explain_entity.h"

#include <array>
#include <atomic>
#include <memory>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "daemon/core/scene_watch.h"
#include "daemon/explain/explain.h"
#include "daemon/wire/convert.h"
#include "daemon/wire/encode.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::services {
namespace {

constexpr std::array<std::pair<Visibility, v1::Visibility>, 12> kVisibilities = {{
    {Visibility::kSeen, v1::VISIBILITY_SEEN},
    {Visibility::kOutside, v1::VISIBILITY_OUTSIDE},
    {Visibility::kNothing, v1::VISIBILITY_NOTHING},
    {Visibility::kErases, v1::VISIBILITY_ERASES},
    {Visibility::kBlack, v1::VISIBILITY_BLACK},
    {Visibility::kClipped, v1::VISIBILITY_CLIPPED},
    {Visibility::kMasked, v1::VISIBILITY_MASKED},
    {Visibility::kOwnerHidden, v1::VISIBILITY_OWNER_HIDDEN},
    {Visibility::kLayerHidden, v1::VISIBILITY_LAYER_HIDDEN},
    {Visibility::kTransparent, v1::VISIBILITY_TRANSPARENT},
    {Visibility::kCovered, v1::VISIBILITY_COVERED},
    {Visibility::kNoLight, v1::VISIBILITY_NO_LIGHT},
}};

v1::Visibility ToWire(Visibility visibility) {
  for (const auto& [ours, theirs] : kVisibilities) {
    if (ours == visibility) return theirs;
  }
  return v1::VISIBILITY_UNSPECIFIED;
}

// Returns: why the display shows nothing of the scene; empty: it does.
std::string DarkBecause(const DisplayDescription& display) {
  if (display.blank) return "is blanked";
  if (display.pattern != TestPattern::kNone) return "shows a test pattern";
  if (display.brightness == 0) return "has brightness 0";
  if (display.state != display::DisplayState::kShowing) {
    return absl::StrCat("is not showing anything", display.state_reason.empty() ? "" : ": ",
                        display.state_reason);
  }
  return "";
}

v1::ExplainEntityResponse Answer(const EntityInfo& entity, const DisplayDescription& display,
                                 const Explanation& explanation) {
  v1::ExplainEntityResponse out;
  wire::Encode(entity, out.mutable_info());
  out.set_display(display.info.name);
  out.set_visibility(ToWire(explanation.visibility));
  out.set_text(Describe(explanation));
  if (explanation.visibility == Visibility::kSeen ||
      explanation.visibility == Visibility::kErases) {
    if (const std::string why = DarkBecause(display); !why.empty()) {
      out.set_visibility(v1::VISIBILITY_DARK);
      out.set_text(absl::StrCat("it would be seen, but display \"", display.info.name, "\" ", why));
    }
  }
  out.set_covered_voxels(explanation.covered);
  out.set_lit_voxels(explanation.lit);
  out.set_left_voxels(explanation.left);
  out.set_seen_voxels(explanation.seen);
  if (!explanation.voxels.empty) {
    gpu::Region around;
    for (int axis = 0; axis < 3; ++axis) {
      around.min[axis] = explanation.voxels.min[axis];
      around.max[axis] = explanation.voxels.max[axis];
    }
    wire::ToWire(around, out.mutable_voxels());
  }
  if (explanation.visibility == Visibility::kCovered) {
    wire::Encode(
        EntityKey{explanation.by_layer.owner, explanation.by_layer.name, explanation.by_entity},
        out.mutable_covered_by());
  }
  return out;
}

}  // namespace

void ExplainEntity(ServiceContext& context, const v1::ExplainEntityRequest& request,
                   ExplainDone done) {
  const v1::EntityKey& key = request.key();
  const auto explain = [&core = context.core, weak = std::weak_ptr(context.explainer), done](
                           const EntityInfo& entity, const DisplayDescription& display) {
    const std::shared_ptr<ExplainerThread> explainer = weak.lock();
    if (explainer == nullptr) return done(absl::UnavailableError("the server ends"), {});
    const SnapshotPtr scene = core.scene_watch().newest();
    const bool posted = explainer->Post([done, entity, display,
                                         scene](const std::atomic<bool>& stopping) {
      const absl::StatusOr<Explanation> explanation = Explain(
          scene, {entity.key.owner, entity.key.layer}, entity.key.id,
          {display.info.geometry, display.info.layout, display.info.tone, display.scene_to_voxel},
          [&stopping] { return stopping.load(); });
      if (!explanation.ok()) return done(explanation.status(), {});
      done(absl::OkStatus(), Answer(entity, display, *explanation));
    });
    if (!posted) {
      done(absl::ResourceExhaustedError(
               "as many explanations are waited for as may be; ask again later"),
           {});
    }
  };
  context.core.GetEntity(
      {key.owner(), key.layer(), key.id()}, [&core = context.core, name = request.display(), done,
                                             explain](const absl::StatusOr<EntityInfo>& entity) {
        if (!entity.ok()) return done(entity.status(), {});
        core.GetDisplay(name, [done, explain, entity = *entity](
                                  const absl::StatusOr<DisplayDescription>& display) {
          if (!display.ok()) return done(display.status(), {});
          explain(entity, *display);
        });
      });
}

}  // namespace voxeld::daemon::services
