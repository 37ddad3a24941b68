// The path of a field in a request: "batch.upserts[137].entity.priority". Nodes are on the stack of
// the decoder that walks the message, and point to their parents, so a path costs nothing until it
// is printed.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace voxeld::daemon::wire {

class FieldPath {
 public:
  // `name` and `parent` must outlive the node. An `index` >= 0 prints as name[index].
  explicit FieldPath(std::string_view name, int64_t index = -1) : name_(name), index_(index) {}
  FieldPath(const FieldPath& parent, std::string_view name, int64_t index = -1)
      : parent_(&parent), name_(name), index_(index) {}
  FieldPath(FieldPath&& parent, std::string_view name, int64_t index = -1) = delete;

  std::string ToString() const {
    std::string out = parent_ == nullptr ? std::string() : parent_->ToString();
    if (!out.empty() && !name_.empty()) out += '.';
    out += name_;
    if (index_ >= 0) {
      out += '[';
      out += std::to_string(index_);
      out += ']';
    }
    return out;
  }

 private:
  const FieldPath* parent_ = nullptr;
  std::string_view name_;
  int64_t index_;
};

}  // namespace voxeld::daemon::wire
