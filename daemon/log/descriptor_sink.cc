#include "daemon/log/descriptor_sink.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>

namespace voxeld::daemon {

// Assumes that a writable descriptor accepts PIPE_BUF bytes: a pipe then has room for a page, a
// socket for more.
bool DescriptorSink::Write(const spdlog::details::log_msg& message) {
  spdlog::memory_buf_t text;
  formatter_->format(message, text);
  size_t at = 0;
  while (at < text.size()) {
    pollfd ready{descriptor_, POLLOUT, 0};
    if (poll(&ready, 1, 0) <= 0 || (ready.revents & POLLOUT) == 0) return false;
    const ssize_t written =
        write(descriptor_, text.data() + at, std::min<size_t>(text.size() - at, PIPE_BUF));
    if (written < 0 && errno != EINTR) return false;
    at += static_cast<size_t>(std::max<ssize_t>(0, written));
  }
  return true;
}

void DescriptorSink::sink_it_(const spdlog::details::log_msg& message) {
  if (left_out_ > 0) {
    const std::string text = told_(left_out_);
    spdlog::details::log_msg note(message.logger_name, spdlog::level::warn, text);
    note.time = message.time;
    if (!Write(note)) {
      ++left_out_;
      return;
    }
    left_out_ = 0;
  }
  if (!Write(message)) ++left_out_;
}

}  // namespace voxeld::daemon
