#include "daemon/local/connection.h"

#include <cerrno>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::local {
namespace {

// Packets to discard when a connection ends: unread packets would reset it, and the client would
// see the reset before the answer with the reason.
constexpr int kMostDiscarded = 64;

// Returns: what is wrong with the received descriptors; empty: nothing.
std::string DescriptorsWrong(const Packet& packet, size_t wanted) {
  if (packet.descriptors_lost) {
    return "its descriptor was lost: the server has none left; try again later";
  }
  const size_t came = packet.descriptors.size() + (packet.more_descriptors ? 1 : 0);
  if (came == wanted) return {};
  const char* what = came == 0     ? "no descriptor"
                     : wanted == 0 ? "descriptors"
                                   : "several descriptors";
  return absl::StrCat("it came with ", what, "; send it with ", wanted == 0 ? "none" : "one");
}

}  // namespace

Connection::Connection(Descriptor socket, sync::TimeNs hello_deadline, Logger* log)
    : socket_(std::move(socket)), hello_deadline_(hello_deadline), log_(log) {
  socklen_t size = sizeof(peer_);
  getsockopt(socket_.get(), SOL_SOCKET, SO_PEERCRED, &peer_, &size);
}

Connection::~Connection() {
  if (memory_ == nullptr) return;
  memory_->ReleaseAll();
  Log(Logger::Level::kInfo, "local socket left", why_);
}

void Connection::Log(Logger::Level level, std::string_view event, std::string_view why) const {
  if (log_ == nullptr) return;
  const LogField session = {"session", session_ == 0 ? "none" : std::to_string(session_)};
  const LogField pid = {"pid", std::to_string(peer_.pid)}, uid = {"uid", std::to_string(peer_.uid)};
  if (why.empty()) return log_->Log(level, event, {session, pid, uid});
  log_->Log(level, event, {session, pid, uid, {"why", std::string(why)}});
}

bool Connection::Serve(const Tokens& tokens) {
  if (!answer_.empty()) return Send(std::exchange(answer_, {}));
  Packet packet = Receive(socket_.get(), memory_ == nullptr ? kNoDescriptors : kDescriptors);
  switch (packet.what) {
    case Packet::What::kNothing:
      return true;
    case Packet::What::kEnd:
      return false;
    case Packet::What::kPacket:
      break;
  }
  Answer answer = Take(std::move(packet), tokens);
  if (!answer.last) return Send(std::move(answer.bytes));
  SendLast(answer.bytes);
  return false;
}

Connection::Answer Connection::Take(Packet packet, const Tokens& tokens) {
  const absl::StatusOr<Message> message = ParseMessage(packet);
  if (!message.ok()) return End(std::string(message.status().message()));
  if (message->what == Message::What::kHello) return Hello(packet, *message, tokens);
  if (memory_ == nullptr) {
    return End("the first packet of a connection must be hello, with Opened.local_token");
  }
  return {message->what == Message::What::kMemory ? Hold(packet, *message)
                                                  : Release(packet, *message)};
}

Connection::Answer Connection::Hello(const Packet& packet, const Message& message,
                                     const Tokens& tokens) {
  if (memory_ != nullptr) return End("hello came a second time; a connection says it once");
  if (const std::string wrong = DescriptorsWrong(packet, 0); !wrong.empty()) {
    return End(absl::StrCat("hello: ", wrong));
  }
  Tokens::Found found = tokens.Find(message.token);
  if (found.memory == nullptr) {
    return End(absl::StrCat("a token of ", message.token.size(),
                            " bytes that no open session has; give Opened.local_token, while the "
                            "stream is open"));
  }
  session_ = found.session;
  memory_ = std::move(found.memory);
  Log(Logger::Level::kInfo, "local socket joined", {});
  return {Welcome(memory_->limits().max_memories, memory_->limits().max_bytes)};
}

std::string Connection::Hold(const Packet& packet, const Message& message) {
  if (const std::string wrong = DescriptorsWrong(packet, 1); !wrong.empty()) {
    return Refused(message.id, absl::StrCat("memory ", message.id, ": ", wrong));
  }
  const absl::Status status =
      memory_->Hold(message.id, message.size, packet.descriptors.front().get());
  if (!status.ok()) return Refused(message.id, std::string(status.message()));
  return Held(message.id);
}

std::string Connection::Release(const Packet& packet, const Message& message) {
  if (const std::string wrong = DescriptorsWrong(packet, 0); !wrong.empty()) {
    return Refused(message.id, absl::StrCat("release ", message.id, ": ", wrong));
  }
  const absl::Status status = memory_->Release(message.id);
  if (!status.ok()) return Refused(message.id, std::string(status.message()));
  return Released(message.id);
}

bool Connection::Send(std::string answer) {
  while (send(socket_.get(), answer.data(), answer.size(), MSG_DONTWAIT | MSG_NOSIGNAL) < 0) {
    if (errno == EINTR) continue;
    if (errno == EAGAIN || errno == EWOULDBLOCK || errno == ENOBUFS) {
      answer_ = std::move(answer);
      return true;
    }
    why_ = std::generic_category().message(errno);
    return false;
  }
  return true;
}

Connection::Answer Connection::End(std::string_view why) {
  Log(Logger::Level::kWarn, "local socket refused", why);
  why_ = std::string(why);
  return {Refused(0, why), true};
}

void Connection::Refuse(std::string_view message) {
  why_ = std::string(message);
  SendLast(Refused(0, message));
}

void Connection::SendLast(const std::string& answer) {
  send(socket_.get(), answer.data(), answer.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
  for (int i = 0; i < kMostDiscarded; ++i) {
    if (Receive(socket_.get(), kNoDescriptors).what != Packet::What::kPacket) break;
  }
}

}  // namespace voxeld::daemon::local
