#include "display/drivers/voxlink/assembler.h"

#include <utility>

namespace voxeld::display::voxlink {

ErrorCode VolumeAssembler::Begin(const PacketHeader& header, std::span<const std::byte> payload,
                                 VolumePtr base) {
  Clear();
  if (payload.size() < sizeof(BeginPayload)) return ErrorCode::kBadLength;
  const auto begin = Load<BeginPayload>(payload);
  const std::span<const std::byte> bitmap = payload.subspan(sizeof(BeginPayload));
  const size_t pictures = layout_.pictures();
  if (header.volume == 0 || begin.pictures != pictures) return ErrorCode::kBadBegin;
  if (begin.base != (base == nullptr ? 0 : base->number)) return ErrorCode::kBadBegin;
  if (bitmap.size() != (base == nullptr ? 0 : (pictures + 7) / 8)) return ErrorCode::kBadLength;
  announced_.assign(pictures, true);
  if (base != nullptr) {
    for (size_t p = 0; p < bitmap.size() * 8; ++p) {
      const bool set = (std::to_integer<int>(bitmap[p / 8]) >> (p % 8) & 1) != 0;
      if (p < pictures) {
        announced_[p] = set;
      } else if (set) {
        return ErrorCode::kBadBegin;  // padding
      }
    }
  }
  pictures_.assign(pictures, nullptr);
  base_ = std::move(base);
  number_ = header.volume;
  return ErrorCode::kNone;
}

ErrorCode VolumeAssembler::Slice(const PacketHeader& header, std::span<const std::byte> payload) {
  if (number_ == 0 || header.volume != number_) return ErrorCode::kNotFilling;
  const size_t subs = static_cast<size_t>(layout_.sub_frames);
  const size_t size = layout_.bytes_per_slice();
  if (header.slice >= static_cast<uint32_t>(layout_.slices) || header.sub_frame >= subs ||
      payload.empty() || header.offset >= size || payload.size() > size - header.offset) {
    return ErrorCode::kBadPicture;
  }
  const size_t index = header.slice * subs + header.sub_frame;
  if (!announced_[index]) return ErrorCode::kNotInBitmap;
  auto& picture = pictures_[index];
  if (header.offset == 0) {
    picture = std::make_shared<std::vector<std::byte>>();
    picture->reserve(size);
  } else if (picture == nullptr || picture->size() != header.offset) {
    picture = nullptr;
    return ErrorCode::kBadOrder;
  }
  picture->insert(picture->end(), payload.begin(), payload.end());
  return ErrorCode::kNone;
}

std::vector<PictureRun> VolumeAssembler::Missing() const {
  std::vector<PictureRun> runs;
  const size_t size = layout_.bytes_per_slice();
  for (size_t p = 0; p < pictures_.size(); ++p) {
    if (!announced_[p] || (pictures_[p] != nullptr && pictures_[p]->size() == size)) continue;
    if (!runs.empty() && runs.back().first + runs.back().count == p) {
      ++runs.back().count;
    } else {
      runs.push_back({static_cast<uint32_t>(p), 1});
    }
  }
  return runs;
}

VolumePtr VolumeAssembler::Finish() const {
  if (number_ == 0 || !Missing().empty()) return nullptr;
  auto volume = std::make_shared<Volume>();
  volume->number = number_;
  volume->pictures.resize(pictures_.size());
  for (size_t p = 0; p < pictures_.size(); ++p) {
    volume->pictures[p] = announced_[p] ? Picture(pictures_[p]) : base_->pictures[p];
  }
  return volume;
}

void VolumeAssembler::Clear() {
  number_ = 0;
  base_ = nullptr;
  announced_.clear();
  pictures_.clear();
}

}  // namespace voxeld::display::voxlink
