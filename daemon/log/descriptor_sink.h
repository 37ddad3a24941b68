// Where log lines go that must hold nobody up: to a descriptor, as far as that takes them at once.
#pragma once

#include <spdlog/sinks/base_sink.h>

#include <cstdint>
#include <functional>
#include <mutex>
#include <string>

namespace voxeld::daemon {

// Lines that a full pipe, a stopped terminal or a slow journal does not take are left out, counted,
// and told of in a line of their own before the next one that is taken.
class DescriptorSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  // `told(n)`: the text of a line that says that n lines were left out. `descriptor` outlives this.
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
