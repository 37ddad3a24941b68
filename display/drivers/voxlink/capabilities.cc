#include "display/drivers/voxlink/capabilities.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <optional>
#include <string>

#include "absl/strings/str_cat.h"
#include "display/geometry/footprint.h"
#include "display/sync/clock.h"

namespace voxeld::display::voxlink {
namespace {

constexpr uint32_t kMostSlices = 16384 * 16;
constexpr uint32_t kMostPixels = 16384;
constexpr uint32_t kLeastPayload = 1024;
constexpr int64_t kKeepaliveMs = kKeepaliveNs / sync::kMillisecond;
constexpr int64_t kWatchdogMs = kWatchdogNs / sync::kMillisecond;

uint8_t MirrorBits(bool u, bool v) { return static_cast<uint8_t>((u ? 1 : 0) | (v ? 2 : 0)); }

void EncodePlanar(std::vector<std::byte>& out, const PlanarStack& planar) {
  PlanarShape shape{};
  shape.kind = kShapePlanar;
  shape.normal = static_cast<uint8_t>(planar.normal);
  shape.mirror = MirrorBits(planar.mirror_u, planar.mirror_v);
  shape.strokes = static_cast<uint8_t>(planar.strokes);
  shape.positions = static_cast<uint32_t>(planar.positions_mm.size());
  shape.pitch_u_mm = planar.pitch_u_mm;
  shape.pitch_v_mm = planar.pitch_v_mm;
  shape.thickness_mm = planar.thickness_mm;
  Append(out, shape);
  for (const double position : planar.positions_mm) Append(out, position);
}

void EncodeRotor(std::vector<std::byte>& out, const Rotor& rotor) {
  RotorShape shape{};
  shape.kind = kShapeRotor;
  shape.clockwise = rotor.clockwise ? 1 : 0;
  shape.panels = static_cast<uint8_t>(rotor.panels.size());
  shape.slices_per_turn = static_cast<uint32_t>(rotor.slices_per_turn);
  Append(out, shape);
  for (const Rotor::Panel& panel : rotor.panels) {
    RotorPanel wire{};
    wire.pitch_u_mm = panel.pitch_u_mm;
    wire.pitch_v_mm = panel.pitch_v_mm;
    wire.eccentricity_mm = panel.eccentricity_mm;
    wire.shift_u_mm = panel.shift_u_mm;
    wire.shift_v_mm = panel.shift_v_mm;
    wire.phase_turns = panel.phase_turns;
    wire.mirror = MirrorBits(panel.mirror_u, panel.mirror_v);
    wire.tilt_deg = panel.tilt_deg;
    Append(out, wire);
  }
}

void EncodeHelix(std::vector<std::byte>& out, const Helix& helix) {
  HelixShape shape{};
  shape.kind = kShapeHelix;
  shape.flags = static_cast<uint8_t>((helix.clockwise ? 1 : 0) | (helix.left_handed ? 2 : 0));
  shape.mirror = MirrorBits(helix.mirror_u, helix.mirror_v);
  shape.blades = static_cast<uint8_t>(helix.blades);
  shape.slices_per_turn = static_cast<uint32_t>(helix.slices_per_turn);
  shape.pitch_u_mm = helix.pitch_u_mm;
  shape.pitch_v_mm = helix.pitch_v_mm;
  shape.span_turns = helix.span_turns;
  shape.height_mm = helix.height_mm;
  shape.hub_mm = helix.hub_mm;
  shape.radius_mm = helix.radius_mm;
  shape.phase_turns = helix.phase_turns;
  Append(out, shape);
}

void EncodeLattice(std::vector<std::byte>& out, const Lattice& lattice) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  LatticeShape shape{};
  shape.kind = kShapeLattice;
  shape.lights = static_cast<uint32_t>(lattice.points_mm.size());
  const Vec3& cell = lattice.cell_mm;
  std::copy_n(std::initializer_list<double>{cell.x, cell.y, cell.z}.begin(), 3, shape.cell_mm);
  Append(out, shape);
  for (const std::optional<Vec3>& light : lattice.points_mm) {
    const Vec3 at = light.value_or(Vec3{kNone, kNone, kNone});
    for (const double mm : {at.x, at.y, at.z}) Append(out, mm);
  }
}

absl::Status Bad(const char* field, auto value, const std::string& right) {
  return absl::DataLossError(
      absl::StrCat("the device's capabilities: ", field, " is ", value, "; it must be ", right));
}

absl::Status CheckLength(size_t have, size_t want) {
  if (have == want) return absl::OkStatus();
  return Bad("length of the shape", have, absl::StrCat(want));
}

absl::StatusOr<Geometry> Checked(Geometry geometry) {
  const absl::Status valid = ValidateShape(geometry);
  if (valid.ok()) return geometry;
  return absl::DataLossError(absl::StrCat("the device's capabilities: ", valid.message()));
}

absl::StatusOr<Geometry> ParsePlanar(std::span<const std::byte> block, const Capabilities& fixed) {
  if (block.size() < sizeof(PlanarShape)) {
    return Bad("length of the shape", block.size(), absl::StrCat(sizeof(PlanarShape), " or more"));
  }
  const auto shape = Load<PlanarShape>(block);
  if (shape.positions != fixed.slices) {
    return Bad("positions", shape.positions, absl::StrCat(fixed.slices, ", as many as slices"));
  }
  const auto length =
      CheckLength(block.size(), sizeof(PlanarShape) + sizeof(double) * shape.positions);
  if (!length.ok()) return length;
  if (shape.normal > 1) return Bad("normal", static_cast<int>(shape.normal), "0 (z) or 1 (y)");
  PlanarStack planar;
  planar.normal = static_cast<PlanarStack::Normal>(shape.normal);
  planar.width_px = static_cast<int32_t>(fixed.width);
  planar.height_px = static_cast<int32_t>(fixed.height);
  planar.pitch_u_mm = shape.pitch_u_mm;
  planar.pitch_v_mm = shape.pitch_v_mm;
  planar.thickness_mm = shape.thickness_mm;
  planar.mirror_u = (shape.mirror & 1) != 0;
  planar.mirror_v = (shape.mirror & 2) != 0;
  planar.strokes = std::max<int32_t>(shape.strokes, 1);
  planar.positions_mm.resize(shape.positions);
  std::memcpy(planar.positions_mm.data(), block.data() + sizeof(PlanarShape),
              sizeof(double) * shape.positions);
  for (const double pitch : {planar.pitch_u_mm, planar.pitch_v_mm, planar.thickness_mm}) {
    if (!(pitch > 0) || !std::isfinite(pitch)) return Bad("pitch", pitch, "above 0");
  }
  return Checked({.shape = std::move(planar), .grid = {}, .correction = {}});
}

absl::StatusOr<Geometry> ParseRotor(std::span<const std::byte> block, const Capabilities& fixed) {
  const auto shape = Load<RotorShape>(block);
  if (shape.panels < 1 || shape.panels > 16) {
    return Bad("panels", static_cast<int>(shape.panels), "from 1 to 16");
  }
  const auto length =
      CheckLength(block.size(), sizeof(RotorShape) + sizeof(RotorPanel) * shape.panels);
  if (!length.ok()) return length;
  if (shape.slices_per_turn < 1 || shape.slices_per_turn > 16384 ||
      shape.slices_per_turn * shape.panels != fixed.slices) {
    return Bad("slices_per_turn", shape.slices_per_turn,
               absl::StrCat("slices (", fixed.slices, ") / panels (", shape.panels, ")"));
  }
  Rotor rotor;
  rotor.slices_per_turn = static_cast<int32_t>(shape.slices_per_turn);
  rotor.width_px = static_cast<int32_t>(fixed.width);
  rotor.height_px = static_cast<int32_t>(fixed.height);
  rotor.clockwise = shape.clockwise != 0;
  for (size_t i = 0; i < shape.panels; ++i) {
    const auto wire = Load<RotorPanel>(block.subspan(sizeof(RotorShape) + i * sizeof(RotorPanel)));
    Rotor::Panel panel;
    panel.pitch_u_mm = wire.pitch_u_mm;
    panel.pitch_v_mm = wire.pitch_v_mm;
    panel.eccentricity_mm = wire.eccentricity_mm;
    panel.shift_u_mm = wire.shift_u_mm;
    panel.shift_v_mm = wire.shift_v_mm;
    panel.phase_turns = wire.phase_turns;
    panel.mirror_u = (wire.mirror & 1) != 0;
    panel.mirror_v = (wire.mirror & 2) != 0;
    panel.tilt_deg = wire.tilt_deg;
    for (const double pitch : {panel.pitch_u_mm, panel.pitch_v_mm}) {
      if (!(pitch > 0) || !std::isfinite(pitch)) return Bad("pitch", pitch, "above 0");
    }
    for (const double mm : {panel.eccentricity_mm, panel.shift_u_mm, panel.shift_v_mm}) {
      if (!std::isfinite(mm)) return Bad("panel offset", mm, "finite");
    }
    if (!(panel.phase_turns >= 0 && panel.phase_turns < 1)) {
      return Bad("phase", panel.phase_turns, "in [0, 1)");
    }
    rotor.panels.push_back(panel);
  }
  return Checked({.shape = std::move(rotor), .grid = {}, .correction = {}});
}

absl::StatusOr<Geometry> ParseHelix(std::span<const std::byte> block, const Capabilities& fixed) {
  const auto length = CheckLength(block.size(), sizeof(HelixShape));
  if (!length.ok()) return length;
  const auto shape = Load<HelixShape>(block);
  if (shape.slices_per_turn != fixed.slices) {
    return Bad("slices_per_turn", shape.slices_per_turn,
               absl::StrCat(fixed.slices, ", as many as slices"));
  }
  Helix helix;
  helix.slices_per_turn = static_cast<int32_t>(shape.slices_per_turn);
  helix.width_px = static_cast<int32_t>(fixed.width);
  helix.height_px = static_cast<int32_t>(fixed.height);
  helix.pitch_u_mm = shape.pitch_u_mm;
  helix.pitch_v_mm = shape.pitch_v_mm;
  helix.blades = shape.blades;
  helix.span_turns = shape.span_turns;
  helix.height_mm = shape.height_mm;
  helix.hub_mm = shape.hub_mm;
  helix.radius_mm = shape.radius_mm;
  helix.phase_turns = shape.phase_turns;
  helix.clockwise = (shape.flags & 1) != 0;
  helix.left_handed = (shape.flags & 2) != 0;
  helix.mirror_u = (shape.mirror & 1) != 0;
  helix.mirror_v = (shape.mirror & 2) != 0;
  return Checked({.shape = helix, .grid = {}, .correction = {}});
}

absl::StatusOr<Geometry> ParseLattice(std::span<const std::byte> block, const Capabilities& fixed) {
  if (block.size() < sizeof(LatticeShape)) {
    return Bad("length of the shape", block.size(), absl::StrCat(sizeof(LatticeShape), " or more"));
  }
  const auto shape = Load<LatticeShape>(block);
  if (fixed.height != 1) return Bad("height", fixed.height, "1: slices of a lattice are rows");
  if (shape.lights != uint64_t{fixed.slices} * fixed.width) {
    return Bad("lights", shape.lights,
               absl::StrCat(uint64_t{fixed.slices} * fixed.width, ", slices · width"));
  }
  const auto length =
      CheckLength(block.size(), sizeof(LatticeShape) + 3 * sizeof(double) * shape.lights);
  if (!length.ok()) return length;
  Lattice lattice;
  lattice.width_px = static_cast<int32_t>(fixed.width);
  lattice.cell_mm = {shape.cell_mm[0], shape.cell_mm[1], shape.cell_mm[2]};
  for (size_t i = 0; i < shape.lights; ++i) {
    double at[3];
    std::memcpy(at, block.data() + sizeof(LatticeShape) + i * sizeof(at), sizeof(at));
    const bool none = std::isnan(at[0]) && std::isnan(at[1]) && std::isnan(at[2]);
    lattice.points_mm.push_back(none ? std::nullopt : std::optional(Vec3{at[0], at[1], at[2]}));
  }
  return Checked({.shape = std::move(lattice), .grid = {}, .correction = {}});
}

std::string Describe(const Geometry& geometry, const FrameLayout& layout) {
  const char* const kinds[] = {"a planar stack", "a rotor", "a lattice", "a helix"};
  return absl::StrCat(kinds[geometry.shape.index()], " of ", layout.slices, " slices of ",
                      layout.width, "x", layout.height, " pixels");
}

}  // namespace

