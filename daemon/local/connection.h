// One connection of the local socket: its Hello, then the memory that it brings.
#pragma once

#include <sys/socket.h>

#include <memory>
#include <string>
#include <string_view>

#include "daemon/address/descriptor.h"
#include "daemon/local/packet.h"
#include "daemon/local/tokens.h"
#include "daemon/log/logger.h"
#include "display/sync/clock.h"

namespace voxeld::daemon::local {

// One answer to every packet, in order: the next packet is read once the answer has gone out, so a
// client that does not read holds up nobody but itself. Not thread-safe.
class Connection {
 public:
  // `log` may be none, and outlives it.
  Connection(Descriptor socket, sync::TimeNs hello_deadline, Logger* log);
  ~Connection();  // lets its memories go
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  // When the socket can be read or written: takes one packet at most. False: it is over.
  [[nodiscard]] bool Serve(const Tokens& tokens);
  // As a last word; what has not been read is lost.
  void Refuse(std::string_view message);

  int socket() const { return socket_.get(); }
  bool wants_to_write() const { return !answer_.empty(); }  // and not to read
  sync::TimeNs hello_deadline() const { return hello_deadline_; }
  // Null: no Hello yet.
  const std::shared_ptr<LocalMemory>& memory() const { return memory_; }

 private:
  struct Answer {
    std::string bytes;
    bool last = false;
  };
  // The packet's descriptors are closed before its answer goes out.
  Answer Take(Packet packet, const Tokens& tokens);
  Answer Hello(const Packet& packet, const Message& message, const Tokens& tokens);
  std::string Hold(const Packet& packet, const Message& message);
  std::string Release(const Packet& packet, const Message& message);
  Answer End(std::string_view why);
  bool Send(std::string answer);
  void SendLast(const std::string& answer);
  void Log(Logger::Level level, std::string_view event, std::string_view why) const;

  const Descriptor socket_;
  const sync::TimeNs hello_deadline_;
  Logger* const log_;
  ucred peer_ = {};
  SessionId session_ = 0;
  std::shared_ptr<LocalMemory> memory_;
  std::string answer_;  // that could not be sent yet; never a last one
  std::string why_ = "the client has closed it";
};

}  // namespace voxeld::daemon::local
