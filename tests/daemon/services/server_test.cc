// Tests the server itself: addresses, health, reflection, shutdown.
#include "daemon/services/server.h"

#include <gmock/gmock.h>
#include <grpcpp/generic/generic_stub.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <future>

#include "absl/strings/str_cat.h"
#include "display/sync/mutex.h"
#include "tests/daemon/services/daemon_fixture.h"

namespace voxeld::daemon::services {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

grpc::ByteBuffer Buffer(const std::string& bytes) {
  const grpc::Slice slice(bytes);
  return grpc::ByteBuffer(&slice, 1);
}

std::string Bytes(const grpc::ByteBuffer& buffer) {
  std::vector<grpc::Slice> slices;
  EXPECT_TRUE(buffer.Dump(&slices).ok());
  std::string bytes;
  for (const grpc::Slice& slice : slices) {
    bytes.append(reinterpret_cast<const char*>(slice.begin()), slice.size());
  }
  return bytes;
}

// Calls a method of a service for which this project has no stubs, with raw messages.
grpc::Status RawCall(const std::shared_ptr<grpc::Channel>& channel, const std::string& method,
                     const std::string& request, std::string* response) {
  grpc::GenericStub stub(channel);
  grpc::ClientContext context;
  SetDeadline(context);
  const grpc::ByteBuffer in = Buffer(request);
  grpc::ByteBuffer out;
  std::promise<grpc::Status> done;
  stub.UnaryCall(&context, method, grpc::StubOptions(), &in, &out,
                 [&done](grpc::Status status) { done.set_value(std::move(status)); });
  const grpc::Status status = done.get_future().get();
  if (status.ok()) *response = Bytes(out);
  return status;
}

// grpc.health.v1: {1: service}, answered by {1: status}; 1 is serving, 2 is not serving.
std::string HealthRequest(const std::string& service) {
  std::string request = {'\x0a', static_cast<char>(service.size())};
  return request.append(service);
}

constexpr const char* kServing = "\x08\x01";
constexpr const char* kNotServing = "\x08\x02";

TEST(Health, KnowsEachServiceAndTheWhole) {
  Daemon daemon;
  for (const char* service : {"", "voxeld.v1.SceneService", "voxeld.v1.DisplayService"}) {
    std::string answer;
    const grpc::Status status = RawCall(daemon.NewChannel(), "/grpc.health.v1.Health/Check",
                                        HealthRequest(service), &answer);
    EXPECT_TRUE(status.ok()) << status.error_message();
    EXPECT_EQ(answer, kServing) << service;
  }
  std::string answer;
  EXPECT_EQ(
      RawCall(daemon.NewChannel(), "/grpc.health.v1.Health/Check", HealthRequest("nobody"), &answer)
          .error_code(),
      grpc::StatusCode::NOT_FOUND);
}

// Collects the messages of a server stream.
class Watch final : public grpc::ClientBidiReactor<grpc::ByteBuffer, grpc::ByteBuffer> {
 public:
  Watch(const std::shared_ptr<grpc::Channel>& channel, const std::string& method,
        const std::string& request)
      : stub_(channel), request_(Buffer(request)) {
    SetDeadline(context_);
    stub_.PrepareBidiStreamingCall(&context_, method, grpc::StubOptions(), this);
    StartWriteLast(&request_, grpc::WriteOptions());
    StartRead(&response_);
    StartCall();
  }
  void OnReadDone(bool ok) override {
    if (!ok) return;
    {
      sync::MutexLock lock(mutex_);
      answers_.push_back(Bytes(response_));
      changed_.NotifyAll();
    }
    StartRead(&response_);
  }
  void OnDone(const grpc::Status&) override {
    sync::MutexLock lock(mutex_);
    done_ = true;
    changed_.NotifyAll();
  }
  void AwaitAnswer() {
    sync::MutexLock lock(mutex_);
    while (answers_.empty() && !done_) changed_.Wait(mutex_);
  }
  std::vector<std::string> AwaitDone() {
    sync::MutexLock lock(mutex_);
    while (!done_) changed_.Wait(mutex_);
    return answers_;
  }

 private:
  grpc::GenericStub stub_;
  grpc::ClientContext context_;
  grpc::ByteBuffer request_, response_;
  sync::Mutex mutex_;
  sync::CondVar changed_;
  std::vector<std::string> answers_ VOXELD_GUARDED_BY(mutex_);
  bool done_ VOXELD_GUARDED_BY(mutex_) = false;
};

TEST(Health, IsNotServingWhileDraining) {
  Daemon daemon;
  Watch watch(daemon.NewChannel(), "/grpc.health.v1.Health/Watch",
              HealthRequest("voxeld.v1.SceneService"));
  watch.AwaitAnswer();
  daemon.server().Shutdown(200 * sync::kMillisecond);
  EXPECT_THAT(watch.AwaitDone(), ElementsAre(kServing, kNotServing));
}

// Keeps the core's thread busy until it is released.
class BusyCore {
 public:
  explicit BusyCore(Core& core) {
    core.GetStats([busy = &busy_, go = go_.get_future().share()](const absl::StatusOr<Stats>&) {
      busy->set_value();
      go.wait();
    });
    busy_.get_future().wait();
  }
  void LetGo() { go_.set_value(); }

