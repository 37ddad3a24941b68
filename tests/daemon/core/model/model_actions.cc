// What is done to the core, and what the model is told of it.
#include <algorithm>
#include <exception>

#include "absl/strings/str_cat.h"
#include "tests/daemon/core/model/model_run.h"

namespace voxeld::daemon::model {
namespace {

std::string NameOf(size_t display) {
  return display == 0 ? "main" : absl::StrCat("display", display);
}

}  // namespace

std::string ModelRun::Run() {
  try {
    RunScript();
  } catch (const std::exception& thrown) {
    Fail(absl::StrCat("thrown: ", thrown.what()));
  }
  return wrong_;
}

void ModelRun::RunScript() {
  if (!sim_.core->Start().ok()) return Fail("the core does not start");
  seen_ = checked_ = sim_.core->scene_watch().newest()->number;
  sim_.core->scene_watch().Await(seen_, [this] { OnPublished(); });
  Step();
  for (const Action& action : script_.actions) {
    Do(action);
    if (action.chance % 8 == 0) {
      Step();
      CheckStats();
    }
    if (!wrong_.empty()) return;
  }
  Step();
  CheckStats();
  if (script_.settles) {
    Settle();
    EverybodyLeaves();
  } else {
    StopInTheMiddle();
  }
}

void ModelRun::Do(const Action& action) {
  Chance chance(action.chance);
  const uint32_t place = action.client;
  Stream* stream = places_[place];
  const bool live = stream != nullptr && stream->open && !stream->gone && SessionOf(*stream) &&
                    !SessionOf(*stream)->closing;
  const size_t displays = now_.size();
  const size_t d = displays == 0 ? 0 : chance.Pick(static_cast<uint32_t>(displays));
  switch (action.kind) {
    case ActionKind::kOpen: {
      if (live) return;
      OpenOptions options = RandomOpen(chance);
      const Stream* other = places_[chance.Pick(kPlaces)];
      if (other != nullptr && chance.OneIn(2)) options.owner_token = other->info.owner_token;
      return Open(place, std::move(options));
    }
    case ActionKind::kResume:
      return Resume(place, chance);
    case ActionKind::kSend:
      // Now and then several before the core gets round to it.
      for (uint32_t i = live ? 1 + chance.Pick(12) / 10 * chance.Pick(4) : 0; i > 0; --i) {
        Send(place, chance, /*step=*/i == 1 && !chance.OneIn(3));
      }
      return;
    case ActionKind::kClose:
      if (live) Close(place, !chance.OneIn(3), chance.OneIn(3) ? 1 + chance.Pick(4) : 0);
      return;
    case ActionKind::kCrowd:
      if (live) Crowd(*stream, !SessionOf(*stream)->crowded);
      return;
    case ActionKind::kStep:
      return Step();
    case ActionKind::kAdvance:
      return Advance(chance.OneIn(8) ? (1 + chance.Pick(12)) * sync::kSecond
                                     : (1 + chance.Pick(10)) * 30 * sync::kMillisecond);
    case ActionKind::kClearLayer:
      return ClearLayer(stream != nullptr && !chance.OneIn(3) ? stream->info.owner : 0,
                        chance.OneIn(3) ? "" : std::string(1, "abc"[chance.Pick(3)]),
                        chance.OneIn(2));
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
      return Control(control);
    }
    default:
      break;
  }
  if (displays == 0) return;
  testing::EngineScript& engine = sim_.engine(static_cast<int>(d));
  switch (action.kind) {
    case ActionKind::kShow:
      return Show(d);
    case ActionKind::kAbort: {
      const std::string reason = absl::StrCat("aborted #", ++happenings_, ".");
      Trace(absl::StrCat("display ", d, " ", reason));
      ledger_.Loss(d, reason);
      sim_.display(static_cast<int>(d)).Abort(reason);
      return Step();
    }
    case ActionKind::kCable:
      if (!now_[d].attached || chance.OneIn(6)) Cable(d);
      return;
    case ActionKind::kBlank:
      if (now_[d].blanked || chance.OneIn(6)) Blank(d, !now_[d].blanked);
      return;
    case ActionKind::kPattern:
      if (now_[d].pattern) return Pattern(d, TestPattern::kNone);
      if (chance.OneIn(6)) Pattern(d, TestPattern::kGrid);
      return;
    case ActionKind::kEngineMode:
      if (engine.calls.empty()) engine.inline_calls = !engine.inline_calls;
      return;
    case ActionKind::kEngineRun:
      Trace(absl::StrCat("engine ", d, " runs"));
      engine.Run();
      return Step();
    case ActionKind::kEngineFail:
      return EngineFail(d, d == 0 && chance.OneIn(2));
    default:
      return;
  }
}

