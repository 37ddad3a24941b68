// Tests the local socket and its clients, with real memfds.
#include "daemon/local/local_socket.h"

#include <gmock/gmock.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <optional>

#include "daemon/local/local_session.h"
#include "tests/daemon/local/socket_fixture.h"

namespace voxeld::daemon::local {
namespace {

using ::testing::HasSubstr;

void ExpectRefusedAndClosed(LocalClient& client, const char* why) {
  const std::optional<v1::LocalAnswer> answer = client.Read();
  ASSERT_TRUE(answer.has_value()) << why;
  EXPECT_THAT(answer->refused().message(), HasSubstr(why));
  EXPECT_FALSE(client.Read().has_value()) << why;
}

// While it lives, no descriptor can be opened in this process.
class NoDescriptors {
 public:
  NoDescriptors() {
    getrlimit(RLIMIT_NOFILE, &before_);
    const int free = dup(0);
    close(free);
    rlimit none = before_;
    none.rlim_cur = static_cast<rlim_t>(free);
    EXPECT_EQ(setrlimit(RLIMIT_NOFILE, &none), 0);
    EXPECT_LT(dup(0), 0);
  }
  ~NoDescriptors() { setrlimit(RLIMIT_NOFILE, &before_); }

 private:
  rlimit before_;
};

TEST_F(LocalSocketTest, TakesMemoryAndLetsItGo) {
  Start({.limits = {.max_memories = 5, .max_bytes = 1000}});
  struct stat mode;
  ASSERT_EQ(stat(path().c_str(), &mode), 0);
  EXPECT_EQ(mode.st_mode & 0777, 0660u);
  const Tokens::Registered session = Register(3);
  LocalClient client(path());
  const v1::LocalAnswer welcome = client.Hello(session.token);
  EXPECT_EQ(welcome.welcome().max_memories(), 5u);
  EXPECT_EQ(welcome.welcome().max_bytes(), 1000u);
  const int before = OpenDescriptors();
  {
    const Descriptor fd = MakeMemfd("voxels of light.");
    EXPECT_EQ(client.Call(MemoryMessage(9, 16), {fd.get()}).held().id(), 9u);
  }
  EXPECT_EQ(OpenDescriptors(), before) << "what is mapped needs no descriptor";
  EXPECT_EQ(session.memory->Find(9, 8, 8)->bytes, "f light.");
  EXPECT_EQ(client.Call(ReleaseMessage(9)).released().id(), 9u);
  EXPECT_TRUE(absl::IsNotFound(session.memory->Find(9, 0, 4).status()));
  const v1::LocalAnswer again = client.Call(ReleaseMessage(9));
  EXPECT_EQ(again.refused().id(), 9u);
  EXPECT_THAT(again.refused().message(), HasSubstr("memory 9 is not held"));
}

TEST_F(LocalSocketTest, AFileThatIsNotItsOwnStays) {
  Start();
  std::filesystem::remove(path());
  std::ofstream(path()) << "another's";
  socket_.reset();
  EXPECT_TRUE(std::filesystem::exists(path()));
}

TEST_F(LocalSocketTest, RefusesAMemoryAndGoesOn) {
  Start({.limits = {.max_memories = 2, .max_bytes = 10}});
  const Tokens::Registered session = Register(1);
  LocalClient client = Joined(session);
  const Descriptor good = MakeMemfd("0123"), soft = MakeMemfd("0123", F_SEAL_SHRINK),
                   large = MakeMemfd("0123456789a");
  const int before = OpenDescriptors();
  const auto refused = [&](const v1::LocalMessage& message, const std::vector<int>& fds) {
    const v1::LocalAnswer answer = client.Call(message, fds);
    EXPECT_EQ(answer.refused().id(), 7u);
    EXPECT_EQ(session.memory->memories(), 0u);
    return answer.refused().message();
  };
  EXPECT_THAT(refused(MemoryMessage(7, 4), {soft.get()}),
              HasSubstr("not sealed with F_SEAL_GROW, F_SEAL_WRITE;"));
  EXPECT_THAT(refused(MemoryMessage(7, 5), {good.get()}), HasSubstr("5 bytes and has 4"));
  EXPECT_THAT(refused(MemoryMessage(7, 11), {large.get()}), HasSubstr("max_local_bytes allows 10"));
  EXPECT_THAT(refused(MemoryMessage(7, 4), {}), HasSubstr("no descriptor; send it with one"));
  EXPECT_THAT(refused(MemoryMessage(7, 4), {good.get(), good.get()}),
              HasSubstr("several descriptors; send it with one"));
  EXPECT_THAT(refused(MemoryMessage(7, 4), std::vector<int>(40, good.get())),
              HasSubstr("several descriptors; send it with one"));
  EXPECT_THAT(refused(ReleaseMessage(7), {good.get()}),
              HasSubstr("descriptors; send it with none"));
  EXPECT_EQ(OpenDescriptors(), before) << "descriptors that came with a refused packet are closed";
  EXPECT_TRUE(client.Call(MemoryMessage(7, 4), {good.get()}).has_held());
  EXPECT_THAT(client.Call(MemoryMessage(7, 4), {good.get()}).refused().message(),
              HasSubstr("held already"));
  EXPECT_TRUE(client.Call(MemoryMessage(8, 4), {good.get()}).has_held());
  EXPECT_THAT(client.Call(MemoryMessage(9, 4), {good.get()}).refused().message(),
              HasSubstr("max_local_memories allows 2"));
}

TEST_F(LocalSocketTest, WithoutTheRightTokenThereIsNoWayIn) {
  Start();
  const Tokens::Registered session = Register(1);
  const Descriptor fd = MakeMemfd("0123");
  for (const std::string& token :
       {std::string(), std::string(16, 'x'), session.token.substr(1), session.token + "x"}) {
    LocalClient client(path());
    client.Send(HelloMessage(token));
    ExpectRefusedAndClosed(client, "that no open session has");
  }
  LocalClient first_memory(path());
  first_memory.Send(MemoryMessage(1, 4), {fd.get()});
  ExpectRefusedAndClosed(first_memory, "must be hello");
  LocalClient first_release(path());
  first_release.Send(ReleaseMessage(1));
  ExpectRefusedAndClosed(first_release, "must be hello");
  LocalClient with_descriptor(path());
  with_descriptor.Send(HelloMessage(session.token), {fd.get()});
  ExpectRefusedAndClosed(with_descriptor, "descriptors; send it with none");
  LocalClient twice = Joined(session);
  EXPECT_TRUE(twice.Call(MemoryMessage(1, 4), {fd.get()}).has_held());
  twice.Send(HelloMessage(session.token));
  ExpectRefusedAndClosed(twice, "a second time");
  EXPECT_EQ(session.memory->memories(), 0u);
  // Packets sent directly after a wrong token do not hide the reason.
  LocalClient eager(path());
  eager.Send(HelloMessage("wrong"));
  for (int i = 0; i < 5; ++i) eager.Send(MemoryMessage(1, 4), {fd.get()});
  bool told = false;
  while (const std::optional<v1::LocalAnswer> answer = eager.Read()) {
    told |= answer->refused().message().find("a token of 5 bytes") != std::string::npos;
  }
  EXPECT_TRUE(told);
}

TEST_F(LocalSocketTest, MalformedPacketsEndTheConnection) {
  Start();
  const Tokens::Registered session = Register(1);
  const Descriptor fd = MakeMemfd("0123");
  const int before = OpenDescriptors();
  for (const auto& [bytes, why] : std::vector<std::pair<std::string, const char*>>{
           {"\xff\xff\xff", "is not a voxeld.v1.LocalMessage"},
           {std::string("\x78\x01", 2), "says nothing this version"},
           {std::string(4096, '\0'), "is not a voxeld.v1.LocalMessage"},
           {std::string(4097, '\0'), "more than 4096 bytes"},
           {ReleaseMessage(1).SerializeAsString() + std::string(5000, '\x0a'),
            "more than 4096 bytes"}}) {
    for (const bool hello : {false, true}) {
      std::optional<LocalClient> client(std::in_place, path());
      if (hello) {
        EXPECT_TRUE(client->Hello(session.token).has_welcome());
        EXPECT_TRUE(client->Call(MemoryMessage(1, 4), {fd.get()}).has_held());
      }
      ASSERT_TRUE(client->SendBytes(bytes, {fd.get(), fd.get(), fd.get()}));
      ExpectRefusedAndClosed(*client, why);
      EXPECT_EQ(session.memory->memories(), 0u);
    }
  }
  // An empty packet counts as the end of the connection.
  LocalClient empty = Joined(session);
  EXPECT_TRUE(empty.SendBytes("", {fd.get()}));
  EXPECT_FALSE(empty.Read().has_value());
  EXPECT_EQ(OpenDescriptors(), before + 1) << "its own socket";
}

TEST_F(LocalSocketTest, HelloIsDueInTime) {
  Start({.hello_limit_ns = 2 * sync::kSecond});
  const Tokens::Registered session = Register(1), other = Register(2);
  LocalClient joined = Joined(session), late(path()), silent(path());
  // They have been accepted by now: only then does their time begin.
  joined.RoundTrips();
  clock_.Advance(2 * sync::kSecond - 1);
  joined.RoundTrips();
  EXPECT_TRUE(late.Hello(other.token).has_welcome());
  EXPECT_FALSE(silent.CanRead());
  clock_.Advance(1);
  ExpectRefusedAndClosed(silent, "no hello came in time");
  clock_.Advance(3600 * sync::kSecond);
  joined.RoundTrips();
  late.RoundTrips();
}

TEST_F(LocalSocketTest, ThoseWithoutHelloAreLimited) {
  Start({.max_without_hello = 3});
  const Tokens::Registered sessions[] = {Register(1), Register(2), Register(3)};
  LocalClient joined = Joined(sessions[0]);
  LocalClient one(path()), two(path());
  std::optional<LocalClient> three(std::in_place, path());
  joined.RoundTrips();
  LocalClient four(path()), five(path());
  four.Send(HelloMessage(sessions[1].token));
  joined.RoundTrips();
  EXPECT_FALSE(four.CanRead()) << "waits to be accepted";
  three.reset();
  EXPECT_TRUE(four.Read()->has_welcome());
  EXPECT_TRUE(five.Hello(sessions[2].token).has_welcome());
  clock_.Advance(10 * sync::kSecond);
  EXPECT_TRUE(one.Read()->has_refused());
  EXPECT_TRUE(two.Read()->has_refused());
}

TEST_F(LocalSocketTest, TheConnectionsEndLetsItsMemoryGo) {
  Start();
  const Tokens::Registered session = Register(1), other = Register(2);
  const Descriptor fd = MakeMemfd("0123");
  LocalClient watcher = Joined(other);
  EXPECT_TRUE(watcher.Call(MemoryMessage(1, 4), {fd.get()}).has_held());
  {
    LocalClient client = Joined(session);
    EXPECT_TRUE(client.Call(MemoryMessage(1, 4), {fd.get()}).has_held());
    EXPECT_TRUE(client.Call(MemoryMessage(2, 4), {fd.get()}).has_held());
    EXPECT_EQ(session.memory->memories(), 2u);
  }
  watcher.RoundTrips();
  EXPECT_EQ(session.memory->memories(), 0u);
  EXPECT_EQ(other.memory->memories(), 1u);
  // The session can connect again.
  LocalClient again = Joined(session);
  EXPECT_TRUE(again.Call(MemoryMessage(1, 4), {fd.get()}).has_held());
}

TEST_F(LocalSocketTest, ANewerConnectionTakesTheOldersPlace) {
  Start();
  const Tokens::Registered session = Register(1), other = Register(2);
  const Descriptor fd = MakeMemfd("0123");
  LocalClient bystander = Joined(other);
  LocalClient older = Joined(session);
  EXPECT_TRUE(older.Call(MemoryMessage(1, 4), {fd.get()}).has_held());
  LocalClient newer = Joined(session);
  ExpectRefusedAndClosed(older, "has taken the place");
  EXPECT_EQ(session.memory->memories(), 0u);
  EXPECT_TRUE(newer.Call(MemoryMessage(1, 4), {fd.get()}).has_held());
  bystander.RoundTrips();
}

TEST_F(LocalSocketTest, TheSessionsEndEndsTheConnection) {
  LocalSocket& socket = Start();
  const Tokens::Registered other = Register(8);
  LocalSession session(&socket, 7);
  EXPECT_EQ(session.path(), path());
  EXPECT_EQ(session.token().size(), Tokens::kBytes);
  const Descriptor fd = MakeMemfd("0123");
  LocalClient client(path()), bystander = Joined(other);
  EXPECT_TRUE(client.Hello(session.token()).has_welcome());
  EXPECT_TRUE(client.Call(MemoryMessage(1, 4), {fd.get()}).has_held());
  const std::shared_ptr<const wire::MemorySource> memory = session.memory();
  const auto in_use = memory->Find(1, 0, 4);
  ASSERT_TRUE(in_use.ok());
  LocalSession moved = std::move(session);
  EXPECT_TRUE(memory->Find(1, 0, 4).ok());
  moved.Close();
  EXPECT_TRUE(absl::IsNotFound(memory->Find(1, 0, 4).status()));
  EXPECT_EQ(in_use->bytes, "0123");
  ExpectRefusedAndClosed(client, "the session has ended");
  LocalClient again(path());
  again.Send(HelloMessage(moved.token()));
  ExpectRefusedAndClosed(again, "that no open session has");
  bystander.RoundTrips();

  const LocalSession none(nullptr, 7);
  EXPECT_EQ(none.path(), "");
  EXPECT_EQ(none.token(), "");
  EXPECT_EQ(none.memory(), nullptr);
  LocalSession outlives(&socket, 9);
  socket_.reset();
  EXPECT_FALSE(bystander.Read().has_value());
  EXPECT_FALSE(std::filesystem::exists(path()));
}

TEST_F(LocalSocketTest, WhoDoesNotReadHoldsUpNobodyElse) {
  Start();
  const Tokens::Registered session = Register(1), other = Register(2);
  LocalClient deaf = Joined(session), bystander = Joined(other);
  uint64_t sent = 0;
  // Until the server has stopped reading, which is certain if that is still so after round trips.
  for (int full = 0; full < 3;) {
    if (deaf.Send(ReleaseMessage(sent))) {
      ++sent;
      full = 0;
    } else {
      bystander.RoundTrips();
      ++full;
    }
    ASSERT_LT(sent, 100'000u);
  }
  for (uint64_t i = 0; i < sent; ++i) {
    const std::optional<v1::LocalAnswer> answer = deaf.Read();
    ASSERT_TRUE(answer.has_value()) << i;
    EXPECT_EQ(answer->refused().id(), i) << "one answer to each, in order";
  }
  deaf.RoundTrips();
}

TEST_F(LocalSocketTest, OutOfDescriptorsItRefusesAndRecovers) {
  Start();
  const Tokens::Registered session = Register(1), other = Register(2);
  const Descriptor fd = MakeMemfd("0123");
  LocalClient client = Joined(session);
  LocalClient waiting(path());
  client.RoundTrips();
  const Descriptor made(socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
  sockaddr_un name = {};
  name.sun_family = AF_UNIX;
  path().copy(name.sun_path, sizeof(name.sun_path) - 1);
  const std::string hello = HelloMessage(other.token).SerializeAsString();
  {
    const NoDescriptors none;
    for (const std::vector<int>& fds : {std::vector<int>(1, fd.get()), {fd.get(), fd.get()}}) {
      EXPECT_THAT(client.Call(MemoryMessage(1, 4), fds).refused().message(),
                  HasSubstr("the server has none left"));
    }
    ASSERT_EQ(connect(made.get(), reinterpret_cast<const sockaddr*>(&name), sizeof(name)), 0);
    ASSERT_EQ(send(made.get(), hello.data(), hello.size(), 0), static_cast<ssize_t>(hello.size()));
    client.RoundTrips();
    pollfd ready = {made.get(), POLLIN, 0};
    EXPECT_EQ(poll(&ready, 1, 0), 0) << "no descriptor was left to accept it";
  }
  EXPECT_TRUE(client.Call(MemoryMessage(1, 4), {fd.get()}).has_held());
  pollfd ready = {made.get(), POLLIN, 0};
  ASSERT_EQ(poll(&ready, 1, 30'000), 1);
  char buffer[4096];
  v1::LocalAnswer answer;
  ASSERT_TRUE(
      answer.ParseFromArray(buffer, static_cast<int>(recv(made.get(), buffer, sizeof(buffer), 0))));
  EXPECT_TRUE(answer.has_welcome());
  EXPECT_TRUE(waiting.Hello(other.token).has_welcome());
}

TEST_F(LocalSocketTest, IsWhereNobodyListens) {
  Start();
  sync::FakeClock clock;
  const Address address = *ParseAddress("unix:" + path());
  const auto second = LocalSocket::Start(clock, {.listen = address});
  EXPECT_TRUE(absl::IsAlreadyExists(second.status())) << second.status();
  const Tokens::Registered session = Register(1);
  Joined(session).RoundTrips();

  // The socket left by a daemon that crashed is removed; a file that is not a socket is not.
  socket_.reset();
  const Descriptor left(socket(AF_UNIX, SOCK_SEQPACKET, 0));
  sockaddr_un name = {};
  name.sun_family = AF_UNIX;
  path().copy(name.sun_path, sizeof(name.sun_path) - 1);
  {
    const Descriptor dead(socket(AF_UNIX, SOCK_SEQPACKET, 0));
    ASSERT_EQ(bind(dead.get(), reinterpret_cast<const sockaddr*>(&name), sizeof(name)), 0);
  }
  ASSERT_TRUE(std::filesystem::exists(path()));
  Start();
  Joined(Register(1)).RoundTrips();
  socket_.reset();
  std::filesystem::create_directory(path());
  EXPECT_TRUE(absl::IsAlreadyExists(LocalSocket::Start(clock, {.listen = address}).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(
      LocalSocket::Start(clock, {.listen = *ParseAddress("127.0.0.1:0")}).status()));
}

}  // namespace
}  // namespace voxeld::daemon::local
