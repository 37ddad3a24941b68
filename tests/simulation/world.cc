#include "tests/simulation/world.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "display/drivers/simulated/emulated_device.h"
#include "display/drivers/voxlink/voxlink_display.h"

namespace voxeld::simulation {
namespace {

constexpr int kMostTurns = 100'000;  // turns without time advancing: more mean that something spins

}  // namespace

void Disk::Offer(daemon::SnapshotPtr snapshot,
                 std::shared_ptr<const daemon::OwnerRecords> /*owners*/, bool at_once) {
  offered_ = snapshot->number;
  waits_ = waits_ || at_once;
  if (writing_ == 0) {
    Begin(at_once);
  }
}

void Disk::Begin(bool at_once) {
  writing_ = offered_;
  waits_ = false;
  due_ = clock_.Now() + (at_once ? 0 : 100 * sync::kMillisecond) +
         chance_.Pick(40) * sync::kMillisecond;
}

uint64_t Disk::Run() {
  written_ = std::exchange(writing_, 0);
  due_ = sync::kNever;
  if (offered_ > written_) Begin(waits_);
  return written_;
}

World::World(uint32_t seed, const daemon::Limits& limits, const std::vector<SeatOptions>& seats,
             Hooks hooks)
    : hooks_(std::move(hooks)), chance_(seed ^ 0x5EED) {
  daemon::CoreOptions options;
  options.limits = limits;
  options.version = "simulation";
  options.threads = false;
  options.state = &disk_;
  // Here, the device of an engine is the number of its display.
  options.make_engine =
      [this](const gpu::EngineOptions& wanted) -> absl::StatusOr<std::unique_ptr<gpu::Engine>> {
    return MakeStagedEngine(seats_[static_cast<size_t>(wanted.device)].engine);
  };
  core_.emplace(std::move(options), clock_);
  seats_.reserve(seats.size());
  for (const SeatOptions& wanted : seats) {
    absl::StatusOr<display::simulated::EmulatedDevice> emulated =
        display::simulated::ReadEmulatedDevice({wanted.name, "simulated", wanted.device});
    if (!emulated.ok()) {
      status_ = emulated.status();
      return;
    }
    Seat& seat = seats_.emplace_back();
    seat.name = wanted.name;
    seat.genlock = wanted.setup.genlock;
    seat.engine = std::make_shared<EngineStage>();
    seat.engine->clock = &clock_;
    auto device = std::make_unique<display::emulator::VoxlinkDevice>(emulated->config, clock_);
    seat.device = device.get();
    auto liar = std::make_unique<display::emulator::HostileDevice>(std::move(device));
    seat.liar = liar.get();
    auto faults = std::make_unique<display::emulator::FaultInjector>(
        std::move(liar), display::emulator::FaultPlan(), clock_);
    seat.faults = faults.get();
    display::InProcessTransport::Options carrier;
    carrier.own_thread = false;
    carrier.identity.serial = emulated->config.serial;
    auto transport =
        std::make_unique<display::InProcessTransport>(std::move(faults), clock_, carrier);
    seat.carrier = transport.get();
    auto cable = std::make_unique<display::FaultyTransport>(
        std::move(transport), wanted.transport_faults, clock_,
        display::FaultyTransport::Options{.own_thread = false});
    seat.cable = cable.get();
    auto shown = std::make_unique<display::voxlink::VoxlinkDisplay>(std::move(emulated->info),
                                                                    std::move(cable), clock_);
    seat.display = shown.get();
    gpu::EngineOptions engine;
    engine.kind = gpu::EngineKind::kCpu;
    engine.device = static_cast<int>(seats_.size() - 1);
    status_ = core_->AddDisplay(std::move(shown), engine, wanted.setup);
    if (!status_.ok()) return;
  }
  next_thread_.assign(seats_.size() + 1, 0);
  next_device_.assign(seats_.size(), 0);
  device_dirty_.assign(seats_.size(), true);
}

World::~World() {
  hooks_ = {};
  for (Seat& seat : seats_) {
    seat.engine->on_submit = nullptr;
    seat.engine->on_frame = nullptr;
    seat.engine->on_failed = nullptr;
  }
  core_.reset();
}

absl::Status World::Start() {
  started_ = true;
  return core_->Start();
}

sync::TimeNs World::Next() const {
  sync::TimeNs next = disk_.Next();
  next = std::min(next, *std::min_element(next_thread_.begin(), next_thread_.end()));
  for (size_t i = 0; i < seats_.size(); ++i) {
    next = std::min({next, next_device_[i], seats_[i].engine->Next()});
  }
  return next;
}

void World::Gather(std::vector<Turn>& runnable) const {
  runnable.clear();
  const sync::TimeNs now = clock_.Now();
  if (next_thread_[0] <= now || core_->Ready(0)) runnable.push_back({Who::kCore, 0});
  if (disk_.Next() <= now) runnable.push_back({Who::kDisk, 0});
  for (size_t i = 0; i < seats_.size(); ++i) {
    if (next_thread_[i + 1] <= now || core_->Ready(i + 1)) runnable.push_back({Who::kPipeline, i});
    if (device_dirty_[i] || next_device_[i] <= now) runnable.push_back({Who::kDevice, i});
    if (seats_[i].engine->Next() <= now) runnable.push_back({Who::kEngine, i});
  }
}

std::string World::Busy() const {
  static const char* const kNames[] = {"the core", "pipeline", "device", "engine", "the disk"};
  std::vector<Turn> runnable;
  Gather(runnable);
  std::string text;
  for (const Turn& turn : runnable) {
    absl::StrAppend(&text, text.empty() ? "" : ", ", kNames[static_cast<size_t>(turn.who)]);
    if (turn.who != Who::kCore) absl::StrAppend(&text, " ", turn.seat);
  }
  return text;
}

void World::Take(const Turn& turn) {
  ++turns_;
  Seat* const seat = &seats_[turn.seat];
  switch (turn.who) {
    case Who::kCore:
      next_thread_[0] = core_->Turn(0);
      return;
    case Who::kPipeline:
      hooks_.before_pipeline(turn.seat);
      next_thread_[turn.seat + 1] = core_->Turn(turn.seat + 1);
      device_dirty_[turn.seat] = true;
      return hooks_.after_pipeline(turn.seat);
    case Who::kDevice:
      device_dirty_[turn.seat] = false;
      next_device_[turn.seat] = std::min(seat->carrier->Pump(), seat->cable->Pump());
      return hooks_.after_device(turn.seat);
    case Who::kEngine:
      return seat->engine->Run();
    case Who::kDisk:
      return core_->OnDurable(disk_.Run());
  }
}

bool World::RunToRest() {
  std::vector<Turn> runnable;
  for (int turns = 0; turns < kMostTurns; ++turns) {
    Gather(runnable);
    if (runnable.empty()) return true;
    Take(runnable[chance_.Pick(static_cast<uint32_t>(runnable.size()))]);
  }
  return false;
}

}  // namespace voxeld::simulation
