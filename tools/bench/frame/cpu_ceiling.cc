#include <algorithm>
#include <cstring>
#include <vector>

#include "absl/strings/str_cat.h"
#include "gpu/cpu/executor.h"
#include "tools/bench/frame/ceiling.h"
#include "tools/bench/frame/plain_lines.h"

namespace voxeld::bench::frame {
namespace {

constexpr size_t kPiece = size_t{1} << 18;

class Copy final : public Ceiling {
 public:
  Copy(size_t bytes, int threads)
      : from_(bytes, 1), to_(bytes), executor_(gpu::MakeExecutor(threads)), threads_(threads) {}
  std::string name() const override {
    return absl::StrCat("memcpy of ", from_.size(), " bytes, ", threads_,
                        threads_ == 1 ? " thread" : " threads");
  }
  absl::Status Run() override {
    const size_t pieces = (from_.size() + kPiece - 1) / kPiece;
    executor_->For(pieces, 1, [&](size_t i, int) {
      const size_t at = i * kPiece;
      std::memcpy(to_.data() + at, from_.data() + at, std::min(kPiece, from_.size() - at));
    });
    return absl::OkStatus();
  }

 private:
  std::vector<char> from_, to_;
  const std::unique_ptr<gpu::Executor> executor_;
  const int threads_;
};

class PlainLines final : public Ceiling {
 public:
  PlainLines(const Scene& scene, int threads)
      : content_(scene.contents[0]),
        nx_(scene.target.geometry.grid.nx),
        ny_(scene.target.geometry.grid.ny),
        room_(PlainLinesRoom(static_cast<size_t>(nx_), static_cast<size_t>(ny_))),
        volume_(room_ + static_cast<size_t>(nx_) * static_cast<size_t>(ny_) *
                            static_cast<size_t>(scene.target.geometry.grid.nz)),
        executor_(gpu::MakeExecutor(threads)),
        threads_(threads) {}
  std::string name() const override { return "plain loop, floor(x + 0.5), -march=native"; }
  absl::Status Run() override {
    const auto parts = static_cast<size_t>(threads_);
    const size_t lines = content_.colors.size() / 2;
    const auto share = [&](size_t of, size_t part) { return of * part / parts; };
    executor_->For(parts, 1, [&](size_t part, int) {
      std::fill(volume_.begin() + static_cast<ptrdiff_t>(share(volume_.size(), part)),
                volume_.begin() + static_cast<ptrdiff_t>(share(volume_.size(), part + 1)), 0);
    });
    executor_->For(parts, 1, [&](size_t part, int) {
      DrawPlainLines(content_.positions.data(), content_.colors.data(), share(lines, part),
                     share(lines, part + 1), nx_, ny_, volume_.data() + room_);
    });
    return absl::OkStatus();
  }

 private:
  const Content& content_;
  const int nx_, ny_;
  const size_t room_;
  std::vector<uint32_t> volume_;
  const std::unique_ptr<gpu::Executor> executor_;
  const int threads_;
};

}  // namespace

size_t BytesCopied(const Scene& scene) {
  const size_t pictures = scene.target.layout.bytes();
  if (scene.traffic == Traffic::kPictures) return pictures;
  const display::VoxelGrid& grid = scene.target.geometry.grid;
  const size_t volume = sizeof(uint32_t) * static_cast<size_t>(grid.nx) *
                        static_cast<size_t>(grid.ny) * static_cast<size_t>(grid.nz);
  return (volume + pictures) / 2;  // each is read and written once
}

std::unique_ptr<Ceiling> CopyCeiling(size_t bytes, int threads) {
  return std::make_unique<Copy>(bytes, threads);
}

std::unique_ptr<Ceiling> PlainLinesPeer(const Scene& scene, int threads) {
  return std::make_unique<PlainLines>(scene, threads);
}

}  // namespace voxeld::bench::frame
