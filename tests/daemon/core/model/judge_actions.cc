// The actions of clients and operators on the core, and how the model is informed of them.
#include <algorithm>

#include "absl/strings/str_cat.h"
#include "tests/daemon/core/model/core_judge.h"

namespace voxeld::daemon::model {

bool CoreJudge::IsLive(const Stream* stream) {
  return stream != nullptr && stream->open && !stream->gone && SessionOf(*stream) != nullptr &&
         !SessionOf(*stream)->closing;
}

bool CoreJudge::Act(const Action& action, Chance& chance) {
  const uint32_t place = action.client;
  Stream* stream = places_[place];
  const bool live = IsLive(stream);
  switch (action.kind) {
    case ActionKind::kOpen: {
      if (live) return true;
      OpenOptions options = RandomOpen(chance);
      const Stream* other = places_[chance.Pick(kPlaces)];
      if (other != nullptr && chance.OneIn(2)) options.owner_token = other->info.owner_token;
      Open(place, std::move(options));
      return true;
    }
    case ActionKind::kResume:
      Resume(place, chance);
      return true;
    case ActionKind::kSend:
      // Now and then several messages before the core runs.
      for (uint32_t i = live ? 1 + chance.Pick(12) / 10 * chance.Pick(4) : 0; i > 0; --i) {
        Send(place, chance, /*step=*/i == 1 && !chance.OneIn(3));
      }
      return true;
    case ActionKind::kClose:
      if (live) Close(place, !chance.OneIn(3), chance.OneIn(3) ? 1 + chance.Pick(4) : 0);
      return true;
    case ActionKind::kCrowd:
      if (live) Crowd(*stream, !SessionOf(*stream)->crowded);
      return true;
    case ActionKind::kStep:
      Step();
      return true;
    case ActionKind::kClearLayer:
      ClearLayer(stream != nullptr && !chance.OneIn(3) ? stream->info.owner : 0,
                 chance.OneIn(3) ? "" : std::string(1, "abc"[chance.Pick(3)]), chance.OneIn(2));
      return true;
    case ActionKind::kControl:
    case ActionKind::kEvict: {
      OwnerControl control;
      control.owner = stream != nullptr ? stream->info.owner : 77;
      if (action.kind == ActionKind::kEvict) {
        control.evict = true;
      } else if (chance.OneIn(2)) {
        const auto owner = plain_.scene.owners.find(control.owner);
        const bool hidden = owner != plain_.scene.owners.end() && owner->second.hidden;
        control.hidden = !hidden && chance.OneIn(3);
      } else if (chance.OneIn(2)) {
        control.max_entities = chance.Pick(5);
      } else {
        control.max_bytes = chance.Pick(3) * 1500;
      }
      Control(control);
      return true;
    }
    default:
      return false;
  }
}

// ------------------------------------------------------------------------------------- sessions

void CoreJudge::Open(uint32_t place, OpenOptions options) {
  auto owned = std::make_unique<Stream>();
  Stream* stream = owned.get();
  streams_.push_back(std::move(owned));
  stream->sink = std::make_shared<Sink>(this, stream);
  stream->options = options;
  const uint64_t open_bytes = 10 + place;
  Trace(absl::StrCat("open at ", place, ", on_disconnect ", static_cast<int>(options.on_disconnect),
                     " linger ", options.linger_ns / sync::kMillisecond, " ms flow ",
                     static_cast<int>(options.flow), options.strict ? " strict" : "",
                     options.no_outcomes ? " no_outcomes" : "",
                     options.owner_token.empty() ? "" : " joining",
                     options.resume_token.empty() ? "" : " resuming"));
  // A session that is resumed while it is open ends first.
  uint64_t ends = 0;
  if (const uint64_t id = plain_.SessionOf(options.resume_token);
      !options.resume_token.empty() && plain_.MayOpen(options) == absl::StatusCode::kOk &&
      plain_.sessions.contains(id) && !plain_.sessions.at(id).closing) {
    for (const std::unique_ptr<Stream>& other : streams_) {
      if (other->open && SessionOf(*other) == &plain_.sessions.at(id)) other->may_end = true;
    }
    // its layers pass to the new one
    plain_.sessions.at(id).options.on_disconnect = DisconnectPolicy::kKeep;
    AddFinish(id, /*turns=*/true);
    ends = next_effect_ - 1;
  }
  ++replies_due_;
  core().OpenSession(
      options, open_bytes, stream->sink,
      [this, stream, options, place, open_bytes, ends](absl::StatusOr<SessionInfo> info) {
        --replies_due_;
        if (!wrong_.empty()) return;
        const absl::StatusCode expected = plain_.MayOpen(options);
        if (info.status().code() != expected) {
          return Fail(absl::StrCat("Open: ", info.status().ToString(), "; expected code ",
                                   static_cast<int>(expected)));
        }
        if (!info.ok()) return;
        // Effects that come before: the end of the resumed session, or closes that were requested
        // earlier.
        RunEffects(ends != 0 || !options.resume_token.empty() ? next_effect_ : 0);
        stream->info = *info;
        stream->open = true;
        AddEffect(Changing([&] {
          const PlainSession& session = plain_.Open(options, *info, open_bytes, clock().Now());
          if (info->last_frame_id != session.last_frame_id ||
              info->last_sequence != session.last_sequence) {
            Fail("a resumed session is told of another last commit");
          }
          if (info->owner != session.owner || info->incarnation != session.incarnation) {
            Fail("a session of another owner, or incarnation");
          }
        }));
        RunEffects(next_effect_);
        stream->told_credit = info->credit_bytes;
        if (info->credit_bytes != open_bytes + limits_.credit_bytes) {
          Fail("the first credit is otherwise");
        }
        tokens_.push_back(info->resume_token);
        places_[place] = stream;
      });
  stream->opening = true;
  Step();
  stream->opening = false;
}

void CoreJudge::Resume(uint32_t place, Chance& chance) {
  if (tokens_.empty()) return;
  OpenOptions options = RandomOpen(chance);
  // Preferably one of the newest, which may still be valid.
  const size_t back = std::min<size_t>(tokens_.size(), 6);
  options.resume_token = tokens_[tokens_.size() - 1 - chance.Pick(static_cast<uint32_t>(back))];
  Step();
  Open(place, std::move(options));
}

void CoreJudge::Send(uint32_t place, Chance& chance, bool step) {
  Stream& stream = *places_[place];
  PlainSession& session = *SessionOf(stream);
  const bool room = stream.info.intake->HasRoom();
  if (room != plain_.HasRoom(session)) {
    return Fail(absl::StrCat("session ", session.id, " has ", room ? "room" : "no room",
                             ", and should not"));
  }
  if (!room) return;
  RandomMessage message = Compose(chance, stream.last_sequence, &stream.next_frame_id);
  stream.last_sequence += message.operations.size() + message.malformed.size();
  Trace(absl::StrCat("session ", session.id, " sends ", message.bytes, " bytes:", message.text));
  const std::vector<Refusal> expected =
      plain_.Take(session, message.operations, message.malformed, message.bytes);
  Refusals refused;
  refused.issues = message.malformed;
  stream.rooms = 0;
  stream.waits_for_room =
      stream.info.intake->Take({std::move(message.operations), std::move(refused), message.bytes,
                                clock().Now(), clock().Now()});
  if (stream.waits_for_room == plain_.HasRoom(session)) {
    return Fail(absl::StrCat("a message was ", stream.waits_for_room ? "" : "not ",
                             "said to fill session ", session.id));
  }
  ExpectIssues(stream, expected);
  if (step) Step();
}

void CoreJudge::Close(uint32_t place, bool gone, uint32_t given_back) {
  Stream& stream = *places_[place];
  const uint64_t id = stream.info.session;
  Trace(absl::StrCat("session ", id, " closes", gone ? ", gone" : "", ", gives back ",
                     gone ? given_back : 0));
  stream.gone = gone;
  stream.open = false;
  AddFinish(id, /*turns=*/gone);
  const uint64_t last = next_effect_ - 1;
  ++replies_due_;
  core().CloseSession(id, stream.info.incarnation, gone, [this, last] {
    --replies_due_;
    if (wrong_.empty()) RunEffects(last);
  });
  std::vector<Receipt> receipts;
  if (!gone) given_back = 0;
  while (given_back-- > 0 && !stream.outcomes.empty()) {
    const Receipt receipt = stream.outcomes.back();
    stream.outcomes.pop_back();
    const std::string& display = std::get<CommitOutcome>(receipt.what).display;
    OnTakenBack(id, receipt);
    given_back_.insert({id, receipt.incarnation, receipt.sequence, display});
    receipts.insert(receipts.begin(), receipt);
  }
  if (!receipts.empty()) core().GiveBack(id, std::move(receipts));
  Step();  // one at a time: its effects without receipts could not be distinguished from another's
}

void CoreJudge::Crowd(Stream& stream, bool crowded) {
  Trace(absl::StrCat("session ", stream.info.session, crowded ? " does not read" : " reads"));
  SessionOf(stream)->crowded = crowded;
  stream.sink->crowded = crowded;
  if (!crowded) stream.info.intake->Wake();
}

void CoreJudge::PassTime() {
  Trace(absl::StrCat("now ", clock().Now()));
  if (plain_.NextDue() > clock().Now()) return;
  const std::string before = plain_.scene.Fingerprint();
  plain_.PassTime(clock().Now());
  if (plain_.scene.Fingerprint() != before) AddEffect([](uint64_t) { return true; });
}

// ------------------------------------------------------------------------------------- operators

void CoreJudge::ClearLayer(uint64_t owner, const std::string& layer, bool keep_state) {
  Step();
  if (!wrong_.empty()) return;
  Trace(absl::StrCat("clear ", owner, "/", layer, keep_state ? ", keeping its state" : ""));
  auto expected = std::make_shared<Cleared>();
  const uint64_t id = AddEffect(Changing([this, owner, layer, keep_state, expected] {
    *expected = plain_.ClearLayer(owner, layer, keep_state);
  }));
  ++replies_due_;
  core().ClearLayer(owner, layer, keep_state, {}, [this, id, expected](auto cleared) {
    --replies_due_;
    if (!wrong_.empty()) return;
    RunEffects(id);
    if (cleared->entities != expected->entities || cleared->layers != expected->layers) {
      Fail(absl::StrCat("cleared ", cleared->entities, " entities of ", cleared->layers,
                        " layers, not ", expected->entities, " of ", expected->layers));
    }
  });
  Step();
}

void CoreJudge::Control(OwnerControl control) {
  Step();
  if (!wrong_.empty()) return;
  Trace(absl::StrCat("control owner ", control.owner, control.evict ? " evict" : "",
                     control.hidden.has_value() ? *control.hidden ? " hide" : " show" : ""));
  const absl::StatusCode expected = plain_.MayControl(control);
  OwnerInfo was;
  if (expected == absl::StatusCode::kOk) {
    AddEffect(Changing([this, control] { plain_.Control(control); }));
    if (control.evict) {
      for (const std::unique_ptr<Stream>& stream : streams_) {
        const PlainSession* session = SessionOf(*stream);
        if (stream->open && session != nullptr && session->owner == control.owner) {
          stream->may_end = true;
        }
      }
      for (const auto& [id, session] : plain_.sessions) {
        if (session.owner == control.owner) AddFinish(id, /*turns=*/true);
      }
      AddEffect(Changing([this, control] { plain_.EndOwner(control.owner); }));
    }
  }
  ++replies_due_;
  core().ControlOwner(control, [this, expected](absl::StatusOr<OwnerInfo> info) {
    --replies_due_;
    if (!wrong_.empty()) return;
    if (info.status().code() != expected) {
      return Fail(absl::StrCat("ControlOwner: ", info.status().ToString()));
    }
    RunEffects(next_effect_);
  });
  Step();
  if (wrong_.empty()) CheckOwners();
}

}  // namespace voxeld::daemon::model
