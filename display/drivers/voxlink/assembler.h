// Puts a volume together from the packets that carry it (docs/protocols/voxlink.md §5.2 to §5.4).
// The device model and the decoder both stand on it;
// they differ in what they do with what it refuses.
//
// Single-threaded.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "display/api/slice_frame.h"
#include "display/drivers/voxlink/protocol.h"

namespace voxeld::display::voxlink {

struct Volume {
  uint64_t number = 0;
  std::vector<Picture> pictures;  // layout.pictures()
};
using VolumePtr = std::shared_ptr<const Volume>;

class VolumeAssembler {
 public:
  explicit VolumeAssembler(const FrameLayout& layout) : layout_(layout) {}

  // Starts a volume on `base`, the volume that BEGIN named (null for 0); what was being filled is
  // gone. Refuses (kBadLength, kBadBegin) what does not fit the layout, and then fills nothing.
  ErrorCode Begin(const PacketHeader& header, std::span<const std::byte> payload, VolumePtr base);

  // A fragment of a picture. Fragments of one picture come in order;
  // one at offset 0 begins it again.
  ErrorCode Slice(const PacketHeader& header, std::span<const std::byte> payload);

  bool filling() const { return number_ != 0; }
  uint64_t number() const { return number_; }  // 0: none

  // Runs of announced pictures that are not whole, ascending.
  std::vector<PictureRun> Missing() const;

  // The volume, if nothing is missing; null otherwise. It goes on filling:
  // pictures that come again replace theirs.
  VolumePtr Finish() const;

  void Clear();

 private:
  const FrameLayout layout_;
  uint64_t number_ = 0;
  VolumePtr base_;
  std::vector<bool> announced_;
  std::vector<std::shared_ptr<std::vector<std::byte>>> pictures_;  // as far as they have come
};

}  // namespace voxeld::display::voxlink
