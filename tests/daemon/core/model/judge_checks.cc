// The invariants whenever the core is at rest.
#include <algorithm>

#include "absl/strings/str_cat.h"
#include "tests/daemon/core/model/core_judge.h"

namespace voxeld::daemon::model {
namespace {

const char* KindOf(const GeometryData& geometry) {
  switch (geometry.record.kind) {
    case gpu::PrimitiveKind::kPoints:
      return "points";
    case gpu::PrimitiveKind::kSegments:
      return "segments";
    case gpu::PrimitiveKind::kBox:
      return "box";
    case gpu::PrimitiveKind::kSphere:
      return "sphere";
    default:
      return "no kind that is modelled";
  }
}

}  // namespace

void CoreJudge::Step() {
  if (!wrong_.empty()) return;
  RunToRest();
  CheckAtRest();
}

void CoreJudge::CheckAtRest() {
  Explain(UINT64_MAX);
  RunEffects(UINT64_MAX);
  if (plain_.NextDue() <= clock().Now()) {
    AddEffect(Changing([this] { plain_.PassTime(clock().Now()); }));
    RunEffects(UINT64_MAX);
  }
  if (replies_due_ != 0) Fail("a question has no answer");
  CheckStreams();
  if (seen_ != checked_) CheckScene();
}

void CoreJudge::CheckStreams() {
  const sync::TimeNs now = clock().Now();
  for (const std::unique_ptr<Stream>& stream : streams_) {
    if (!wrong_.empty()) return;
    if (!stream->issues.empty()) ExpectIssues(*stream, {});
    if (!stream->open || stream->gone) continue;
    PlainSession* session = SessionOf(*stream);
    if (session == nullptr || session->closing) continue;
    if (session->hold.has_value() && session->hold->deadline <= now) {
      if (!session->options.no_outcomes) return Fail("must_show has not given up in time");
      session->hold.reset();
    }
    if (session->waits() && Certain(*session) && plain_.MayGo(*session, session->owed)) {
      return Fail(
          absl::StrCat("a commit of session ", session->id, " waits, and nothing holds it"));
    }
    // Credit: exactly the bytes that were sent and handled are given back, in steps of a quarter.
    const uint64_t credit = limits_.credit_bytes;
    const uint64_t due = session->received - session->outstanding() + credit;
    if (stream->told_credit > due) {
      return Fail(absl::StrCat("credit of ", stream->told_credit, ", ", due, " is due"));
    }
    if (due > stream->told_credit && due - stream->told_credit >= credit / 4) {
      return Fail(absl::StrCat("credit of ", stream->told_credit, " only; ", due, " is due"));
    }
    if (stream->waits_for_room && plain_.HasRoom(*session)) {
      if (std::exchange(stream->rooms, 0) == 0) {
        return Fail(absl::StrCat("session ", session->id, " was not told that it has room"));
      }
      stream->waits_for_room = false;
    }
    if (stream->rooms != 0) return Fail("told of room that was not asked for, or not there");
  }
}

// Compares the scene as a client sees it.
void CoreJudge::CheckScene() {
  if (!wrong_.empty()) return;
  checked_ = seen_;
  EntityPage page;
  bool answered = false;
  core().ListEntities({}, [&](absl::StatusOr<EntityPage> got) {
    page = *std::move(got);
    answered = true;
  });
  RunToRest();
  if (!answered || !page.next_page_token.empty()) return Fail("the scene was not listed");
  auto layer = page.layers.begin();
  auto entity = page.entities.begin();
  std::map<uint64_t, uint64_t> numbers;  // the model's → the core's
  for (const auto& [number, owner] : plain_.scene.owners) {
    for (const auto& [name, plain] : owner.layers) {
      if (layer == page.layers.end() || layer->owner != number || layer->layer != name) {
        return Fail(absl::StrCat("layer ", number, "/", name, " should be there"));
      }
      const LayerInfo& is = *layer++;
      if (is.visible != plain.visible || is.opacity != plain.opacity || is.order != plain.order ||
          is.blend != plain.blend || is.transform != plain.transform || is.clip != plain.clip ||
          is.region != plain.region || is.entities != plain.entities.size() ||
          is.orphaned != plain.orphaned || is.client_name != plain.client_name ||
          is.bytes != plain_.scene.LayerBytes(plain, name)) {
        return Fail(absl::StrCat("layer ", number, "/", name, " is otherwise: ", is.entities,
                                 " entities for ", plain.entities.size(), ", visible ", is.visible,
                                 " for ", plain.visible, ", orphaned ", is.orphaned, " for ",
                                 plain.orphaned, ", of ", is.client_name, " for ",
                                 plain.client_name));
      }
      numbers[plain.created] = is.number;
      for (const auto& [id, expected] : plain.entities) {
        if (entity == page.entities.end() || entity->key != EntityKey{number, name, id}) {
          return Fail(absl::StrCat("entity ", number, "/", name, "/", id, " should be there"));
        }
        const EntityInfo& got = *entity++;
        const EntityData& data = expected.data;
        const auto* geometry = std::get_if<GeometryPtr>(&data.content);
        if (got.sequence != expected.sequence || got.expires_ns != expected.expires_ns ||
            got.priority != data.priority || got.erase != data.erase || got.label != data.label ||
            got.transform != data.transform ||
            got.kind != (geometry != nullptr ? KindOf(**geometry) : "instance") ||
            (geometry != nullptr && (got.color != (*geometry)->record.color ||
                                     got.vertices != (*geometry)->record.vertex_count)) ||
            got.bytes != PlainScene::EntityBytes(name, id, data)) {
          return Fail(absl::StrCat("entity ", number, "/", name, "/", id,
                                   " is otherwise: of sequence ", got.sequence, ", expected ",
                                   expected.sequence));
        }
      }
    }
  }
  if (layer != page.layers.end()) {
    return Fail(absl::StrCat("layer ", layer->owner, "/", layer->layer, " should not be there"));
  }
  if (entity != page.entities.end()) {
    return Fail(absl::StrCat("entity ", entity->key.id, " should not be there"));
  }
  uint64_t last = 0;
  for (const auto& [plain, core] : numbers) {
    if (std::exchange(last, core) >= core) Fail("layers are numbered in another order");
  }
}

void CoreJudge::CheckOwners() {
  if (!wrong_.empty()) return;
  std::vector<OwnerInfo> owners;
  core().ListOwners([&](absl::StatusOr<std::vector<OwnerInfo>> got) { owners = *got; });
  RunToRest();
  std::map<uint64_t, OwnerInfo> expected = plain_.Owners();
  if (owners.size() != expected.size()) {
    return Fail(absl::StrCat(owners.size(), " owners, where there are ", expected.size()));
  }
  for (const OwnerInfo& is : owners) {
    const OwnerInfo& plain = expected[is.owner];
    if (is.sessions != plain.sessions || is.layers != plain.layers ||
        is.orphaned_layers != plain.orphaned_layers || is.entities != plain.entities ||
        is.objects != plain.objects || is.bytes != plain.bytes || is.hidden != plain.hidden ||
        is.max_bytes != plain.max_bytes || is.max_entities != plain.max_entities ||
        is.client_names != plain.client_names) {
      Fail(absl::StrCat("owner ", is.owner, " is otherwise: ", is.bytes, " bytes for ", plain.bytes,
                        ", ", is.objects, " objects for ", plain.objects));
    }
  }
}

Stats CoreJudge::AskStats() {
  Stats stats;
  core().GetStats([&](absl::StatusOr<Stats> s) { stats = *s; });
  RunToRest();
  return stats;
}

void CoreJudge::CheckStats() {
  CheckOwners();
  if (!wrong_.empty()) return;
  const Stats stats = AskStats();
  const PlainCore::Figures& figures = plain_.figures;
  const PlainCount count = plain_.scene.CountAll();
  uint64_t timed = 0, staged = 0, waiting = 0;
  bool uncertain = false;
  for (const auto& [id, session] : plain_.sessions) {
    uncertain = uncertain || plain_.Uncertain(session, clock().Now());
    timed += session.timed.size();
    staged += session.staged_bytes();
    waiting += session.waiting_bytes();
  }
  const auto same = [&](const char* name, uint64_t is, uint64_t should) {
    if (is != should) Fail(absl::StrCat(name, " is ", is, ", should be ", should));
  };
  same("sessions", stats.sessions, plain_.sessions.size());
  same("sessions_dormant", stats.sessions_dormant, plain_.dormant.size());
  same("sessions_resumed", stats.sessions_resumed, figures.resumed);
  same("layers", stats.layers, count.layers);
  same("entities", stats.entities, count.entities);
  same("objects", stats.objects, count.objects);
  same("scene_bytes", stats.scene_bytes, count.bytes);
  same("commits_accepted", stats.commits_accepted, figures.accepted);
  same("commits_refused", stats.commits_refused, figures.refused);
  same("operations_applied", stats.operations_applied, figures.operations_applied);
  same("operations_refused", stats.operations_refused, figures.operations_refused);
  same("bytes_in", stats.bytes_in, figures.bytes_in);
  same("client_drops", stats.client_drops, figures.client_drops);
  same("frames_dropped", stats.frames_dropped, figures.frames_dropped);
  if (!uncertain) same("timed_pending", stats.timed_pending, timed);
  same("timed_dropped", stats.timed_dropped, figures.timed_dropped);
  same("must_show_timeouts", stats.must_show_timeouts, figures.must_show_timeouts);
  same("memory.scene", stats.memory.scene, count.bytes);
  same("memory.staged", stats.memory.staged, staged);
  same("memory.waiting", stats.memory.waiting, waiting);
  uint64_t pending = 0;
  for (size_t d = 0; d < stats.displays.size(); ++d) {
    const DisplayFigures& f = stats.displays[d];
    same("commits_owed", f.commits_owed, figures.accepted);
    same("outcomes and commits_pending",
         f.commits_presented + f.commits_unchanged + f.commits_superseded + f.commits_lost +
             f.commits_not_shown + f.commits_pending,
         f.commits_owed);
    pending += f.commits_pending;
    if (Idle(d)) same("commits_pending of a display with nothing to do", f.commits_pending, 0);
  }
  // If none is kept for a resume, every outstanding outcome takes the same memory.
  if (plain_.dormant.empty() && plain_.figures.resumed == 0) {
    if (owed_unit_ == 0 && pending > 0) owed_unit_ = stats.memory.owed / pending;
    same("memory.owed", stats.memory.owed, pending * owed_unit_);
  }
}

}  // namespace voxeld::daemon::model
