#include "daemon/listen/guard.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::listen {
namespace {

// Sixteenths of a limit that remain when a connection is disconnected. For bytes this covers what
// can arrive at once while the receive buffer is small, and leaves more than a first call needs.
constexpr int kTimeLeft = 1, kBytesLeft = 3;

}  // namespace

absl::Status Guard::MayEnter(const Peer& peer) {
  absl::Status status;
  std::vector<Doomed> doomed;
  {
    sync::MutexLock lock(mutex_);
    const sync::TimeNs now = clock_.Now();
    const Counted of_address = CountOf(peer.address);
    const auto penalty = penalties_.find(peer.address);
    if (penalty != penalties_.end() && now < penalty->second.until) {
      ++counters_.refused_after_cut;
      status = absl::UnavailableError(absl::StrCat(
          "a connection from ", peer.address, " was cut; further ones are refused for ",
          (penalty->second.until - now) / sync::kMillisecond,
          " ms, which cut_penalty_ns and the times before come to"));
    } else if (of_address.authorised >= limits_.max_connections_per_address ||
               (counted_.authorised < limits_.max_connections &&
                IsFull(of_address, limits_.max_connections_per_address, peer.address, doomed))) {
      ++counters_.refused_by_address;
      status = absl::ResourceExhaustedError(
          absl::StrCat(of_address.open, " connections from ", peer.address,
                       " are open, which is max_connections_per_address"));
    } else if (IsFull(counted_, limits_.max_connections, "", doomed)) {
      ++counters_.refused_in_all;
      status = absl::ResourceExhaustedError(
          absl::StrCat(counted_.open, " connections are open, which is max_connections"));
    }
  }
  Cut(doomed);
  if (!status.ok()) {
    gate_.Log(Logger::Level::kWarn, "connection refused", peer.name, std::string(status.message()));
  }
  return status;
}

ConnectionId Guard::Enter(const Peer& peer, bool own, std::unique_ptr<Wire> wire) {
  sync::MutexLock lock(mutex_);
  const ConnectionId id = next_++;
  Connection& connection = connections_[id];
  connection.id = id;
  connection.name = peer.name;
  connection.address = peer.address;
  connection.own = own;
  connection.unix_socket = peer.unix_socket;
  connection.wire = std::move(wire);
  connection.entered = connection.since = clock_.Now();
  connection.authorised = peer.unix_socket;
  if (!own) {
    connection.counted = true;
    for (Counted* counted : {&by_address_[peer.address], &counted_}) {
      ++counted->open;
      counted->authorised += peer.unix_socket;  // the kernel identifies the user
    }
    ++counters_.accepted;
    ++counters_.open;
  }
  if (!peer.unix_socket) {
    // An existing entry belongs to a connection that has ended but whose end has not been reported
    // yet.
    by_name_[peer.name] = id;
    connection.watched = true;
    watched_.emplace(id, &connection);
  }
  return id;
}

void Guard::OnWrongGreeting(ConnectionId id, const std::string& why) {
  std::vector<Doomed> doomed;
  {
    sync::MutexLock lock(mutex_);
    const auto it = watched_.find(id);
    if (it == watched_.end()) return;
    Doom(*it->second, counters_.cut_for_greeting, why, true, doomed);
  }
  Cut(doomed);
}

void Guard::Leave(ConnectionId id) {
  std::vector<Doomed> doomed;
  std::shared_ptr<Wire> wire;  // destroyed without the lock
  {
    sync::MutexLock lock(mutex_);
    const auto it = connections_.find(id);
    if (it == connections_.end()) return;
    Connection& connection = it->second;
    // A client that closes the connection first is disconnected and penalised as well, and gRPC
    // need not read the remaining bytes.
    if (connection.watched) BytesAreMany(connection, true, doomed);
    wire = std::move(connection.wire);
    watched_.erase(id);
    busy_.erase(id);
    if (const auto named = by_name_.find(connection.name);
        named != by_name_.end() && named->second == id) {
      by_name_.erase(named);
    }
    if (!connection.own) --counters_.open;
    Uncount(connection);
    connections_.erase(it);
  }
  Cut(doomed);
}