 private:
  std::promise<void> busy_, go_;
};

TEST(Shutdown, DoesNotWaitForABusyCore) {
  Daemon daemon({.drain_limit_ns = 3600 * sync::kSecond});
  Client client(daemon.scene());
  client.Open();
  BusyCore busy(daemon.core());
  client.Send(SphereIn("layer", "ball"));
  client.Commit(1);
  const std::shared_ptr<grpc::Channel> channel = daemon.NewChannel();
  const auto scene = v1::SceneService::NewStub(channel);
  grpc::ClientContext context;
  SetDeadline(context);
  v1::ApplyUpdateRequest request;
  *request.add_operations() = SphereIn("layer", "ball");
  v1::ApplyUpdateResponse response;
  std::promise<grpc::Status> updated;
  scene->async()->ApplyUpdate(&context, &request, &response,
                              [&](grpc::Status status) { updated.set_value(std::move(status)); });
  std::string answer;  // on the same connection, so the update has arrived too
  ASSERT_TRUE(RawCall(channel, "/grpc.health.v1.Health/Check", HealthRequest(""), &answer).ok());

  daemon.server().Shutdown(100 * sync::kMillisecond);
  EXPECT_EQ(updated.get_future().get().error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_FALSE(client.Finish().ok());
  busy.LetGo();
}

TEST(Reflection, ListsTheServices) {
  Daemon daemon;
  std::string answer;
  const grpc::Status status =
      RawCall(daemon.NewChannel(), "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
              "\x3a\x01*", &answer);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_THAT(answer, HasSubstr("voxeld.v1.SceneService"));
  EXPECT_THAT(answer, HasSubstr("voxeld.v1.DisplayService"));
  EXPECT_THAT(answer, HasSubstr("grpc.health.v1.Health"));
}

class Addresses : public ::testing::Test {
 protected:
  Addresses() : core_({.version = "1"}, clock_) {
    folder_ = (std::filesystem::temp_directory_path() / "voxeld-test-XXXXXX").string();
    EXPECT_NE(mkdtemp(folder_.data()), nullptr);
    EXPECT_TRUE(core_.Start().ok());
  }
  ~Addresses() override {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }

  absl::StatusOr<std::unique_ptr<Server>> Start(const std::vector<std::string>& texts) {
    ServerOptions options;
    for (const std::string& text : texts) options.listen.push_back(*ParseAddress(text));
    return Server::Start(core_, clock_, std::move(options));
  }

  bool Serves(const std::string& target) {
    std::string answer;
    return RawCall(grpc::CreateChannel(target, grpc::InsecureChannelCredentials()),
                   "/grpc.health.v1.Health/Check", HealthRequest(""), &answer)
        .ok();
  }

  sync::SystemClock clock_;
  Core core_;
  std::string folder_;
};

TEST_F(Addresses, SeveralAtOnce) {
  const auto server = Start({"127.0.0.1:0", absl::StrCat("unix:", folder_, "/new/a.sock")});
  ASSERT_TRUE(server.ok()) << server.status();
  ASSERT_EQ((*server)->addresses().size(), 2u);
  EXPECT_NE((*server)->addresses()[0].port, 0);
  for (const Address& address : (*server)->addresses()) EXPECT_TRUE(Serves(address.ToString()));
  struct stat found;
  ASSERT_EQ(stat((folder_ + "/new/a.sock").c_str(), &found), 0);
  EXPECT_EQ(found.st_mode & 07777, 0660u);
  ASSERT_EQ(stat((folder_ + "/new").c_str(), &found), 0);
  EXPECT_EQ(found.st_mode & 07777, 0700u);
}

TEST_F(Addresses, BusyOnesAreErrors) {
  const auto first = Start({"127.0.0.1:0", absl::StrCat("unix:", folder_, "/a.sock")});
  ASSERT_TRUE(first.ok()) << first.status();
  for (const Address& address : (*first)->addresses()) {
    const auto second = Start({address.ToString()});
    EXPECT_TRUE(absl::IsAlreadyExists(second.status())) << second.status();
    EXPECT_THAT(std::string(second.status().message()), HasSubstr(address.ToString()));
    EXPECT_TRUE(Serves(address.ToString())) << "the first continues";
  }
}

TEST_F(Addresses, ALeftOverSocketIsReplacedAndNothingElse) {
  const std::string path = folder_ + "/left.sock";
  const int left = socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un name = {};
  name.sun_family = AF_UNIX;
  std::memcpy(name.sun_path, path.c_str(), path.size());
  ASSERT_EQ(bind(left, reinterpret_cast<sockaddr*>(&name), sizeof(name)), 0);
  close(left);  // the file stays
  const auto server = Start({absl::StrCat("unix:", path)});
  ASSERT_TRUE(server.ok()) << server.status();
  EXPECT_TRUE(Serves(absl::StrCat("unix:", path)));

  const std::string precious = folder_ + "/precious";
  std::ofstream(precious) << "text";
  const auto refused = Start({absl::StrCat("unix:", precious)});
  EXPECT_TRUE(absl::IsAlreadyExists(refused.status())) << refused.status();
  EXPECT_EQ(std::filesystem::file_size(precious), 4u);
}

TEST_F(Addresses, OnesThatCannotBeHadSayWhy) {
  EXPECT_TRUE(absl::IsInvalidArgument(Start({}).status()));
  const auto unknown = Start({"no-such-host.invalid:1"});
  EXPECT_TRUE(absl::IsInvalidArgument(unknown.status())) << unknown.status();
  EXPECT_THAT(std::string(unknown.status().message()), HasSubstr("no-such-host.invalid"));
  const auto elsewhere = Start({"192.0.2.1:50551"});  // an address of no machine
  EXPECT_FALSE(elsewhere.ok());
  EXPECT_THAT(std::string(elsewhere.status().message()), HasSubstr("192.0.2.1:50551"));
}

}  // namespace
}  // namespace voxeld::daemon::services