std::vector<std::byte> EncodeCapabilities(const DeviceCapabilities& capabilities) {
  std::vector<std::byte> shape;
  Capabilities fixed = capabilities.fixed;
  if (const auto* planar = std::get_if<PlanarStack>(&capabilities.geometry.shape)) {
    EncodePlanar(shape, *planar);
    fixed.slices = static_cast<uint32_t>(planar->positions_mm.size());
    fixed.width = static_cast<uint32_t>(planar->width_px);
    fixed.height = static_cast<uint32_t>(planar->height_px);
  } else if (const auto* lattice = std::get_if<Lattice>(&capabilities.geometry.shape)) {
    EncodeLattice(shape, *lattice);
    fixed.width = static_cast<uint32_t>(std::max(lattice->width_px, 1));
    fixed.height = 1;
    fixed.slices = static_cast<uint32_t>(lattice->points_mm.size()) / fixed.width;
  } else if (const auto* helix = std::get_if<Helix>(&capabilities.geometry.shape)) {
    EncodeHelix(shape, *helix);
    fixed.slices = static_cast<uint32_t>(helix->slices_per_turn);
    fixed.width = static_cast<uint32_t>(helix->width_px);
    fixed.height = static_cast<uint32_t>(helix->height_px);
  } else {
    const Rotor& rotor = std::get<Rotor>(capabilities.geometry.shape);
    EncodeRotor(shape, rotor);
    fixed.slices =
        static_cast<uint32_t>(rotor.slices_per_turn) * static_cast<uint32_t>(rotor.panels.size());
    fixed.width = static_cast<uint32_t>(rotor.width_px);
    fixed.height = static_cast<uint32_t>(rotor.height_px);
  }
  fixed.total_length = static_cast<uint32_t>(sizeof(Capabilities) + shape.size());
  std::vector<std::byte> block;
  Append(block, fixed);
  AppendBytes(block, shape);
  return block;
}

