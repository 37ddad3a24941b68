#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "tools/voxelctl/animate/moving_picture.h"
#include "tools/voxelctl/render/png_file.h"

namespace voxeld::voxelctl {
namespace {

class Frames : public MovingPicture {
 public:
  explicit Frames(std::string pattern) : pattern_(std::move(pattern)) {}

  absl::Status Add(const Image& image) override {
    return WritePng(NumberedName(pattern_, ++number_), image);
  }
  absl::Status Finish() override { return absl::OkStatus(); }

 private:
  const std::string pattern_;
  int number_ = 0;
};

}  // namespace

std::string NumberedName(const std::string& pattern, int number) {
  // The number goes into the file's own name; the folder's name stays unchanged.
  const size_t slash = pattern.rfind('/');
  const size_t begin = pattern.find('#', slash == std::string::npos ? 0 : slash);
  if (begin == std::string::npos) return pattern;
  const size_t end = std::min(pattern.find_first_not_of('#', begin), pattern.size());
  return absl::StrCat(pattern.substr(0, begin),
                      absl::StrFormat("%0*d", static_cast<int>(end - begin), number),
                      pattern.substr(end));
}

std::unique_ptr<MovingPicture> PngFrames(const std::string& pattern) {
  return std::make_unique<Frames>(pattern);
}

}  // namespace voxeld::voxelctl
