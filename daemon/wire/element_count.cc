#include "daemon/wire/element_count.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/wire_format_lite.h>

#include "daemon/wire/slice_stream.h"

namespace voxeld::daemon::wire {
namespace {

using google::protobuf::internal::WireFormatLite;
using google::protobuf::io::CodedInputStream;

uint64_t Count(CodedInputStream& in, std::span<const int> path) {
  uint64_t count = 0;
  while (const uint32_t tag = in.ReadTag()) {
    const bool wanted =
        WireFormatLite::GetTagFieldNumber(tag) == path.front() &&
        WireFormatLite::GetTagWireType(tag) == WireFormatLite::WIRETYPE_LENGTH_DELIMITED;
    if (wanted && path.size() > 1) {
      const CodedInputStream::Limit limit = in.ReadLengthAndPushLimit();
      count += Count(in, path.subspan(1));
      if (!in.CheckEntireMessageConsumedAndPopLimit(limit)) break;
    } else {
      count += wanted;
      if (!WireFormatLite::SkipField(&in, tag)) break;
    }
  }
  return count;
}

}  // namespace

uint64_t CountElements(std::span<const std::string_view> slices, std::span<const int> path) {
  SliceStream stream(slices);
  CodedInputStream in(&stream);
  return Count(in, path);
}

}  // namespace voxeld::daemon::wire
