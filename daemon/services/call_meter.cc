#include "daemon/services/call_meter.h"

#include <grpc/grpc.h>
#include <grpc/support/alloc.h>

#include <algorithm>
#include <charconv>
#include <memory>
#include <utility>
#include <vector>

#include "daemon/listen/peer.h"

namespace voxeld::daemon::services {
namespace {

constexpr size_t kMostSockets = 16384;

// Returns: the text after `key` in `json`, up to the next quote, and advances `at` past it. The
// keys are unambiguous, because the JSON contains no text from clients.
std::string_view TextAfter(std::string_view json, std::string_view key, size_t* at) {
  const size_t found = json.find(key, *at);
  if (found == std::string_view::npos) return {};
  const size_t begin = found + key.size();
  const size_t end = std::min(json.find('"', begin), json.size());
  *at = end;
  return json.substr(begin, end - begin);
}

template <typename T>
T NumberOf(std::string_view text) {
  T out = 0;
  std::from_chars(text.data(), text.data() + text.size(), out);
  return out;
}

uint64_t Figure(std::string_view json, std::string_view key) {
  size_t at = 0;
  return NumberOf<uint64_t>(TextAfter(json, key, &at));
}

std::string Take(char* text) {
  const std::unique_ptr<char, void (*)(void*)> owned(text, gpr_free);
  return text == nullptr ? std::string() : std::string(text);
}

}  // namespace

uint64_t CallTotals::Open() const {
  const uint64_t ended = succeeded + failed;
  return started > ended ? started - ended : 0;
}

uint64_t CallTotals::Cancelled(uint64_t at_once) const {
  const uint64_t open = Open();
  return failed + (open > at_once ? open - at_once : 0);
}

CallTotals CallTotals::FromJson(std::string_view json) {
  return {.started = Figure(json, "\"streamsStarted\":\""),
          .succeeded = Figure(json, "\"streamsSucceeded\":\""),
          .failed = Figure(json, "\"streamsFailed\":\""),
          .messages = Figure(json, "\"messagesReceived\":\"")};
}

CallMeter::CallMeter(listen::Guard& guard, uint64_t at_once, sync::Clock& clock)
    : guard_(guard), at_once_(at_once), clock_(clock), thread_([this] { Run(); }) {
  guard_.SetOnBusy([this] {
    sync::MutexLock lock(mutex_);
    busy_ = true;
    changed_.NotifyAll();
  });
}

CallMeter::~CallMeter() {
  guard_.SetOnBusy(nullptr);
  {
    sync::MutexLock lock(mutex_);
    stop_ = true;
    changed_.NotifyAll();
  }
  thread_.join();
}

void CallMeter::Run() {
  sync::TimeNs due = clock_.Now();
  for (;;) {
    {
      sync::MutexLock lock(mutex_);
      while (!stop_ && !busy_) changed_.Wait(mutex_);
      while (!stop_ && clock_.Now() < due) clock_.WaitUntil(mutex_, changed_, due);
      if (stop_) return;
      busy_ = false;
    }
    due = clock_.Now() + kInterval;
    Look();
  }
}

void CallMeter::Look() {
  bool listed = false;
  for (const listen::Guard::Busy& busy : guard_.TakeBusy()) {
    // Discards the number of an earlier connection with the same name, and retries.
    for (;;) {
      const auto known = sockets_.find(busy.peer);
      const std::string json =
          known == sockets_.end() ? "" : Take(grpc_channelz_get_socket(known->second));
      if (!json.empty()) {
        const CallTotals totals = CallTotals::FromJson(json);
        guard_.OnFigures(busy, {.cancelled = totals.Cancelled(at_once_),
                                .progress = totals.started + totals.messages,
                                .open = totals.Open()});
        break;
      }
      if (known != sockets_.end()) sockets_.erase(known);
      if (std::exchange(listed, true)) break;  // no call of it has begun, or it has closed
      ListSockets();
    }
  }
}

void CallMeter::ListSockets() {
  if (sockets_.size() > kMostSockets) {  // most of them have closed
    sockets_.clear();
    next_socket_ = 0;
  }
  const int64_t begin = next_socket_;
  const std::string servers = Take(grpc_channelz_get_servers(0));
  for (size_t at = 0;;) {
    const std::string_view server = TextAfter(servers, "\"serverId\":\"", &at);
    if (server.empty()) return;
    for (int64_t first = begin;;) {
      const std::string json =
          Take(grpc_channelz_get_server_sockets(NumberOf<intptr_t>(server), first, 0));
      // {"name":"chttp2 ipv4:127.0.0.1:40000","socketId":"5"}, in ascending order of numbers
      for (size_t ref = 0;;) {
        const std::string_view name = TextAfter(json, "\"name\":\"chttp2 ", &ref);
        if (name.empty()) break;
        const auto number = NumberOf<int64_t>(TextAfter(json, "\"socketId\":\"", &ref));
        sockets_[listen::PeerName(name)] = number;
        first = number + 1;
        next_socket_ = std::max(next_socket_, first);
      }
      if (json.empty() || json.find("\"end\":true") != std::string::npos) break;
    }
  }
}

}  // namespace voxeld::daemon::services
