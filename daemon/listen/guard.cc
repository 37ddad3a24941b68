#include "daemon/listen/guard.h"

#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::listen {

absl::Status Guard::MayEnter(const Peer& peer) {
  absl::Status status;
  {
    sync::MutexLock lock(mutex_);
    const auto at = by_address_.find(peer.address);
    const uint32_t of_address = at == by_address_.end() ? 0 : at->second;
    if (of_address >= limits_.max_connections_per_address) {
      ++counters_.refused_by_address;
      status = absl::ResourceExhaustedError(
          absl::StrCat(of_address, " connections from ", peer.address,
                       " are open, which is max_connections_per_address"));
    } else if (counted_ >= limits_.max_connections) {
      ++counters_.refused_in_all;
      status = absl::ResourceExhaustedError(
          absl::StrCat(counted_, " connections are open, which is max_connections"));
    }
  }
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
  connection.since = clock_.Now();
  if (!own) {
    ++by_address_[peer.address];
    ++counted_;
    ++counters_.accepted;
    ++counters_.open;
  }
  if (!peer.unix_socket) {
    // A name that is still there is of a connection that has ended, and whose end is not known yet.
    by_name_[peer.name] = id;
    connection.watched = true;
    watched_.emplace(id, &connection);
  }
  return id;
}

void Guard::Leave(ConnectionId id) {
  std::unique_ptr<Wire> wire;  // closed without the lock
  sync::MutexLock lock(mutex_);
  const auto it = connections_.find(id);
  if (it == connections_.end()) return;
  Connection& connection = it->second;
  wire = std::move(connection.wire);
  watched_.erase(id);
  authorised_.erase(id);
  if (const auto named = by_name_.find(connection.name);
      named != by_name_.end() && named->second == id) {
    by_name_.erase(named);
  }
  if (!connection.own) {
    --counted_;
    --counters_.open;
    const auto at = by_address_.find(connection.address);
    if (--at->second == 0) by_address_.erase(at);
  }
  connections_.erase(it);
}

bool Guard::OnBytes(ConnectionId id) {
  sync::MutexLock lock(mutex_);
  const auto it = watched_.find(id);
  if (it == watched_.end()) return false;
  return !BytesAreMany(*it->second);
}

sync::TimeNs Guard::Look() {
  sync::MutexLock lock(mutex_);
  const sync::TimeNs now = clock_.Now();
  for (auto it = watched_.begin(); it != watched_.end();) {
    Connection& connection = *(it++)->second;  // a cut takes it out
    if (BytesAreMany(connection)) continue;
    if (connection.waiting > 0 || now - connection.since < limits_.unauthorised_limit_ns) continue;
    Cut(connection, counters_.cut_for_time,
        absl::StrCat("it has been open for ", limits_.unauthorised_limit_ns / sync::kMillisecond,
                     " ms, which is unauthorised_limit_ns, and no call of it has been answered"));
  }
  return watched_.empty() ? sync::kNever : now + kLookInterval;
}

void Guard::OnMessage(const std::string& peer) {
  sync::MutexLock lock(mutex_);
  Connection* connection = Find(peer);
  if (connection == nullptr || !connection->watched) return;
  ++connection->waiting;
  BytesAreMany(*connection);
}

void Guard::OnAuthorised(const std::string& peer) {
  sync::MutexLock lock(mutex_);
  Connection* connection = Find(peer);
  if (connection == nullptr || !connection->watched || BytesAreMany(*connection)) return;
  connection->watched = false;
  watched_.erase(connection->id);
  authorised_.emplace(connection->id, connection);
}

void Guard::OnCallEnd(const std::string& peer) {
  sync::MutexLock lock(mutex_);
  Connection* connection = Find(peer);
  if (connection == nullptr || connection->waiting == 0) return;
  if (--connection->waiting == 0) connection->since = clock_.Now();
}

std::vector<std::string> Guard::Busy() {
  std::vector<std::string> out;
  sync::MutexLock lock(mutex_);
  for (const auto& [id, connection] : authorised_) {
    const uint64_t bytes = connection->wire->BytesReceived();
    if (std::exchange(connection->bytes, bytes) != bytes) out.push_back(connection->name);
  }
  return out;
}

void Guard::OnCancelled(const std::string& peer, uint64_t in_all) {
  sync::MutexLock lock(mutex_);
  Connection* connection = Find(peer);
  if (connection == nullptr || limits_.max_cancelled_calls_per_second == 0) return;
  const sync::TimeNs now = clock_.Now();
  if (in_all > connection->cancelled_before + limits_.max_cancelled_calls_per_second) {
    Cut(*connection, counters_.cut_for_cancelling,
        absl::StrCat(in_all - connection->cancelled_before,
                     " calls were cancelled within a second, and ",
                     limits_.max_cancelled_calls_per_second, " is max_cancelled_calls_per_second"));
  } else if (now - connection->cancelled_since >= sync::kSecond) {
    connection->cancelled_since = now;
    connection->cancelled_before = in_all;
  }
}

Guard::Connection* Guard::Find(const std::string& peer) {
  const auto named = by_name_.find(peer);
  return named == by_name_.end() ? nullptr : &connections_.at(named->second);
}

bool Guard::BytesAreMany(Connection& connection) {
  if (connection.cut) return true;
  const uint64_t bytes = connection.wire->BytesReceived();
  if (bytes <= limits_.unauthorised_bytes) return false;
  Cut(connection, counters_.cut_for_bytes,
      absl::StrCat(bytes, " bytes came before a call was answered, and ",
                   limits_.unauthorised_bytes,
                   " is unauthorised_bytes; a client's first call is at most 48 KiB in all, and on "
                   "a stream it sends nothing but Open before Opened"));
  return true;
}

void Guard::Cut(Connection& connection, Counters::Count& counter, const std::string& why) {
  if (std::exchange(connection.cut, true)) return;
  ++counter;
  connection.wire->Cut();
  connection.watched = false;
  watched_.erase(connection.id);
  authorised_.erase(connection.id);
  gate_.Log(Logger::Level::kWarn, "connection cut", connection.name, why);
}

}  // namespace voxeld::daemon::listen
