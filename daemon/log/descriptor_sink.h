// A log sink that never blocks: it writes to a descriptor only as much as that accepts at once.
#pragma once

#include <spdlog/sinks/base_sink.h>

#include <cstdint>
#include <functional>
#include <mutex>
#include <string>

namespace voxeld::daemon {

// Lines that a full pipe, a stopped terminal or a slow journal does not accept are dropped and
// counted. A separate line reports them before the next line that is written.
class DescriptorSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  // `told(n)` returns the text that reports n dropped lines. `descriptor` must outlive this object.
  DescriptorSink(int descriptor, std::function<std::string(uint64_t)> told)
      : descriptor_(descriptor), told_(std::move(told)) {}

 private:
  void sink_it_(const spdlog::details::log_msg& message) override;
  void flush_() override {}
  bool Write(const spdlog::details::log_msg& message);

  const int descriptor_;
  const std::function<std::string(uint64_t)> told_;
  uint64_t left_out_ = 0;
};

}  // namespace voxeld::daemon
