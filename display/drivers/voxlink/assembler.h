// Assembles a volume from the packets that carry it (docs/protocols/voxlink.md §5.2 to §5.4). The
// device model and the decoder both use it; they differ in how they handle what it refuses.
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

  // Starts a volume on `base`, the volume that BEGIN named (null for 0), and discards what was
  // being filled. If the packet does not fit the layout, it returns kBadLength or kBadBegin and
  // fills nothing.
  ErrorCode Begin(const PacketHeader& header, std::span<const std::byte> payload, VolumePtr base);

  // Adds a fragment of a slice image. Fragments of one image must come in order; one at offset 0
  // starts it again.
  ErrorCode Slice(const PacketHeader& header, std::span<const std::byte> payload);

  bool filling() const { return number_ != 0; }
  uint64_t number() const { return number_; }  // 0: none

  // Returns runs of announced images that are not complete, ascending.
  std::vector<PictureRun> Missing() const;

  // Returns the volume if nothing is missing; null otherwise. Filling can continue: images that
  // come again replace the former ones.
  VolumePtr Finish() const;

  void Clear();

 private:
  const FrameLayout layout_;
  uint64_t number_ = 0;
  VolumePtr base_;
  std::vector<bool> announced_;
  std::vector<std::shared_ptr<std::vector<std::byte>>> pictures_;  // as received so far
};

}  // namespace voxeld::display::voxlink
