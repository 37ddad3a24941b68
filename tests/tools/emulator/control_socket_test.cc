#include "tools/emulator/control_socket.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "absl/strings/str_cat.h"
#include "gtest/gtest.h"
#include "tests/display/emulator/carriers/peer.h"
#include "tests/tools/emulator/emulator_process.h"

namespace voxeld::emulator {
namespace {

using display::emulator::Bytes;
using display::emulator::Peer;

Bytes FromText(const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

class ControlSocketTest : public testing::Test {
 protected:
  ControlSocketTest() : path_(folder_.path() + "/control") {
    absl::StatusOr<std::unique_ptr<ControlSocket>> socket = ControlSocket::Listen(path_);
    EXPECT_TRUE(socket.ok()) << socket.status();
    if (socket.ok()) socket_ = *std::move(socket);
  }
  void Serve() {
    socket_->Serve([this](std::string_view line) {
      lines_.emplace_back(line);
      return absl::StrCat("<", std::string(line), ">");
    });
  }

  TestFolder folder_;
  std::string path_;
  std::unique_ptr<ControlSocket> socket_;
  std::vector<std::string> lines_;
};

TEST_F(ControlSocketTest, AnswersEachWholeLineToWhoSentIt) {
  Peer one(Connect(path_)), two(Connect(path_));
  one.Send(FromText("a\nbb"));
  two.Send(FromText("c\n"));
  Serve();
  EXPECT_EQ(one.Take(), FromText("<a>\n"));
  EXPECT_EQ(two.Take(), FromText("<c>\n"));
  one.Send(FromText("b\n\n"));
  Serve();
  EXPECT_EQ(one.Take(), FromText("<bbb>\n<>\n"));
}

TEST_F(ControlSocketTest, ALineWithoutAnEndIsCutOff) {
  Peer peer(Connect(path_));
  peer.Send(Bytes(64 << 10, std::byte{'x'}));
  Serve();
  EXPECT_TRUE(lines_.empty());
  std::vector<pollfd> fds;
  socket_->AddTo(fds);
  EXPECT_EQ(fds.size(), 1u);  // only the listening socket
}

TEST_F(ControlSocketTest, WhoLeavesIsForgotten) {
  Peer peer(Connect(path_));
  Serve();
  std::vector<pollfd> fds;
  socket_->AddTo(fds);
  EXPECT_EQ(fds.size(), 2u);
  peer.Close();
  Serve();
  fds.clear();
  socket_->AddTo(fds);
  EXPECT_EQ(fds.size(), 1u);
}

// Its answers are more than a socket can hold.
TEST_F(ControlSocketTest, WhoTakesNoAnswersIsCutOff) {
  Peer peer(Connect(path_));
  std::vector<pollfd> fds;
  const std::string many(2000, '\n');
  for (int i = 0; i < 2000 && peer.Send(FromText(many)) > 0; ++i) {
    socket_->Serve([](std::string_view) { return std::string(1000, 'y'); });
  }
  fds.clear();
  socket_->AddTo(fds);
  EXPECT_EQ(fds.size(), 1u);
}

TEST_F(ControlSocketTest, APathIsTakenOnceAndRemoved) {
  EXPECT_TRUE(absl::IsAlreadyExists(ControlSocket::Listen(path_).status()));
  socket_ = nullptr;
  EXPECT_FALSE(std::filesystem::exists(path_));
  EXPECT_TRUE(ControlSocket::Listen(path_).ok());
}

TEST(ControlSocketPath, TooLongOrNowhere) {
  EXPECT_TRUE(absl::IsInvalidArgument(ControlSocket::Listen(std::string(200, 'p')).status()));
  EXPECT_TRUE(absl::IsUnavailable(ControlSocket::Listen("/nowhere/at/all").status()));
}

}  // namespace
}  // namespace voxeld::emulator