absl::StatusOr<DeviceCapabilities> ParseCapabilities(std::span<const std::byte> block) {
  if (block.size() < sizeof(Capabilities) + sizeof(RotorShape)) {
    return Bad("length", block.size(),
               absl::StrCat(sizeof(Capabilities) + sizeof(RotorShape), " or more"));
  }
  DeviceCapabilities device;
  device.fixed = Load<Capabilities>(block);
  const Capabilities& fixed = device.fixed;
  if (fixed.total_length != block.size()) {
    return Bad("total_length", fixed.total_length, absl::StrCat(block.size()));
  }
  if (fixed.version >> 8 != kVersion >> 8) {
    return Bad("version", absl::StrCat(fixed.version >> 8, ".", fixed.version & 0xFF), "1.x");
  }
  if (fixed.slices < 1 || fixed.slices > kMostSlices) {
    return Bad("slices", fixed.slices, absl::StrCat("from 1 to ", kMostSlices));
  }
  if (fixed.width < 1 || fixed.width > kMostPixels) {
    return Bad("width", fixed.width, absl::StrCat("from 1 to ", kMostPixels));
  }
  if (fixed.height < 1 || fixed.height > kMostPixels) {
    return Bad("height", fixed.height, absl::StrCat("from 1 to ", kMostPixels));
  }
  if (fixed.max_sub_frames < 1 || fixed.max_sub_frames > 64) {
    return Bad("max_sub_frames", static_cast<int>(fixed.max_sub_frames), "from 1 to 64");
  }
  if (fixed.max_payload < kLeastPayload || fixed.max_payload > (1u << 24)) {
    return Bad("max_payload", fixed.max_payload, absl::StrCat("from ", kLeastPayload, " to 2^24"));
  }
  if (fixed.receive_buffer / 4 < fixed.max_payload + sizeof(PacketHeader)) {
    return Bad("receive_buffer", fixed.receive_buffer,
               "4 packets of max_payload and their headers, or more");
  }
  if (fixed.volume_buffers < 3) return Bad("volume_buffers", fixed.volume_buffers, "3 or more");
  if (fixed.formats == 0) return Bad("formats", 0, "a bit or more, one for each pixel format");
  if (fixed.nominal_rate_mhz < 1) return Bad("nominal_rate", fixed.nominal_rate_mhz, "above 0");
  if (fixed.nominal_rate_mhz < fixed.min_rate_mhz || fixed.nominal_rate_mhz > fixed.max_rate_mhz) {
    return Bad("nominal_rate", fixed.nominal_rate_mhz,
               absl::StrCat("from min_rate (", fixed.min_rate_mhz, ") to max_rate (",
                            fixed.max_rate_mhz, ")"));
  }
  if (fixed.keepalive_ms != kKeepaliveMs) {
    return Bad("keepalive_ms", fixed.keepalive_ms, absl::StrCat(kKeepaliveMs));
  }
  const bool watchdog = (fixed.features & kFeatureWatchdog) != 0;
  const int64_t watchdog_ms = watchdog ? kWatchdogMs : 0;
  if (fixed.watchdog_ms != watchdog_ms) {
    return Bad(
        "watchdog_ms", fixed.watchdog_ms,
        absl::StrCat(watchdog_ms, watchdog ? " with" : " without", " feature bit 0 (watchdog)"));
  }
  const std::span<const std::byte> shape = block.subspan(sizeof(Capabilities));
  absl::StatusOr<Geometry> geometry;
  switch (std::to_integer<uint8_t>(shape[0])) {
    case kShapePlanar:
      geometry = ParsePlanar(shape, fixed);
      break;
    case kShapeRotor:
      geometry = ParseRotor(shape, fixed);
      break;
    case kShapeHelix:
      geometry = ParseHelix(shape, fixed);
      break;
    case kShapeLattice:
      geometry = ParseLattice(shape, fixed);
      break;
    default:
      return Bad("shape", std::to_integer<int>(shape[0]),
                 "1 (planar stack), 2 (rotor), 3 (helix) or 4 (lattice)");
  }
  if (!geometry.ok()) return geometry.status();
  device.geometry = *std::move(geometry);
  return device;
}

