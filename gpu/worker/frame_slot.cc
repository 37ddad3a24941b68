#include "gpu/worker/frame_slot.h"

#include <algorithm>
#include <cstring>
#include <thread>
#include <vector>

#if defined(__x86_64__)
#include <emmintrin.h>
#endif

#include "display/crc/crc32c.h"

namespace voxeld::gpu {
namespace {

// The amount of work that one thread takes at a time, so that the others have work too.
constexpr size_t kGrainBytes = size_t{256} << 10;

constexpr size_t kWorthThreads = size_t{16} << 20;
constexpr unsigned kMostThreads = 8;  // about as many as saturate a host's memory

// A piece is read, checked and written before it leaves the nearest cache.
constexpr size_t kPieceBytes = size_t{16} << 10;

// Copies past the caches, because far more is written than they hold.
void CopyPast(std::byte* to, const std::byte* from, size_t size) {
#if defined(__x86_64__)
  const size_t head = std::min(size, -reinterpret_cast<uintptr_t>(to) % sizeof(__m128i));
  std::memcpy(to, from, head);
  size_t at = head;
  for (; at + sizeof(__m128i) <= size; at += sizeof(__m128i)) {
    _mm_stream_si128(reinterpret_cast<__m128i*>(to + at),
                     _mm_loadu_si128(reinterpret_cast<const __m128i*>(from + at)));
  }
  std::memcpy(to + at, from + at, size - at);
  _mm_sfence();
#else
  std::memcpy(to, from, size);
#endif
}

uint32_t Look(const display::FrameLayout& layout, const FrameBuffer& from, uint64_t from_holds,
              PictureRange pictures, const FrameBuffer* to, uint64_t to_holds, Executor& executor) {
  const size_t size = layout.bytes_per_slice();
  const size_t count = pictures.end - pictures.begin;
  const bool large = count * size >= kWorthThreads;
  std::vector<uint32_t> crcs(count, 0);
  executor.For(count, kGrainBytes / (size + 1) + 1, [&](size_t i, int) {
    const size_t p = pictures.begin + i;
    const bool counts = from.changed_in[p] > from_holds;
    const bool copied = to != nullptr && from.changed_in[p] > to_holds;
    if (to != nullptr) to->changed_in[p] = from.changed_in[p];
    for (size_t at = p * size; (counts || copied) && at < (p + 1) * size; at += kPieceBytes) {
      const std::span<const std::byte> piece =
          from.bytes.subspan(at, std::min(kPieceBytes, (p + 1) * size - at));
      if (counts) crcs[i] = display::Crc32c(piece, crcs[i]);
      if (!copied) continue;
      if (large) {
        CopyPast(to->bytes.data() + at, piece.data(), piece.size());
      } else {
        std::memcpy(to->bytes.data() + at, piece.data(), piece.size());
      }
    }
  });
  const uint32_t numbers =
      display::Crc32c(std::as_bytes(from.changed_in.subspan(pictures.begin, count)));
  return display::Crc32c(std::as_bytes(std::span(crcs)), numbers);
}

}  // namespace

FrameBuffer FrameSlot::In(std::span<std::byte> segment) const {
  return {segment.subspan(pictures * sizeof(uint64_t), bytes),
          {reinterpret_cast<uint64_t*>(segment.data()), pictures}};
}

PictureRange PictureRange::Of(const display::FrameLayout& layout, SliceRange slices) {
  const size_t subs = static_cast<size_t>(layout.sub_frames);
  return {static_cast<size_t>(slices.begin) * subs, static_cast<size_t>(slices.end) * subs};
}

std::span<std::byte> BytesOf(const display::FrameLayout& layout, const FrameBuffer& buffer,
                             PictureRange pictures) {
  const size_t size = layout.bytes_per_slice();
  return buffer.bytes.subspan(pictures.begin * size, (pictures.end - pictures.begin) * size);
}

std::unique_ptr<Executor> MakeFrameExecutor(size_t bytes) {
  if (bytes < kWorthThreads) return MakeSerialExecutor();
  return MakeExecutor(
      static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1u, kMostThreads)));
}

uint32_t FrameCrc(const display::FrameLayout& layout, const FrameBuffer& buffer,
                  PictureRange pictures, uint64_t holds, Executor& executor) {
  return Look(layout, buffer, holds, pictures, nullptr, 0, executor);
}

uint32_t CopyFrame(const display::FrameLayout& layout, const FrameBuffer& from, uint64_t from_holds,
                   PictureRange pictures, const FrameBuffer& to, uint64_t to_holds,
                   Executor& executor) {
  return Look(layout, from, from_holds, pictures, &to, to_holds, executor);
}

}  // namespace voxeld::gpu