void Guard::OnBytes(ConnectionId id) {
  std::vector<Doomed> doomed;
  {
    sync::MutexLock lock(mutex_);
    const auto it = connections_.find(id);
    if (it == connections_.end() || it->second.unix_socket || it->second.cut) return;
    if (it->second.watched && BytesAreMany(it->second, false, doomed)) {
      // It has been removed.
    } else {
      MarkBusy(it->second);
    }
  }
  Cut(doomed);
}

sync::TimeNs Guard::Look() {
  std::vector<Doomed> doomed;
  sync::TimeNs next = sync::kNever;
  {
    sync::MutexLock lock(mutex_);
    const sync::TimeNs now = clock_.Now();
    const sync::TimeNs most = limits_.unauthorised_limit_ns / 16 * (16 - kTimeLeft);
    for (auto it = watched_.begin(); it != watched_.end();) {
      Connection& connection = *(it++)->second;  // Doom removes it
      if (BytesAreMany(connection, false, doomed)) continue;
      if (connection.waiting > 0 || now - connection.since < most) continue;
      Doom(connection, counters_.cut_for_time,
           absl::StrCat("it has been open for ", (now - connection.since) / sync::kMillisecond,
                        " ms, unauthorised_limit_ns is ",
                        limits_.unauthorised_limit_ns / sync::kMillisecond,
                        " ms, and no call of it that authorises has been answered"),
           false, doomed);
    }
    MakeAllRoom(doomed);
    if (!watched_.empty()) next = now + kLookInterval;
  }
  Cut(doomed);
  return next;
}

void Guard::OnMessage(const std::string& peer) {
  std::vector<Doomed> doomed;
  {
    sync::MutexLock lock(mutex_);
    Connection* connection = Find(peer);
    if (connection == nullptr || !connection->watched) return;
    ++connection->waiting;
    BytesAreMany(*connection, false, doomed);
  }
  Cut(doomed);
}

void Guard::OnAnswer(const std::string& peer, bool authorises) {
  std::vector<Doomed> doomed;
  std::shared_ptr<Wire> trusted;
  bool armed = false;
  {
    sync::MutexLock lock(mutex_);
    Connection* connection = Find(peer);
    if (connection == nullptr || !connection->watched) return;
    if (!BytesAreMany(*connection, false, doomed)) {
      const bool full =
          authorises && connection->counted &&
          (CountOf(connection->address).authorised >= limits_.max_connections_per_address ||
           counted_.authorised >= limits_.max_connections);
      if (full) {
        Doom(*connection, counters_.refused_in_all,
             "as many authorised connections are open as max_connections or "
             "max_connections_per_address allow",
             false, doomed);
      } else if (authorises) {
        connection->watched = false;
        watched_.erase(connection->id);
        if (connection->counted) {
          connection->authorised = true;
          ++by_address_[connection->address].authorised;
          ++counted_.authorised;
        }
        trusted = connection->wire;
        armed = on_busy_ != nullptr;
      } else {
        connection->answered = true;
        connection->since = clock_.Now();
        connection->base = connection->wire->BytesReceived();
        connection->many_since = sync::kNever;
      }
    }
  }
  Cut(doomed);
  if (trusted != nullptr) trusted->Trust();
  if (armed) trusted->Arm();
}

void Guard::OnCallEnd(const std::string& peer) {
  sync::MutexLock lock(mutex_);
  Connection* connection = Find(peer);
  if (connection == nullptr || connection->waiting == 0) return;
  if (--connection->waiting == 0) connection->since = clock_.Now();
}

void Guard::SetOnBusy(std::function<void()> on_busy) {
  sync::MutexLock lock(mutex_);
  on_busy_ = std::move(on_busy);
}

