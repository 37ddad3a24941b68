// One connection of the local socket: its Hello, then the memory that it hands over.
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

// Answers every packet in order. The next packet is read after the answer was sent, so a client
// that does not read delays only itself. Not thread-safe.
class Connection {
 public:
  // `log` may be null; otherwise it must outlive the connection.
  Connection(Descriptor socket, sync::TimeNs hello_deadline, Logger* log);
  ~Connection();  // releases its memories
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  // Call when the socket is readable or writable. Handles at most one packet. Returns: false when
  // the connection is over.
  [[nodiscard]] bool Serve(const Tokens& tokens);
  // Sends a last message; unread packets are lost.
  void Refuse(std::string_view message);

  int socket() const { return socket_.get(); }
  bool wants_to_write() const { return !answer_.empty(); }  // and not to read
  sync::TimeNs hello_deadline() const { return hello_deadline_; }
  // Null before Hello.
  const std::shared_ptr<LocalMemory>& memory() const { return memory_; }

 private:
  struct Answer {
    std::string bytes;
    bool last = false;
  };
  // Handles a packet. Its descriptors are closed before the answer is sent.
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
  std::string answer_;  // an answer that could not be sent yet; never the last one
  std::string why_ = "the client has closed it";
};

}  // namespace voxeld::daemon::local
