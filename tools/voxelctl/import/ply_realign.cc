#include "tools/voxelctl/import/ply_realign.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"

namespace voxeld::voxelctl {
namespace {

// If more bytes than this are lost within one vertex, the shift cannot be determined.
constexpr size_t kMostLost = 5;
// The number of consecutive valid vertices that confirm a position.
constexpr size_t kWitnesses = 4;

// Fixed-size entries with a position and a normal in f32.
struct Entries {
  size_t size = 0;
  size_t position[3] = {};
  size_t normal[3] = {};
  bool big_endian = false;

  double Float(absl::string_view bytes, size_t at) const {
    uint32_t word = 0;
    for (size_t i = 0; i < 4; ++i) {
      const size_t shift = 8 * (big_endian ? 3 - i : i);
      word |= static_cast<uint32_t>(static_cast<uint8_t>(bytes[at + i])) << shift;
    }
    return std::bit_cast<float>(word);
  }

  bool InPlace(absl::string_view bytes) const {
    if (bytes.size() < size) return false;
    double square = 0;
    for (const size_t at : normal) {
      const double n = Float(bytes, at);
      square += n * n;
    }
    return std::abs(square - 1) < 0.02;  // false for NaN
  }

  // Returns how many entries from `at` on are in place; the exact end of the data counts as one.
  size_t Witnesses(absl::string_view body, size_t at) const {
    size_t found = 0;
    for (size_t i = 0; i < kWitnesses && at <= body.size(); ++i, at += size) {
      found += at == body.size() || InPlace(body.substr(at)) ? 1 : 0;
    }
    return found;
  }

  // Restores one lost byte: inserts a CR before one of the LFs such that the normal gets unit
  // length.
  std::optional<std::string> Mend(absl::string_view damaged) const {
    for (size_t lf = damaged.find('\n'); lf != absl::string_view::npos;
         lf = damaged.find('\n', lf + 1)) {
      std::string entry(damaged);
      entry.insert(lf, 1, '\r');
      if (InPlace(entry)) return entry;
    }
    return std::nullopt;
  }
};

// The box of the certain positions.
struct Reach {
  double low[3] = {1e300, 1e300, 1e300}, high[3] = {-1e300, -1e300, -1e300};

  void Add(const Entries& entries, absl::string_view entry) {
    for (size_t a = 0; a < 3; ++a) {
      const double p = entries.Float(entry, entries.position[a]);
      low[a] = std::min(low[a], p);
      high[a] = std::max(high[a], p);
    }
  }
  bool Holds(const Entries& entries, absl::string_view entry) const {
    for (size_t a = 0; a < 3; ++a) {
      const double p = entries.Float(entry, entries.position[a]);
      if (!(p >= low[a] && p <= high[a])) return false;
    }
    return true;
  }
};

std::optional<Entries> LayoutOf(const PlyHeader& header) {
  if (header.format == PlyHeader::Format::kAscii || header.elements.size() != 1)
    return std::nullopt;
  Entries entries;
  entries.big_endian = header.format == PlyHeader::Format::kBinaryBigEndian;
  bool found[6] = {};
  for (const PlyProperty& property : header.elements[0].properties) {
    if (property.is_list) return std::nullopt;
    constexpr absl::string_view kNames[6] = {"x", "y", "z", "nx", "ny", "nz"};
    for (size_t slot = 0; slot < 6; ++slot) {
      if (property.name != kNames[slot] || property.type != PlyType::kF32) continue;
      (slot < 3 ? entries.position[slot] : entries.normal[slot - 3]) = entries.size;
      found[slot] = true;
    }
    entries.size += PlySize(property.type);
  }
  if (std::find(found, found + 6, false) != found + 6 || entries.size <= kMostLost) {
    return std::nullopt;
  }
  return entries;
}

}  // namespace

std::optional<RealignedPly> RealignPly(const SourceFile& file, const PlyHeader& header) {
  const std::optional<Entries> entries = LayoutOf(header);
  if (!entries || TextModeHint(file.bytes).empty()) return std::nullopt;
  const absl::string_view body = absl::string_view(file.bytes).substr(header.body);
  const uint64_t count = header.elements[0].count;
  if (body.size() / (entries->size - kMostLost) < count) return std::nullopt;

  RealignedPly result;
  result.file.path = file.path;
  result.file.extension = file.extension;
  std::string& out = result.file.bytes;
  out.reserve(header.body + count * entries->size);
  out.assign(file.bytes, 0, header.body);
  Reach reach;
  std::vector<uint64_t> doubtful;
  size_t at = 0;
  for (uint64_t i = 0; i < count; ++i) {
    if (at >= body.size()) return std::nullopt;
    if (entries->InPlace(body.substr(at)) &&
        entries->Witnesses(body, at) == std::min<uint64_t>(kWitnesses, count - i + 1)) {
      const absl::string_view entry = body.substr(at, entries->size);
      reach.Add(*entries, entry);
      out.append(entry.data(), entry.size());
      at += entries->size;
      continue;
    }
    size_t lost = 0, agreeing = 0;
    for (size_t candidate = 0; candidate <= kMostLost; ++candidate) {
      const size_t found = entries->Witnesses(body, at + entries->size - candidate);
      if (found > agreeing) agreeing = found, lost = candidate;
    }
    const absl::string_view damaged = body.substr(at, entries->size - lost);
    std::string entry(damaged);
    if (lost == 1) entry = entries->Mend(damaged).value_or(entry);
    entry.resize(entries->size);
    out.append(entry);
    doubtful.push_back(i);
    result.lost_bytes += lost;
    at += entries->size - lost;
  }
  if (at != body.size()) return std::nullopt;
  for (const uint64_t i : doubtful) {
    const size_t place = header.body + i * entries->size;
    if (reach.Holds(*entries, absl::string_view(out).substr(place, entries->size))) continue;
    if (i == 0) return std::nullopt;
    out.replace(place, entries->size, out, place - entries->size, entries->size);
    ++result.lost_entries;
  }
  return result;
}

}  // namespace voxeld::voxelctl
