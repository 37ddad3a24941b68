// Core's displays: what is asked of their pipelines, and the answers brought together.
#include <algorithm>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "daemon/core/core_impl.h"
#include "daemon/pipeline/view.h"
#include "daemon/scene/quoted.h"
#include "daemon/scene/view_check.h"

namespace voxeld::daemon {
namespace {

absl::Status Ended(const std::string& name) {
  return absl::UnavailableError(absl::StrCat("display \"", name, "\" has been stopped"));
}

MemoryFigures MemoryOf(const Budget& budget) {
  using Use = Budget::Use;
  return {budget.limit_bytes(),
          budget.used_bytes(Use::kScene),
          budget.used_bytes(Use::kStaged),
          budget.used_bytes(Use::kWaiting),
          budget.used_bytes(Use::kAnswers),
          budget.used_bytes(Use::kOwed),
          budget.used_bytes(Use::kEngines),
          budget.used_bytes(Use::kLocal),
          budget.used_bytes(Use::kArriving)};
}

}  // namespace

absl::StatusOr<std::shared_ptr<Genlock>> Core::Impl::JoinGenlock(const display::Display& display,
                                                                 const std::string& name) {
  const auto other = std::find_if(displays_.begin(), displays_.end(),
                                  [&](const auto& slot) { return slot->genlock == name; });
  const display::DisplayInfo* info = other == displays_.end() ? nullptr : &(*other)->info;
  if (absl::Status status = CheckGenlock(name, display, info); !status.ok()) return status;
  std::shared_ptr<Genlock>& genlock = genlocks_[name];
  if (genlock == nullptr) {
    genlock =
        std::make_shared<Genlock>(clock_, [retired = retired_](std::shared_ptr<const void> what) {
          retired->Post([what = std::move(what)] {});
        });
  }
  return genlock;
}

absl::Status Core::Impl::AddDisplay(std::unique_ptr<display::Display> display,
                                    const gpu::EngineOptions& engine, const DisplaySetup& setup) {
  const display::DisplayInfo info = display->info();
  if (phase_ != Phase::kNew) {
    return absl::FailedPreconditionError(
        absl::StrCat("display \"", info.name, "\" comes after Start; add displays before it"));
  }
  for (const auto& slot : displays_) {
    if (slot->info.name == info.name) {
      return absl::AlreadyExistsError(
          absl::StrCat("there is a display \"", info.name, "\" already; names must differ"));
    }
  }
  FramePipeline::Options options;
  options.display = std::move(display);
  options.make_engine = options_.make_engine ? options_.make_engine : gpu::CreateEngine;
  options.engine = engine;
  options.engine.abandoned = abandoned_;
  options.setup = setup;
  if (!setup.genlock.empty()) {
    absl::StatusOr<std::shared_ptr<Genlock>> genlock = JoinGenlock(*options.display, setup.genlock);
    if (!genlock.ok()) return genlock.status();
    options.genlock = *std::move(genlock);
  }
  options.work = std::make_shared<Loop>(clock_);
  options.clock = &clock_;
  options.budget = budget_;
  // The core's queue is what keeps this safe: it is closed before the core is gone.
  options.tell = [this, loop = loop_](const Rider& rider, const CommitOutcome& outcome) {
    loop->Post([this, rider, outcome] { DeliverOutcome(rider, outcome); });
  };
  options.retire = [retired = retired_](std::shared_ptr<const void> what) {
    retired->Post([what = std::move(what)] {});
  };
  options.large_change = options_.large_change;
  options.run_aside = options_.run_aside;
  if (options_.threads) {
    options.run_aside = [aside = aside_](std::function<void()> work) {
      aside->Post(std::move(work));
    };
  }
  if (options_.engine_event) {
    options.tell_engine = [loop = loop_, tell = options_.engine_event,
                           name = info.name](EngineEvent event) {
      event.display = name;
      loop->Post([tell, event = std::move(event)] { tell(event); });
    };
  }
  if (options_.state_event) {
    options.tell_state = [loop = loop_, tell = options_.state_event, name = info.name](
                             display::DisplayState state, const std::string& reason) {
      loop->Post([tell, name, state, reason] { tell(name, state, reason); });
    };
  }
  if (options_.transfers_event) {
    options.tell_transfers = [loop = loop_, tell = options_.transfers_event,
                              name = info.name](uint64_t failed) {
      loop->Post([tell, name, failed] { tell(name, failed); });
    };
  }
  auto host = std::make_shared<Host>();
  host->work = options.work;
  absl::StatusOr<std::unique_ptr<FramePipeline>> pipeline =
      FramePipeline::Create(std::move(options));
  if (!pipeline.ok()) {
    return absl::Status(pipeline.status().code(),
                        absl::StrCat("display \"", info.name, "\": ", pipeline.status().message()));
  }
  host->pipeline = *std::move(pipeline);
  auto slot = std::make_unique<DisplaySlot>();
  slot->info = info;
  slot->scene_to_voxel = host->pipeline->Describe().scene_to_voxel;
  slot->genlock = setup.genlock;
  slot->host = std::move(host);
  displays_.push_back(std::move(slot));
  return absl::OkStatus();
}

void Core::Impl::UpdateViews() {
  std::vector<DisplayView> views;
  for (const auto& slot : displays_) {
    views.push_back({slot->info.name, slot->scene_to_voxel});
    for (const gpu::Affine& map : slot->coming) views.push_back({slot->info.name, map});
  }
  store_.SetViews(std::move(views));
}

absl::Status Core::Impl::ExpectView(DisplaySlot& slot, const ViewOptions& view) {
  const absl::StatusOr<gpu::Affine> map = SceneToVoxel(view, slot.info.geometry.grid);
  if (!map.ok()) return map.status();
  const DisplayView coming{slot.info.name, *map};
  if (absl::Status fits = store_.CheckNewView(coming); !fits.ok()) return fits;
  slot.coming.push_back(*map);
  UpdateViews();
  return absl::OkStatus();
}

absl::StatusOr<Core::Impl::DisplaySlot*> Core::Impl::FindDisplay(const std::string& name) {
  std::vector<std::string> names;
  for (const auto& slot : displays_) {
    if (name.empty() || slot->info.name == name) return slot.get();
    names.push_back(absl::StrCat("\"", slot->info.name, "\""));
  }
  return absl::NotFoundError(
      names.empty()
          ? std::string("there are no displays")
          : absl::StrCat("no display ", Quoted(name), "; there are: ", absl::StrJoin(names, ", ")));
}

template <typename T>
void Core::Impl::Collect(std::function<T(const FramePipeline&)> ask,
                         std::function<T(const DisplaySlot&)> absent,
                         std::function<void(std::vector<T>)> done) {
  struct Answers {
    sync::Mutex mutex;
    std::vector<T> values VOXELD_GUARDED_BY(mutex);
    size_t left VOXELD_GUARDED_BY(mutex) = 0;
    std::function<void(std::vector<T>)> done;
  };
  if (displays_.empty()) return done({});
  auto answers = std::make_shared<Answers>();
  answers->done = std::move(done);
  {
    sync::MutexLock lock(answers->mutex);
    answers->values.resize(displays_.size());
    answers->left = displays_.size();
  }
  const auto arrived = [answers](size_t i, T value) {
    std::vector<T> all;
    {
      sync::MutexLock lock(answers->mutex);
      answers->values[i] = std::move(value);
      if (--answers->left > 0) return;
      all = std::move(answers->values);
    }
    answers->done(std::move(all));
  };
  for (size_t i = 0; i < displays_.size(); ++i) {
    const Host& host = *displays_[i]->host;
    const bool posted =
        host.work->Post([i, ask, arrived, loop = loop_, pipeline = host.pipeline.get()] {
          const T value = ask(*pipeline);
          // The core may have ended before its display: then this thread answers.
          if (!loop->Post([i, arrived, value] { arrived(i, value); })) arrived(i, value);
        });
    if (!posted) arrived(i, absent(*displays_[i]));
  }
}

void Core::Impl::ListDisplays(Reply<std::vector<DisplayDescription>> reply) {
  Collect<DisplayDescription>(
      [](const FramePipeline& pipeline) { return pipeline.Describe(); },
      [](const DisplaySlot& slot) {
        DisplayDescription description;
        description.info = slot.info;
        return description;
      },
      [reply = std::move(reply)](std::vector<DisplayDescription> all) { reply(std::move(all)); });
}

void Core::Impl::GetStats(Reply<Stats> reply) {
  Stats stats;
  stats.time_ns = clock_.Now();
  stats.version = options_.version;
  stats.uptime_ns = stats.time_ns - started_ns_;
  const Snapshot& scene = *store_.snapshot();
  std::set<uint64_t> owners;
  for (const auto& [id, session] : sessions_) owners.insert(session.owner);
  scene.owners.ForEach([&](uint64_t owner, const OwnerTally&) { owners.insert(owner); });
  stats.scene_bytes = scene.total.bytes;
  stats.sessions = sessions_.size();
  stats.owners = owners.size();
  stats.layers = scene.layers.size();
  stats.entities = scene.entities;
  stats.objects = scene.objects.size();
  stats.commits_accepted = commits_accepted_;
  stats.commits_refused = commits_refused_;
  stats.operations_applied = operations_applied_;
  stats.operations_refused = operations_refused_;
  stats.bytes_in = bytes_in_->load(std::memory_order_relaxed);
  stats.outcomes_undelivered = outcomes_undelivered_;
  stats.client_drops = client_drops_;
  stats.streams_overrun = streams_overrun_;
  stats.volume_watches_asleep = volume_watches_asleep_;
  stats.frames_dropped = frames_dropped_;
  stats.timed_pending = timed_.size();
  stats.timed_dropped = timed_dropped_;
  stats.must_show_timeouts = must_show_timeouts_;
  stats.sessions_dormant = dormant_.size();
  stats.sessions_resumed = sessions_resumed_;
  stats.sending = sending_.Summary(stats.time_ns);
  stats.decoding = decoding_.Summary(stats.time_ns);
  stats.applying = applying_.Summary(stats.time_ns);
  stats.memory = MemoryOf(*budget_);
  if (options_.connections) stats.connections = options_.connections();
  if (options_.state_figures) stats.state = options_.state_figures();
  if (options_.asset_figures) stats.assets = options_.asset_figures();
  if (options_.process_figures) stats.process = options_.process_figures();
  Collect<DisplayFigures>([](const FramePipeline& pipeline) { return pipeline.Figures(); },
                          [](const DisplaySlot& slot) {
                            DisplayFigures figures;
                            figures.name = slot.info.name;
                            return figures;
                          },
                          [reply = std::move(reply),
                           stats = std::move(stats)](std::vector<DisplayFigures> all) mutable {
                            stats.displays = std::move(all);
                            reply(std::move(stats));
                          });
}

void Core::Impl::GetDisplay(const std::string& name, Reply<DisplayDescription> reply) {
  const absl::StatusOr<DisplaySlot*> slot = FindDisplay(name);
  if (!slot.ok()) return reply(slot.status());
  const Host& host = *(*slot)->host;
  const bool posted =
      host.work->Post([reply, pipeline = host.pipeline.get()] { reply(pipeline->Describe()); });
  if (!posted) reply(Ended((*slot)->info.name));
}

void Core::Impl::UpdateDisplay(const std::string& name, DisplayUpdate update,
                               Reply<DisplayDescription> reply) {
  const absl::StatusOr<DisplaySlot*> found = FindDisplay(name);
  if (!found.ok()) return reply(found.status());
  DisplaySlot* slot = *found;
  const bool expects = update.view.has_value();
  if (expects) {
    if (absl::Status status = ExpectView(*slot, *update.view); !status.ok()) return reply(status);
  }
  const bool posted =
      slot->host->work->Post([this, slot, reply, expects, update = std::move(update), loop = loop_,
                              pipeline = slot->host->pipeline.get()] {
        const absl::Status status = pipeline->Update(update);
        const bool answered =
            loop->Post([this, slot, reply, expects, status, description = pipeline->Describe()] {
              if (expects) {
                slot->coming.erase(slot->coming.begin());
                slot->scene_to_voxel = description.scene_to_voxel;
                UpdateViews();
              }
              if (!status.ok()) return reply(status);
              reply(description);
            });
        if (!answered) reply(Ended(pipeline->info().name));
      });
  if (!posted) reply(Ended(slot->info.name));
}

void Core::Impl::Capture(const std::string& name, CaptureId id, sync::TimeNs timeout,
                         uint64_t at_least_snapshot, Reply<display::DecodedVolume> reply) {
  const absl::StatusOr<DisplaySlot*> slot = FindDisplay(name);
  if (!slot.ok()) return reply(slot.status());
  const Host& host = *(*slot)->host;
  const bool posted =
      host.work->Post([reply, id, timeout, at_least_snapshot, pipeline = host.pipeline.get()] {
        pipeline->Capture(timeout, at_least_snapshot, reply, id);
      });
  if (!posted) reply(Ended((*slot)->info.name));
}

void Core::Impl::CancelCapture(const std::string& name, CaptureId id) {
  const absl::StatusOr<DisplaySlot*> slot = FindDisplay(name);
  if (!slot.ok()) return;
  const Host& host = *(*slot)->host;
  host.work->Post([id, pipeline = host.pipeline.get()] { pipeline->CancelCapture(id); });
}

void Core::Impl::GetShownScene(const std::string& name, Reply<ShownScene> reply) {
  const absl::StatusOr<DisplaySlot*> slot = FindDisplay(name);
  if (!slot.ok()) return reply(slot.status());
  const Host& host = *(*slot)->host;
  const bool posted =
      host.work->Post([reply, pipeline = host.pipeline.get()] { reply(pipeline->Shown()); });
  if (!posted) reply(Ended((*slot)->info.name));
}

void Core::Impl::Watch(const std::string& name, WatchId id,
                       const display::Display::Watcher& watcher) {
  const absl::StatusOr<DisplaySlot*> slot = FindDisplay(name);
  if (!slot.ok()) return watcher(slot.status());
  const Host& host = *(*slot)->host;
  const bool posted = host.work->Post(
      [id, watcher, pipeline = host.pipeline.get()] { pipeline->Watch(id, watcher); });
  if (!posted) watcher(Ended((*slot)->info.name));
}

void Core::Impl::Unwatch(const std::string& name, WatchId id) {
  const absl::StatusOr<DisplaySlot*> slot = FindDisplay(name);
  if (!slot.ok()) return;
  const Host& host = *(*slot)->host;
  host.work->Post([id, pipeline = host.pipeline.get()] { pipeline->Unwatch(id); });
}

}  // namespace voxeld::daemon