std::vector<Guard::Busy> Guard::TakeBusy() {
  std::vector<std::pair<Busy, std::shared_ptr<Wire>>> taken;
  {
    sync::MutexLock lock(mutex_);
    for (const ConnectionId id : busy_) {
      const Connection& connection = connections_.at(id);
      // Connections in watched_ report every byte anyway.
      taken.push_back({{connection.name, 0}, connection.wire});
      if (!connection.watched) continue;
      taken.back().first.bytes = connection.wire->BytesReceived();
      taken.back().second = nullptr;
    }
    busy_.clear();
  }
  std::vector<Busy> out;
  out.reserve(taken.size());
  for (auto& [busy, wire] : taken) {
    if (wire != nullptr) {
      wire->Arm();  // before reading the count: later bytes are reported
      busy.bytes = wire->BytesReceived();
    }
    out.push_back(std::move(busy));
  }
  return out;
}

void Guard::OnFigures(const Busy& busy, const CallFigures& figures) {
  std::vector<Doomed> doomed;
  {
    sync::MutexLock lock(mutex_);
    Connection* connection = Find(busy.peer);
    if (connection == nullptr || connection->cut) return;
    const sync::TimeNs now = clock_.Now();
    const uint32_t most_cancelled = limits_.max_cancelled_calls_per_second;
    if (most_cancelled != 0 && figures.cancelled > connection->cancelled_before + most_cancelled) {
      Doom(*connection, counters_.cut_for_cancelling,
           absl::StrCat(figures.cancelled - connection->cancelled_before,
                        " calls were cancelled within a second, and ", most_cancelled,
                        " is max_cancelled_calls_per_second"),
           true, doomed);
    } else if (now - connection->cancelled_since >= sync::kSecond) {
      connection->cancelled_since = now;
      connection->cancelled_before = figures.cancelled;
    }
    const uint64_t most_bytes = limits_.max_message_bytes + limits_.lookahead_bytes * figures.open;
    if (figures.progress != connection->progress || busy.bytes < connection->progress_bytes) {
      connection->progress = figures.progress;
      connection->progress_bytes = busy.bytes;
    } else if (!connection->cut && busy.bytes - connection->progress_bytes > most_bytes) {
      Doom(*connection, counters_.cut_for_flooding,
           absl::StrCat(busy.bytes - connection->progress_bytes,
                        " bytes came of which neither a call nor a message came; ", most_bytes,
                        " is the most that ", figures.open, " calls can have under way"),
           true, doomed);
    }
  }
  Cut(doomed);
}

Guard::Connection* Guard::Find(const std::string& peer) {
  const auto named = by_name_.find(peer);
  return named == by_name_.end() ? nullptr : &connections_.at(named->second);
}

bool Guard::BytesAreMany(Connection& connection, bool ended, std::vector<Doomed>& doomed) {
  if (connection.cut) return true;
  const uint64_t bytes = connection.wire->BytesReceived() - connection.base;
  const uint64_t most = limits_.unauthorised_bytes;
  if (bytes <= most / 16 * (16 - kBytesLeft)) return false;
  const sync::TimeNs now = clock_.Now();
  if (connection.many_since == sync::kNever) connection.many_since = now;
  if (bytes <= most && (ended || now - connection.many_since < kGrace)) return false;
  Doom(connection, counters_.cut_for_bytes,
       absl::StrCat(bytes, " bytes came before a call was answered, and ", most,
                    " is unauthorised_bytes; a client's first call is at most ",
                    most_first_message() >> 10,
                    " KiB in all, and on a stream it sends nothing but Open before Opened"),
       true, doomed);
  return true;
}

void Guard::MarkBusy(const Connection& connection) {
  if (on_busy_ == nullptr) return;
  const bool first = busy_.empty();
  busy_.insert(connection.id);
  if (first) on_busy_();
}

void Guard::Uncount(Connection& connection) {
  if (!std::exchange(connection.counted, false)) return;
  const auto at = by_address_.find(connection.address);
  for (Counted* counted : {&at->second, &counted_}) {
    --counted->open;
    counted->authorised -= connection.authorised;
  }
  if (at->second.open == 0) by_address_.erase(at);
}

