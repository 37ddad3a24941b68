#include "gpu/worker/target_codec.h"

#include <cstdint>
#include <cstring>
#include <optional>
#include <type_traits>
#include <utility>
#include <variant>

#include "absl/status/status.h"

namespace voxeld::gpu {
namespace {

class Writer {
 public:
  template <typename T>
  void Value(const T& value) {
    static_assert(std::is_arithmetic_v<T> || std::is_enum_v<T>);
    const auto* from = reinterpret_cast<const std::byte*>(&value);
    out.insert(out.end(), from, from + sizeof(T));
  }
  template <typename Items, typename F>
  void List(const Items& items, F&& each) {
    Value<uint64_t>(items.size());
    for (const auto& item : items) each(item);
  }
  template <typename Item, typename F>
  void Optional(const std::optional<Item>& item, F&& each) {
    Value<uint8_t>(item.has_value() ? 1 : 0);
    if (item.has_value()) each(*item);
  }
  std::vector<std::byte> out;
};

class Reader {
 public:
  explicit Reader(std::span<const std::byte> in) : in_(in) {}
  template <typename T>
  void Value(T& value) {
    if (in_.size() < sizeof(T)) {
      ok_ = false;
      return;
    }
    if (std::is_same_v<T, bool> && in_.front() > std::byte{1}) {
      ok_ = false;  // a bool has no other values
      return;
    }
    std::memcpy(&value, in_.data(), sizeof(T));
    in_ = in_.subspan(sizeof(T));
  }
  template <typename Items, typename F>
  void List(Items& items, F&& each) {
    uint64_t count = 0;
    Value(count);
    if (count > in_.size()) ok_ = false;  // an item takes at least a byte
    for (uint64_t i = 0; i < count && ok_; ++i) each(items.emplace_back());
  }
  template <typename Item, typename F>
  void Optional(std::optional<Item>& item, F&& each) {
    uint8_t has = 0;
    Value(has);
    if (has > 1) ok_ = false;
    if (has == 1) each(item.emplace());
  }
  bool ok() const { return ok_; }
  bool done() const { return ok_ && in_.empty(); }

 private:
  std::span<const std::byte> in_;
  bool ok_ = true;
};

// One list of fields for both encoding and decoding.
template <typename Io, typename V>
void Fields(Io& io, V& v)
  requires std::is_same_v<std::remove_const_t<V>, display::Vec3>
{
  io.Value(v.x), io.Value(v.y), io.Value(v.z);
}

template <typename Io, typename S>
void Fields(Io& io, S& s)
  requires std::is_same_v<std::remove_const_t<S>, display::PlanarStack>
{
  io.Value(s.normal), io.Value(s.width_px), io.Value(s.height_px);
  io.Value(s.pitch_u_mm), io.Value(s.pitch_v_mm);
  io.List(s.positions_mm, [&](auto& position) { io.Value(position); });
  io.Value(s.strokes);
  io.Value(s.thickness_mm), io.Value(s.mirror_u), io.Value(s.mirror_v);
}

template <typename Io, typename R>
void Fields(Io& io, R& r)
  requires std::is_same_v<std::remove_const_t<R>, display::Rotor>
{
  io.Value(r.slices_per_turn), io.Value(r.width_px), io.Value(r.height_px), io.Value(r.clockwise);
  io.List(r.panels, [&](auto& p) {
    io.Value(p.pitch_u_mm), io.Value(p.pitch_v_mm), io.Value(p.eccentricity_mm);
    io.Value(p.shift_u_mm), io.Value(p.shift_v_mm), io.Value(p.tilt_deg);
    io.Value(p.phase_turns);
    io.Value(p.mirror_u), io.Value(p.mirror_v);
  });
}

template <typename Io, typename H>
void Fields(Io& io, H& h)
  requires std::is_same_v<std::remove_const_t<H>, display::Helix>
{
  io.Value(h.slices_per_turn), io.Value(h.width_px), io.Value(h.height_px);
  io.Value(h.pitch_u_mm), io.Value(h.pitch_v_mm), io.Value(h.blades), io.Value(h.span_turns);
  io.Value(h.height_mm), io.Value(h.hub_mm), io.Value(h.radius_mm), io.Value(h.phase_turns);
  io.Value(h.left_handed), io.Value(h.clockwise), io.Value(h.mirror_u), io.Value(h.mirror_v);
}

template <typename Io, typename C>
void Fields(Io& io, C& c)
  requires std::is_same_v<std::remove_const_t<C>, display::Correction>
{
  for (auto& a : c.affine) io.Value(a);
  io.Optional(c.displacement, [&](auto& d) {
    io.Value(d.nx), io.Value(d.ny), io.Value(d.nz);
    Fields(io, d.low_mm);
    Fields(io, d.high_mm);
    io.List(d.at_mm, [&](auto& at) { Fields(io, at); });
  });
  io.List(c.homographies, [&](auto& h) {
    for (auto& m : h) io.Value(m);
  });
}

template <typename Io, typename L>
void Fields(Io& io, L& l)
  requires std::is_same_v<std::remove_const_t<L>, display::Lattice>
{
  io.Value(l.width_px), io.Value(l.height_px);
  io.List(l.points_mm,
          [&](auto& light) { io.Optional(light, [&](auto& point) { Fields(io, point); }); });
  Fields(io, l.cell_mm);
}

// Encodes or decodes everything except the shape.
template <typename Io, typename T>
void Fields(Io& io, T& t)
  requires std::is_same_v<std::remove_const_t<T>, Target>
{
  auto& grid = t.geometry.grid;
  io.Value(grid.nx), io.Value(grid.ny), io.Value(grid.nz);
  Fields(io, grid.pitch_mm);
  Fields(io, grid.origin_mm);
  io.Optional(t.geometry.correction, [&](auto& correction) { Fields(io, correction); });
  auto& layout = t.layout;
  io.Value(layout.slices), io.Value(layout.width), io.Value(layout.height);
  io.Value(layout.sub_frames), io.Value(layout.format), io.Value(layout.bits);
  for (auto& curve : t.tone.lut) {
    for (auto& light : curve) io.Value(light);
  }
  io.Value(t.tone.dither), io.Value(t.tone.sampling), io.Value(t.tone.density);
  for (auto& m : t.view.m) io.Value(m);
}

}  // namespace

std::vector<std::byte> EncodeTarget(const Target& target) {
  Writer writer;
  writer.Value<uint64_t>(target.geometry.shape.index());
  std::visit([&](const auto& shape) { Fields(writer, shape); }, target.geometry.shape);
  Fields(writer, target);
  return std::move(writer.out);
}

absl::StatusOr<Target> DecodeTarget(std::span<const std::byte> bytes) {
  Reader reader(bytes);
  Target target;
  uint64_t shape = 0;
  reader.Value(shape);
  if (shape == 3) {
    Fields(reader, target.geometry.shape.emplace<display::Helix>());
  } else if (shape == 2) {
    Fields(reader, target.geometry.shape.emplace<display::Lattice>());
  } else if (shape == 1) {
    Fields(reader, target.geometry.shape.emplace<display::Rotor>());
  } else if (shape == 0) {
    Fields(reader, target.geometry.shape.emplace<display::PlanarStack>());
  } else {
    return absl::InvalidArgumentError("a target of an unknown shape");
  }
  Fields(reader, target);
  if (!reader.done()) return absl::InvalidArgumentError("a target of the wrong length");
  return target;
}

}  // namespace voxeld::gpu