namespace {

using Shape = decltype(Geometry::shape);

// Returns the shape without the properties that depend on how a display was assembled.
Shape AsBuilt(Shape shape) {
  if (auto* planar = std::get_if<PlanarStack>(&shape)) {
    planar->mirror_u = planar->mirror_v = false;
    std::sort(planar->positions_mm.begin(), planar->positions_mm.end());
  } else if (auto* rotor = std::get_if<Rotor>(&shape)) {
    rotor->clockwise = false;
    for (Rotor::Panel& panel : rotor->panels) {
      panel = {.pitch_u_mm = panel.pitch_u_mm, .pitch_v_mm = panel.pitch_v_mm};
    }
  } else if (auto* helix = std::get_if<Helix>(&shape)) {
    helix->clockwise = helix->left_handed = helix->mirror_u = helix->mirror_v = false;
    helix->phase_turns = 0;
  }
  return shape;
}

}  // namespace

absl::Status CheckCapabilities(const DeviceCapabilities& device, const Geometry& geometry,
                               const FrameLayout& layout, bool calibrated) {
  const Capabilities& fixed = device.fixed;
  FrameLayout theirs = layout;
  theirs.slices = static_cast<int32_t>(fixed.slices);
  theirs.width = static_cast<int32_t>(fixed.width);
  theirs.height = static_cast<int32_t>(fixed.height);
  if (theirs != layout || device.geometry.shape.index() != geometry.shape.index()) {
    return absl::FailedPreconditionError(
        absl::StrCat("the display is configured as ", Describe(geometry, layout),
                     ", but the device is ", Describe(device.geometry, theirs)));
  }
  const auto compared = [calibrated](const Geometry& g) {
    return calibrated ? AsBuilt(g.shape) : g.shape;
  };
  if (compared(device.geometry) != compared(geometry)) {
    return absl::FailedPreconditionError(
        absl::StrCat("the device is ", Describe(device.geometry, theirs),
                     " as configured, but its pitches, positions or panels differ"));
  }
  if ((fixed.formats >> static_cast<int>(layout.format) & 1) == 0) {
    return absl::FailedPreconditionError(
        absl::StrCat("the device does not take pixel format ", static_cast<int>(layout.format),
                     "; the formats that it takes are the bits of ", fixed.formats));
  }
  if (layout.sub_frames > fixed.max_sub_frames) {
    return absl::FailedPreconditionError(
        absl::StrCat(layout.sub_frames, " sub-frames are configured; the device takes 1 to ",
                     static_cast<int>(fixed.max_sub_frames)));
  }
  if (sizeof(BeginPayload) + (layout.pictures() + 7) / 8 > fixed.max_payload) {
    return absl::FailedPreconditionError(absl::StrCat("a bitmap of ", layout.pictures(),
                                                      " pictures is longer than the device's ",
                                                      fixed.max_payload, " bytes of payload"));
  }
  return absl::OkStatus();
}

}  // namespace voxeld::display::voxlink