Guard::Counted Guard::CountOf(const std::string& address) const {
  const auto at = by_address_.find(address);
  return at == by_address_.end() ? Counted() : at->second;
}

bool Guard::IsFull(const Counted& counted, uint32_t limit, const std::string& address,
                   std::vector<Doomed>& doomed) {
  if (counted.open < limit) return false;
  if (counted.authorised >= limit) return true;
  return !MakeRoom(address, doomed) && counted.open >= kYoungBeyond * limit;
}

bool Guard::MakeRoom(const std::string& address, std::vector<Doomed>& doomed) {
  const sync::TimeNs now = clock_.Now();
  Connection *longest = nullptr, *answered = nullptr;
  for (const auto& [id, connection] : watched_) {
    if (!connection->counted || now - connection->entered < kFirstCall) continue;
    if (!address.empty() && connection->address != address) continue;
    // A call that is answered but continues, such as a health watch, is considered only if no
    // connection is idle.
    if (connection->waiting > 0 && !connection->answered) continue;
    Connection*& found = connection->waiting > 0 ? answered : longest;
    if (found == nullptr || connection->since < found->since) found = connection;
  }
  if (longest == nullptr) longest = answered;
  if (longest == nullptr) return false;
  Doom(*longest, counters_.cut_for_room,
       absl::StrCat("it was idle for ", (now - longest->since) / sync::kMillisecond,
                    " ms, no call of it that authorises has been answered, and another one needs "
                    "its place; see max_connections and max_connections_per_address"),
       false, doomed);
  Uncount(*longest);
  return true;
}

void Guard::MakeAllRoom(std::vector<Doomed>& doomed) {
  while (counted_.open > limits_.max_connections && MakeRoom("", doomed)) {
  }
  std::vector<std::string> crowded;
  for (const auto& [address, count] : by_address_) {
    if (count.open > limits_.max_connections_per_address) crowded.push_back(address);
  }
  for (const std::string& address : crowded) {
    while (CountOf(address).open > limits_.max_connections_per_address &&
           MakeRoom(address, doomed)) {
    }
  }
}

void Guard::Doom(Connection& connection, Counters::Count& counter, std::string why, bool punished,
                 std::vector<Doomed>& doomed) {
  if (std::exchange(connection.cut, true)) return;
  ++counter;
  connection.watched = false;
  watched_.erase(connection.id);
  busy_.erase(connection.id);
  if (punished) Punish(connection);
  doomed.push_back({connection.wire, connection.name, std::move(why)});
}

void Guard::Punish(const Connection& connection) {
  if (connection.own || connection.unix_socket || limits_.cut_penalty_ns == 0) return;
  const sync::TimeNs now = clock_.Now();
  const auto found = penalties_.find(connection.address);
  sync::TimeNs length = limits_.cut_penalty_ns;
  if (found != penalties_.end()) {
    const Penalty& last = found->second;
    if (now < last.until) return;  // it was opened before the penalty, which covers it as well
    // The penalty is forgotten if the address behaved well for as long as it had been refused.
    if (connection.entered >= last.until && now < last.until + last.length) {
      length = std::min(2 * last.length, kLongestPenalty * limits_.cut_penalty_ns);
    }
  } else if (penalties_.size() >= kMostPenalties) {
    penalties_.erase(std::min_element(
        penalties_.begin(), penalties_.end(),
        [](const auto& a, const auto& b) { return a.second.until < b.second.until; }));
  }
  penalties_[connection.address] = {length, now + length};
}

void Guard::Cut(const std::vector<Doomed>& doomed) {
  for (const Doomed& one : doomed) {
    one.wire->Cut();
    one.wire->Arm();  // reports the end even if TakeBusy has disarmed it
    gate_.Log(Logger::Level::kWarn, "connection cut", one.name, one.why);
  }
}

}  // namespace voxeld::daemon::listen