// ------------------------------------------------------------------------------------- sessions

void ModelRun::Open(uint32_t place, OpenOptions options) {
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
  // A session that is taken up while it is open ends first.
  uint64_t ends = 0;
  if (const uint64_t id = plain_.SessionOf(options.resume_token);
      !options.resume_token.empty() && plain_.MayOpen(options) == absl::StatusCode::kOk &&
      plain_.sessions.contains(id) && !plain_.sessions.at(id).closing) {
    for (const std::unique_ptr<Stream>& other : streams_) {
      if (other->open && SessionOf(*other) == &plain_.sessions.at(id)) other->may_end = true;
    }
    plain_.sessions.at(id).options.on_disconnect = DisconnectPolicy::kKeep;  // its layers go over
    AddFinish(id, /*turns=*/true);
    ends = next_effect_ - 1;
  }
  ++replies_due_;
  sim_.core->OpenSession(
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
        // What is over before: a session that it takes up, or closes that were asked for earlier.
        RunEffects(ends != 0 || !options.resume_token.empty() ? next_effect_ : 0);
        stream->info = *info;
        stream->open = true;
        AddEffect(Changing([&] {
          const PlainSession& session = plain_.Open(options, *info, open_bytes, sim_.clock.Now());
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
        if (info->credit_bytes != open_bytes + script_.limits.credit_bytes) {
          Fail("the first credit is otherwise");
        }
        tokens_.push_back(info->resume_token);
        places_[place] = stream;
      });
  stream->opening = true;
  Step();
  stream->opening = false;
}

void ModelRun::Resume(uint32_t place, Chance& chance) {
  if (tokens_.empty()) return;
  OpenOptions options = RandomOpen(chance);
  // Rather one of the newest, which may still be good.
  const size_t back = std::min<size_t>(tokens_.size(), 6);
  options.resume_token = tokens_[tokens_.size() - 1 - chance.Pick(static_cast<uint32_t>(back))];
  Step();
  Open(place, std::move(options));
}

void ModelRun::Send(uint32_t place, Chance& chance, bool step) {
  Stream& stream = *places_[place];
  PlainSession& session = *SessionOf(stream);
  const bool room = stream.info.intake->HasRoom();
  if (room != plain_.HasRoom(session)) {
    return Fail(absl::StrCat("session ", session.id, " has ", room ? "room" : "no room",
                             ", and should not"));
  }
  if (!room) return;
  RandomMessage message =
      MakeMessage(chance, stream.last_sequence, &stream.next_frame_id, sim_.clock.Now());
  stream.last_sequence += message.operations.size() + message.malformed.size();
  Trace(absl::StrCat("session ", session.id, " sends ", message.bytes, " bytes:", message.text));
  const std::vector<Refusal> expected =
      plain_.Take(session, message.operations, message.malformed, message.bytes);
  Refusals refused;
  refused.issues = message.malformed;
  stream.rooms = 0;
  stream.waits_for_room =
      stream.info.intake->Take({std::move(message.operations), std::move(refused), message.bytes});
  if (stream.waits_for_room == plain_.HasRoom(session)) {
    return Fail(absl::StrCat("a message was ", stream.waits_for_room ? "" : "not ",
                             "said to fill session ", session.id));
  }
  ExpectIssues(stream, expected);
  if (step) Step();
}

void ModelRun::Close(uint32_t place, bool gone, uint32_t given_back) {
  Stream& stream = *places_[place];
  const uint64_t id = stream.info.session;
  Trace(absl::StrCat("session ", id, " closes", gone ? ", gone" : "", ", gives back ",
                     gone ? given_back : 0));
  stream.gone = gone;
  stream.open = false;
  AddFinish(id, /*turns=*/gone);
  const uint64_t last = next_effect_ - 1;
  ++replies_due_;
  sim_.core->CloseSession(id, stream.info.incarnation, gone, [this, last] {
    --replies_due_;
    if (wrong_.empty()) RunEffects(last);
  });
  std::vector<Receipt> receipts;
  if (!gone) given_back = 0;
  while (given_back-- > 0 && !stream.outcomes.empty()) {
    const Receipt receipt = stream.outcomes.back();
    stream.outcomes.pop_back();
    const std::string& display = std::get<CommitOutcome>(receipt.what).display;
    ledger_.TakeBack(id, receipt.sequence, receipt.incarnation, display);
    given_back_.insert({id, receipt.incarnation, receipt.sequence, display});
    receipts.insert(receipts.begin(), receipt);
  }
  if (!receipts.empty()) sim_.core->GiveBack(id, std::move(receipts));
  Step();  // one at a time: what it does without receipts could not be told from another's
}

void ModelRun::Crowd(Stream& stream, bool crowded) {
  Trace(absl::StrCat("session ", stream.info.session, crowded ? " does not read" : " reads"));
  SessionOf(stream)->crowded = crowded;
  stream.sink->crowded = crowded;
  if (!crowded) stream.info.intake->Wake();
}

void ModelRun::Advance(sync::TimeNs delta) {
  Step();
  if (!wrong_.empty()) return;
  sim_.clock.Advance(delta);
  Trace(absl::StrCat("now ", sim_.clock.Now()));
  const std::string before = plain_.scene.Fingerprint();
  plain_.PassTime(sim_.clock.Now());
  const bool changed = plain_.scene.Fingerprint() != before;
  if (changed) AddEffect([](uint64_t) { return true; });
  Step();
}

// ------------------------------------------------------------------------------------- operators

void ModelRun::ClearLayer(uint64_t owner, const std::string& layer, bool keep_state) {
  Step();
  if (!wrong_.empty()) return;
  Trace(absl::StrCat("clear ", owner, "/", layer, keep_state ? ", keeping its state" : ""));
  auto expected = std::make_shared<Cleared>();
  const uint64_t id = AddEffect(Changing([this, owner, layer, keep_state, expected] {
    *expected = plain_.ClearLayer(owner, layer, keep_state);
  }));
  ++replies_due_;
  sim_.core->ClearLayer(owner, layer, keep_state, {}, [this, id, expected](auto cleared) {
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

void ModelRun::Control(OwnerControl control) {
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
  sim_.core->ControlOwner(control, [this, expected](absl::StatusOr<OwnerInfo> info) {
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

// -------------------------------------------------------------------------------------- displays

void ModelRun::SetState(size_t d) {
  const DisplayNow& now = now_[d];
  ledger_.State(d, now.attached ? (now.blanked ? display::DisplayState::kBlanked
                                               : display::DisplayState::kShowing)
                                : display::DisplayState::kLost);
}

void ModelRun::Show(size_t d) {
  testing::ScriptedDisplay& display = sim_.display(static_cast<int>(d));
  if (const display::SliceFramePtr frame = display.in_flight()) {
    Trace(absl::StrCat("display ", d, " shows volume ", frame->volume));
    ledger_.Shown(d, frame->volume, sim_.clock.Now());
    display.Show();
  }
  Step();
}

void ModelRun::Cable(size_t d) {
  testing::ScriptedDisplay& display = sim_.display(static_cast<int>(d));
  now_[d].attached = !now_[d].attached;
  SetState(d);
  if (now_[d].attached) {
    Trace(absl::StrCat("display ", d, " attaches"));
    display.Attach();
  } else {
    const std::string reason = absl::StrCat("cable pulled #", ++happenings_, ".");
    Trace(absl::StrCat("display ", d, " ", reason));
    ledger_.Loss(d, reason);
    display.Lose(reason);
  }
  Step();
}

void ModelRun::Blank(size_t d, bool blank) {
  Step();
  if (!wrong_.empty()) return;
  Trace(absl::StrCat("display ", d, blank ? " dark" : " light"));
  now_[d].blanked = blank;
  if (blank) ledger_.Loss(d, "blanked");
  SetState(d);
  DisplayUpdate update;
  update.blank = blank;
  if (!sim_.Update(update, NameOf(d)).ok()) Fail("a display was not blanked");
  CheckAtRest();
}

void ModelRun::Pattern(size_t d, TestPattern pattern) {
  Step();
  if (!wrong_.empty()) return;
  Trace(absl::StrCat("display ", d, " pattern ", static_cast<int>(pattern)));
  now_[d].pattern = pattern != TestPattern::kNone;
  ledger_.Pattern(d, now_[d].pattern);
  DisplayUpdate update;
  update.pattern = pattern;
  if (!sim_.Update(update, NameOf(d)).ok()) Fail("a display has no pattern");
  CheckAtRest();
}

void ModelRun::EngineFail(size_t d, bool lost) {
  now_[d].armed = absl::StrCat(lost ? "engine gone #" : "frame failed #", ++happenings_, ".");
  Trace(absl::StrCat("engine ", d, " will fail: ", now_[d].armed));
  ledger_.Loss(d, now_[d].armed);
  sim_.engine(static_cast<int>(d)).fail =
      lost ? absl::DataLossError(now_[d].armed) : absl::InternalError(now_[d].armed);
}

}  // namespace voxeld::daemon::model
