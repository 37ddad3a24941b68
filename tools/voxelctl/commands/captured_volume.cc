#include "tools/voxelctl/commands/captured_volume.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "display/geometry/limits.h"
#include "tools/voxelctl/render/render_volume.h"

namespace voxeld::voxelctl {
namespace {

display::Vec3 FromWire(const v1::Vec3& in) { return {in.x(), in.y(), in.z()}; }

display::PlanarStack FromWire(const v1::PlanarStack& in) {
  display::PlanarStack out;
  out.normal = in.normal() == v1::PlanarStack::Y ? display::PlanarStack::Normal::kY
                                                 : display::PlanarStack::Normal::kZ;
  out.width_px = in.width_px();
  out.height_px = in.height_px();
  out.pitch_u_mm = in.pitch_u_mm();
  out.pitch_v_mm = in.pitch_v_mm();
  out.positions_mm.assign(in.positions_mm().begin(), in.positions_mm().end());
  out.thickness_mm = in.thickness_mm();
  out.mirror_u = in.mirror_u();
  out.mirror_v = in.mirror_v();
  return out;
}

display::Rotor FromWire(const v1::Rotor& in) {
  display::Rotor out;
  out.slices_per_turn = in.slices_per_turn();
  out.width_px = in.width_px();
  out.height_px = in.height_px();
  out.clockwise = in.clockwise();
  for (const v1::Rotor::Panel& panel : in.panels()) {
    out.panels.push_back({panel.pitch_u_mm(), panel.pitch_v_mm(), panel.eccentricity_mm(),
                          panel.shift_u_mm(), panel.shift_v_mm(), panel.phase_turns(),
                          panel.mirror_u(), panel.mirror_v()});
  }
  return out;
}

// Looks at sizes before it takes memory: a short message may name many pixels without a light.
absl::StatusOr<display::Lattice> FromWire(const v1::Lattice& in) {
  const int64_t pixels = int64_t{in.slices()} * in.width_px();
  const int lights = in.pixels_size();
  if (in.width_px() < 1 || in.slices() < 1 || pixels > display::kMaxLatticePixels) {
    return absl::InvalidArgumentError(
        absl::StrCat("the server sent a lattice of ", in.slices(), " slices of ", in.width_px(),
                     " pixels; at most ", display::kMaxLatticePixels, " together are taken"));
  }
  if (in.x_mm_size() != lights || in.y_mm_size() != lights || in.z_mm_size() != lights) {
    return absl::InvalidArgumentError(absl::StrCat(
        "the server sent a lattice of ", lights, " lights with ", in.x_mm_size(), ", ",
        in.y_mm_size(), " and ", in.z_mm_size(), " coordinates; each has one along x, y and z"));
  }
  display::Lattice out;
  out.width_px = in.width_px();
  out.cell_mm = FromWire(in.cell_mm());
  out.points_mm.resize(static_cast<size_t>(pixels));
  for (int n = 0; n < lights; ++n) {
    if (in.pixels(n) >= pixels) {
      return absl::InvalidArgumentError(absl::StrCat(
          "the server sent a lattice of ", pixels, " pixels with a light in pixel ", in.pixels(n)));
    }
    out.points_mm[in.pixels(n)] = {in.x_mm(n), in.y_mm(n), in.z_mm(n)};
  }
  return out;
}

}  // namespace

absl::StatusOr<display::Geometry> GeometryFromWire(const v1::Geometry& in) {
  display::Geometry out;
  switch (in.shape_case()) {
    case v1::Geometry::kPlanarStack:
      out.shape = FromWire(in.planar_stack());
      break;
    case v1::Geometry::kRotor:
      out.shape = FromWire(in.rotor());
      break;
    case v1::Geometry::kLattice: {
      absl::StatusOr<display::Lattice> lattice = FromWire(in.lattice());
      if (!lattice.ok()) return lattice.status();
      out.shape = *std::move(lattice);
      break;
    }
    case v1::Geometry::SHAPE_NOT_SET:
      return absl::InvalidArgumentError(
          "the display's geometry is of a kind that this voxelctl does not know");
  }
  out.grid = {in.grid().nx(), in.grid().ny(), in.grid().nz(), FromWire(in.grid().pitch_mm()),
              FromWire(in.grid().origin_mm())};
  return out;
}

absl::Status CapturedVolume::Begin(const v1::VolumeHeader& header) {
  if (begun_) return absl::InvalidArgumentError("the server sent two volumes");
  absl::StatusOr<display::Geometry> geometry = GeometryFromWire(header.geometry());
  if (!geometry.ok()) return geometry.status();
  const v1::FrameLayout& layout = header.layout();
  // Each is at most 2¹⁴ by the displays' own limits, with room for panels;
  // the product fits 64 bits.
  for (const int32_t extent : {layout.slices(), layout.width(), layout.height()}) {
    if (extent < 1 || extent > 1 << 20) {
      return absl::InvalidArgumentError(absl::StrCat("the server sent a volume of ",
                                                     layout.slices(), " slices of ", layout.width(),
                                                     "x", layout.height()));
    }
  }
  const uint64_t bytes = static_cast<uint64_t>(layout.slices()) *
                         static_cast<uint64_t>(layout.width()) *
                         static_cast<uint64_t>(layout.height()) * 3;
  if (bytes > kMostBytes)
    return absl::InvalidArgumentError(
        absl::StrCat("the volume has ", bytes, " bytes; at most ", kMostBytes, " are taken"));
  begun_ = true;
  header_ = header;
  volume_.display = header.display();
  volume_.number = header.volume();
  volume_.geometry = *std::move(geometry);
  volume_.slices = layout.slices();
  volume_.width = layout.width();
  volume_.height = layout.height();
  volume_.rgb.resize(bytes);
  come_.assign(static_cast<size_t>(layout.slices()), false);
  return absl::OkStatus();
}

absl::Status CapturedVolume::Add(const v1::VolumeChunk& chunk) {
  if (chunk.has_header()) return Begin(chunk.header());
  if (!chunk.has_slices()) return absl::OkStatus();
  if (!begun_)
    return absl::InvalidArgumentError("the server sent slices before the volume's header");
  const std::string& rgb = chunk.slices().rgb();
  const size_t each = volume_.slice_bytes();
  const int64_t first = chunk.slices().first_slice();
  const auto count = static_cast<int64_t>(rgb.size() / each);
  if (rgb.size() % each != 0 || first < 0 || first + count > volume_.slices) {
    return absl::InvalidArgumentError(
        absl::StrCat("the server sent ", rgb.size(), " bytes from slice ", first,
                     " on; the volume has ", volume_.slices, " slices of ", each));
  }
  std::memcpy(volume_.rgb.data() + static_cast<size_t>(first) * each, rgb.data(), rgb.size());
  std::fill_n(come_.begin() + first, count, true);
  return absl::OkStatus();
}

absl::StatusOr<Volume> CapturedVolume::Finish() && {
  if (!begun_) return absl::InvalidArgumentError("the server sent no volume");
  const auto missing = std::count(come_.begin(), come_.end(), false);
  if (missing > 0) {
    return absl::DataLossError(
        absl::StrCat(missing, " of the volume's ", volume_.slices, " slices did not come"));
  }
  const absl::Status status = CheckVolume(volume_);
  if (!status.ok()) return status;
  return std::move(volume_);
}

}  // namespace voxeld::voxelctl
