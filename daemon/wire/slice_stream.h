// Protobuf's input stream over memory in pieces, as gRPC delivers a message, without copying them
// together.
#pragma once

#include <google/protobuf/io/zero_copy_stream.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace voxeld::daemon::wire {

class SliceStream final : public google::protobuf::io::ZeroCopyInputStream {
 public:
  // Both the span and what its elements point to must outlive the stream. Empty slices are allowed.
  explicit SliceStream(std::span<const std::string_view> slices) : slices_(slices) {}

  bool Next(const void** data, int* size) override;
  void BackUp(int count) override;
  bool Skip(int count) override;
  int64_t ByteCount() const override { return consumed_; }

 private:
  std::span<const std::string_view> slices_;
  size_t slice_ = 0;   // the current slice
  size_t offset_ = 0;  // position in it
  int64_t consumed_ = 0;
};

}  // namespace voxeld::daemon::wire
