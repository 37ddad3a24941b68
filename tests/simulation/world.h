// A whole daemon below gRPC with its devices, in one thread: the core's thread, one thread for each
// display, each device and each engine take turns in random order, and time advances when none of
// them has anything to do.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "daemon/core/core.h"
#include "display/api/display.h"
#include "display/emulator/fault_injector.h"
#include "display/emulator/hostile_device.h"
#include "display/emulator/voxlink_device.h"
#include "display/sync/fake_clock.h"
#include "display/usb/faulty_transport.h"
#include "display/usb/in_process.h"
#include "tests/daemon/core/model/actions.h"
#include "tests/simulation/staged_engine.h"

namespace voxeld::simulation {

using daemon::model::Chance;

struct SeatOptions {
  std::string name;
  std::map<std::string, std::string> device;  // options of the simulated driver
  daemon::DisplaySetup setup;
  std::vector<display::TransportFault> transport_faults;
};

// A display of the daemon, with its device and engine. The core owns the display and therefore the
// transport.
struct Seat {
  std::string name;
  std::string genlock;
  display::Display* display = nullptr;
  display::FaultyTransport* cable = nullptr;
  display::InProcessTransport* carrier = nullptr;
  display::emulator::FaultInjector* faults = nullptr;
  display::emulator::HostileDevice* liar = nullptr;
  display::emulator::VoxlinkDevice* device = nullptr;
  std::shared_ptr<EngineStage> engine;
};

// The state that outlives the daemon is written here: one snapshot after another, always the
// newest, each taking its time.
class Disk final : public daemon::StateSink {
 public:
  Disk(sync::Clock& clock, Chance& chance) : clock_(clock), chance_(chance) {}

  void Offer(daemon::SnapshotPtr snapshot, std::shared_ptr<const daemon::OwnerRecords> owners,
             bool at_once) override;
  sync::TimeNs Next() const { return due_; }
  // Ends the write. Returns the snapshot that is on the disk.
  uint64_t Run();
  uint64_t written() const { return written_; }

 private:
  void Begin(bool at_once);

  sync::Clock& clock_;
  Chance& chance_;
  uint64_t offered_ = 0, writing_ = 0, written_ = 0;
  bool waits_ = false;  // a caller waits for what was offered to be written
  sync::TimeNs due_ = sync::kNever;
};

class World {
 public:
  // The parts that take turns.
  enum class Who : uint8_t { kCore, kPipeline, kDevice, kEngine, kDisk };
  struct Hooks {
    std::function<void(size_t seat)> before_pipeline, after_pipeline, after_device;
  };

  World(uint32_t seed, const daemon::Limits& limits, const std::vector<SeatOptions>& seats,
        Hooks hooks);
  ~World();

  // The error of the options, or of the start; after an error there is nothing to run.
  const absl::Status& status() const { return status_; }
  daemon::Core& core() { return *core_; }
  sync::FakeClock& clock() { return clock_; }
  std::vector<Seat>& seats() { return seats_; }
  const Disk& disk() const { return disk_; }
  Chance& chance() { return chance_; }

  absl::Status Start();
  // Runs turns in random order until no part has anything to do now. Returns false if that never
  // happens.
  bool RunToRest();
  // Returns the parts that have something to do now.
  std::string Busy() const;
  // Returns the time at which a part has something to do next.
  sync::TimeNs Next() const;
  // Notes that the seat's device may have something to do, since another part has used it.
  void Touch(size_t seat) { device_dirty_[seat] = true; }

  uint64_t turns() const { return turns_; }

 private:
  struct Turn {
    Who who = Who::kCore;
    size_t seat = 0;
  };
  void Take(const Turn& turn);
  void Gather(std::vector<Turn>& runnable) const;

  Hooks hooks_;
  Chance chance_;
  sync::FakeClock clock_;
  Disk disk_{clock_, chance_};
  absl::Status status_;
  std::vector<Seat> seats_;
  std::vector<sync::TimeNs> next_thread_;  // index 0 is the core's
  std::vector<sync::TimeNs> next_device_;
  std::vector<bool> device_dirty_;
  bool started_ = false;
  uint64_t turns_ = 0;
  std::optional<daemon::Core> core_;
};

}  // namespace voxeld::simulation
