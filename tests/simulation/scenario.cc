#include "tests/simulation/scenario.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::simulation {
namespace {

using daemon::GeometryData;
using daemon::GeometryPtr;
using daemon::model::Action;
using daemon::model::ActionKind;
using display::TransferStatus;
using display::TransportFault;
using display::emulator::Fault;

constexpr double kFar = 1e12;  // outside of every display
constexpr uint32_t kColors[] = {0xFFFFFF, 0xFF0000, 0x00FF00, 0x0000FF, 0x80C040};

// Returns quarters of a voxel: sums and products of quarters are exact.
float Quarter(Chance& chance, uint32_t voxels) {
  return static_cast<float>(chance.Pick(4 * voxels)) / 4;
}

GeometryPtr RandomShape(Chance& chance) {
  auto data = std::make_shared<GeometryData>();
  gpu::GeometryRecord& record = data->record;
  record.color = kColors[chance.Pick(std::size(kColors))];
  const uint32_t kind = chance.Pick(8);
  if (kind < 6) {
    record.kind = kind < 4 ? gpu::PrimitiveKind::kPoints : gpu::PrimitiveKind::kSegments;
    record.vertex_count = kind < 4 ? 1 + chance.Pick(3) : 2;
    std::vector<float> at(size_t{3} * record.vertex_count);
    for (float& x : at) x = Quarter(chance, 8);
    if (chance.OneIn(40)) at[0] = static_cast<float>(kFar);
    data->arrays = gpu::GeometryArrays::Of(record, at);
    for (size_t axis = 0; axis < 3; ++axis) {
      data->min[axis] = data->max[axis] = at[axis];
      for (size_t i = axis; i < at.size(); i += 3) {
        data->min[axis] = std::min<double>(data->min[axis], at[i]);
        data->max[axis] = std::max<double>(data->max[axis], at[i]);
      }
    }
    return data;
  }
  const bool box = kind == 6;
  record.kind = box ? gpu::PrimitiveKind::kBox : gpu::PrimitiveKind::kSphere;
  record.fill = chance.OneIn(2) ? gpu::Fill::kSolid : gpu::Fill::kSurface;
  for (size_t axis = 0; axis < 3; ++axis) record.params[axis] = Quarter(chance, 8);
  for (size_t i = 3; i < (box ? 6u : 4u); ++i) record.params[i] = Quarter(chance, 4) + 0.5F;
  for (size_t axis = 0; axis < 3; ++axis) {
    const double half = box ? record.params[3 + axis] / 2 : record.params[3];
    data->min[axis] = record.params[axis] - half;
    data->max[axis] = record.params[axis] + half;
  }
  return data;
}

gpu::Affine RandomMap(Chance& chance) {
  gpu::Affine map;
  switch (chance.Pick(30)) {
    case 0:
      map.m[5] = 0;  // singular
      return map;
    case 1:
      map.m[3] = kFar;
      return map;
    case 2:
      map.m[0] = 2;
      map.m[10] = 0.5;
      return map;
    case 3:  // a quarter turn
      map.m[0] = map.m[5] = 0;
      map.m[1] = -1;
      map.m[4] = 1;
      map.m[3] = 8;
      return map;
    default:
      for (const size_t i : {3, 7, 11}) map.m[i] = Quarter(chance, 4) - 1;
      return map;
  }
}

std::map<std::string, std::string> RandomDevice(Chance& chance, const std::string& rate) {
  std::map<std::string, std::string> device = {{"rate", rate}, {"dither", "none"}};
  switch (chance.Pick(4)) {
    case 0:
      device["geometry"] = "rotor";
      device["size"] = "8x6";
      device["slices"] = "12";
      break;
    case 1:
      device["geometry"] = "lattice";
      device["size"] = "5x5x5";
      break;
    default:
      device["size"] = chance.OneIn(2) ? "8x8x8" : "8x6x4";
      if (chance.OneIn(8)) device["size"] = "24x16x3";  // a slice image takes several packets
  }
  switch (chance.Pick(6)) {
    case 0:
      device["format"] = "rgb332";
      device["dither"] = "ordered";
      break;
    case 1:
      device["format"] = "bitplanes";
      device["sub_frames"] = "2";
      device["dither"] = "blue";
      break;
    default:
      break;
  }
  if (chance.OneIn(6)) device["sampling"] = "weighted";
  if (chance.OneIn(4)) device["pacing"] = absl::StrCat(30'000 * (1 + chance.Pick(8)));
  if (chance.OneIn(3)) {
    device["max_payload"] = "1024";
    device["receive_buffer"] = "65536";
  }
  return device;
}

TransportFault RandomTransportFault(Chance& chance) {
  TransportFault fault;
  fault.where = static_cast<TransportFault::Where>(chance.Pick(3));
  fault.at = 1 + chance.Pick(fault.where == TransportFault::Where::kOpen ? 2 : 150);
  fault.count = 1 + chance.Pick(3);
  if (fault.where != TransportFault::Where::kCompletion) return fault;
  static constexpr TransferStatus kStatuses[] = {TransferStatus::kTimedOut, TransferStatus::kStall,
                                                 TransferStatus::kError, TransferStatus::kOverflow,
                                                 TransferStatus::kDisconnected};
  if (chance.OneIn(3)) {
    fault.hold = chance.Pick(400) * sync::kMillisecond;
  } else {
    fault.status = kStatuses[chance.Pick(std::size(kStatuses))];
  }
  return fault;
}

}  // namespace

const daemon::model::Palette& SmallPalette() {
  static const daemon::model::Palette palette{RandomShape, RandomMap};
  return palette;
}

Fault RandomFault(Chance& chance) {
  Fault fault;
  fault.when = static_cast<Fault::When>(chance.Pick(3));
  fault.what = static_cast<Fault::What>(chance.Pick(9));
  fault.endpoint = chance.OneIn(4) ? 0x82 : 0x01;
  fault.at = fault.when == Fault::When::kTransfer ? 1 + chance.Pick(12)
             : fault.when == Fault::When::kByte   ? chance.Pick(4000)
                                                  : chance.Pick(300) * sync::kMillisecond;
  switch (fault.what) {
    case Fault::What::kStall:
      break;
    case Fault::What::kNak:
    case Fault::What::kDelay:
    case Fault::What::kUnplug:
      fault.amount = chance.Pick(600) * sync::kMillisecond;
      break;
    case Fault::What::kError:
    case Fault::What::kBabble:
      fault.amount = 1 + chance.Pick(4);
      break;
    case Fault::What::kPartial:
    case Fault::What::kCorrupt:
    case Fault::What::kDrop:
      fault.amount = chance.Pick(800);
      break;
  }
  return fault;
}

Scenario MakeScenario(uint32_t seed) {
  Chance chance(seed ^ 0x51A7);
  daemon::model::Script script = daemon::model::MakeScript(seed);
  Scenario scenario;
  scenario.seed = seed;
  scenario.limits = script.limits;
  // The core decides how many commits may wait for their time when the sweeps decide when that is.
  scenario.limits.max_timed_commits = daemon::Limits().max_timed_commits;
  scenario.settles = script.settles;
  scenario.actions = std::move(script.actions);
  scenario.actions.resize(std::min<size_t>(scenario.actions.size(), 40 + chance.Pick(160)));
  scenario.device_faults = chance.OneIn(3);
  scenario.transport_faults = chance.OneIn(8);
  scenario.engine_faults = chance.OneIn(3);
  scenario.jumps = chance.OneIn(6);
  scenario.lies = chance.OneIn(10);
  scenario.memory_ends = chance.OneIn(5);
  static const char* const kRates[] = {"20", "30", "60"};
  const uint32_t displays = chance.OneIn(8) ? 3 : chance.OneIn(3) ? 2 : 1;
  const bool genlock = displays > 1 && !scenario.lies && chance.OneIn(2);
  std::string rate = kRates[chance.Pick(3)];
  for (uint32_t i = 0; i < displays; ++i) {
    SeatOptions seat;
    seat.name = i == 0 ? "main" : absl::StrCat("display", i);
    if (!genlock) rate = kRates[chance.Pick(3)];
    seat.device = RandomDevice(chance, rate);
    seat.setup.view.mode = daemon::ViewOptions::Mode::kVoxels;
    if (genlock && i < 2) seat.setup.genlock = "wall";
    if (scenario.transport_faults && chance.OneIn(2)) {
      for (uint32_t n = 1 + chance.Pick(3); n > 0; --n) {
        seat.transport_faults.push_back(RandomTransportFault(chance));
      }
    }
    scenario.seats.push_back(std::move(seat));
  }
  return scenario;
}

}  // namespace voxeld::simulation
