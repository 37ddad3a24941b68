#include "gpu/implicit/program_check.h"

#include <cstdlib>
#include <cstring>
#include <string>

#include "absl/strings/str_cat.h"
#include "gpu/implicit/program.h"

namespace voxeld::gpu::implicit {
namespace {

absl::Status Wrong(const absl::AlphaNum& what, const absl::AlphaNum& value,
                   const absl::AlphaNum& right) {
  return absl::InvalidArgumentError(
      absl::StrCat("program: ", what, " is ", value, ", must be ", right));
}

absl::Status CheckCode(const char* what, const uint32_t* code, uint32_t count,
                       std::span<const uint32_t> results) {
  bool written[kMostSlots] = {};
  for (uint32_t i = 0; i < count; ++i) {
    const Instruction in{code[2 * i], code[2 * i + 1]};
    const std::string at = absl::StrCat(what, ", instruction ", i, ": ");
    if ((in.word & 0xFF) >= kOps || in.op() == Op::kHoisted)
      return Wrong(
          at + "op", in.word & 0xFF,
          absl::StrCat("0 to ", kOps - 1, ", but not ", static_cast<uint32_t>(Op::kHoisted)));
    if (in.to() >= kMostSlots)
      return Wrong(at + "slot", in.to(), absl::StrCat("0 to ", kMostSlots - 1));
    if (in.a() >= kMostSlots)
      return Wrong(at + "slot", in.a(), absl::StrCat("0 to ", kMostSlots - 1));
    if (in.b() >= kMostSlots)
      return Wrong(at + "slot", in.b(), absl::StrCat("0 to ", kMostSlots - 1));
    if (!IsLeaf(in.op())) {
      for (const uint32_t slot : {in.a(), in.b()}) {
        if (!written[slot]) return Wrong(at + "slot read", slot, "one that has been written");
        if (slot == in.to()) return Wrong(at + "slot written", slot, "none that is read");
      }
    }
    if (in.op() == Op::kPowI &&
        std::abs(int64_t{static_cast<int32_t>(in.immediate)}) > kMostExponent) {
      return Wrong(at + "exponent", static_cast<int32_t>(in.immediate),
                   absl::StrCat("within ±", kMostExponent));
    }
    written[in.to()] = true;
  }
  for (const uint32_t slot : results) {
    if (slot >= kMostSlots || !written[slot]) {
      return Wrong(absl::StrCat(what, ", slot of the result"), slot, "one that has been written");
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckProgram(std::span<const uint32_t> words, uint32_t positions) {
  if (words.size() < kHeaderWords) {
    return Wrong("size", words.size(), absl::StrCat(kHeaderWords, " words at least"));
  }
  ProgramHeader h;
  std::memcpy(static_cast<void*>(&h), words.data(), sizeof(h));
  if (h.surface == 0 || h.surface > kMostInstructions) {
    return Wrong("surface", h.surface, absl::StrCat("1 to ", kMostInstructions));
  }
  if (h.bound > kMostInstructions)
    return Wrong("bound", h.bound, absl::StrCat("at most ", kMostInstructions));
  if (h.color > kMostInstructions)
    return Wrong("color", h.color, absl::StrCat("at most ", kMostInstructions));
  const auto by = static_cast<uint32_t>(h.color_by);
  if (by > 2 || (by == 0) != (h.color == 0)) {
    return Wrong("color_by", by, "0 without a colour's instructions, 1 or 2 with them");
  }
  if (h.ring_axis > 2) return Wrong("ring_axis", h.ring_axis, "0 to 2");
  const uint64_t size = uint64_t{kHeaderWords} + 2 * (uint64_t{h.surface} + h.bound + h.color) +
                        h.rings + (by == 2 ? kTableColors : 0);
  if (words.size() != size) return Wrong("size", words.size(), absl::StrCat(size, " words"));
  const ProgramView view{words.data()};
  absl::Status status = CheckCode("surface", view.surface_code(), h.surface, {&h.surface_slot, 1});
  if (status.ok() && h.bound > 0) {
    status = CheckCode("bound", view.bound_code(), h.bound, {&h.bound_slot, 1});
  }
  if (status.ok() && h.color > 0) {
    status = CheckCode("color", view.color_code(), h.color, {h.color_slots, by == 1 ? 3u : 1u});
  }
  if (!status.ok()) return status;
  uint32_t end = 0;
  for (uint32_t r = 0; r < h.rings; ++r) {
    if (view.ring_ends()[r] < end)
      return Wrong("ring end", view.ring_ends()[r], "no less than that before");
    end = view.ring_ends()[r];
  }
  if (end != positions)
    return Wrong("last ring end", end, absl::StrCat(positions, ", as there are positions"));
  return absl::OkStatus();
}

}  // namespace voxeld::gpu::implicit
