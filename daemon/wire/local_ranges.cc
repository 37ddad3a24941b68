#include "daemon/wire/local_ranges.h"

#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "voxeld/v1/primitives.pb.h"

namespace voxeld::daemon::wire {
namespace {

constexpr uint64_t kAlignment = 4;

}  // namespace

MaybeFault LocalRanges::Read(const FieldPath& path, const v1::MemoryRange& range,
                             MappedRange* out) {
  if (range.offset() % kAlignment != 0) {
    return Fault{FieldPath(path, "offset").ToString(), Reason::kInvalidValue,
                 absl::StrCat("is ", range.offset(), "; give a multiple of ", kAlignment)};
  }
  if (range.size() > limit_ - bytes_read_) {
    return Fault{FieldPath(path, "size").ToString(), Reason::kQuotaExceeded,
                 absl::StrCat("is ", range.size(), " after ", bytes_read_,
                              " bytes that this request has read from memory; "
                              "max_uncommitted_bytes allows ",
                              limit_, " in one: spread them over requests with commits between")};
  }
  absl::StatusOr<MappedRange> found = source_.Find(range.memory(), range.offset(), range.size());
  if (!found.ok()) {
    const bool beyond = absl::IsOutOfRange(found.status());
    const FieldPath field(path, beyond ? "size" : "memory");
    return Fault{field.ToString(),
                 absl::IsNotFound(found.status()) ? Reason::kNotFound : Reason::kInvalidValue,
                 std::string(found.status().message())};
  }
  bytes_read_ += range.size();
  *out = *std::move(found);
  return {};
}

Fault NoLocalMemory(const FieldPath& path, const v1::MemoryRange& range) {
  return {path.ToString(), Reason::kNotFound,
          absl::StrCat("names memory ", range.memory(),
                       ", and this call has no local socket to bring any; send the bytes "
                       "themselves (Stream tells of its socket in Opened.local_socket)")};
}

}  // namespace voxeld::daemon::wire
