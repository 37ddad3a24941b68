// A local socket in this process, in a folder of its own, under a clock that stands still.
#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include "daemon/local/local_socket.h"
#include "display/sync/fake_clock.h"
#include "tests/daemon/local/local_client.h"

namespace voxeld::daemon::local {

class LocalSocketTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = (std::filesystem::temp_directory_path() / "voxeld-local-XXXXXX").string();
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
  }
  void TearDown() override {
    socket_.reset();
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }

  std::string path() const { return folder_ + "/voxeld.sock.local"; }

  LocalSocket& Start(LocalSocketOptions options = {}) {
    options.listen = *ParseAddress("unix:" + path());
    auto started = LocalSocket::Start(clock_, std::move(options));
    EXPECT_TRUE(started.ok()) << started.status();
    socket_ = *std::move(started);
    return *socket_;
  }

  Tokens::Registered Register(SessionId session) { return *socket_->tokens()->Register(session); }

  // Returns a connection that has sent Hello.
  LocalClient Joined(const Tokens::Registered& session) {
    LocalClient client(path());
    EXPECT_TRUE(client.Hello(session.token).has_welcome());
    return client;
  }

  sync::FakeClock clock_;
  std::unique_ptr<LocalSocket> socket_;

 private:
  std::string folder_;
};

}  // namespace voxeld::daemon::local
