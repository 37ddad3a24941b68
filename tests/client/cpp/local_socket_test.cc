// Tests content in sealed memory: with the real daemon, and with local sockets that misbehave.
#include "client/cpp/src/local_socket.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <functional>
#include <thread>

#include "display/sync/mutex.h"
#include "tests/daemon/services/daemon_fixture.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "voxeld/client.h"
#include "voxeld/v1/local.pb.h"

namespace voxeld::client {
namespace local_socket_test {

using namespace std::chrono_literals;  // NOLINT
using Answer = MemoryChannel::Answer;

constexpr auto kPatience = 60s;
constexpr size_t kVertices = 100'000;

Vertices Cloud(size_t count = kVertices) {
  std::vector<float> positions(3 * count);
  for (size_t i = 0; i < positions.size(); ++i) positions[i] = static_cast<float>(i % 1000) / 1000;
  return {.positions = std::move(positions), .colors = std::vector<uint8_t>(3 * count, 9)};
}

class WithMemory : public testing::Test {
 protected:
  explicit WithMemory(bool local_socket = true) : daemon_({.local_socket = local_socket}) {}
  std::unique_ptr<Session> Open(Options options = {}) {
    options.address = daemon_.target();
    options.strict = true;
    auto session = Session::Open(std::move(options));
    EXPECT_TRUE(session.ok()) << session.status();
    EXPECT_TRUE((*session)->WaitOpened(kPatience).ok());
    return *std::move(session);
  }
  static void Accept(Session& session) {
    const auto frame = session.Commit();
    ASSERT_TRUE(frame.ok()) << frame.status();
    const auto receipt = session.WaitAccepted(*frame, kPatience);
    ASSERT_TRUE(receipt.ok()) << receipt.status();
  }
  bool NothingIsHeld() {
    return daemon_.Await([](const v1::Stats& stats) { return stats.memory().local_bytes() == 0; });
  }

  daemon::services::Daemon daemon_;
};

TEST_F(WithMemory, EveryKindOfContentArrives) {
  auto session = Open();
  const Layer layer = session->GetLayer("l");
  ASSERT_TRUE(layer.Put("points", Points{.vertices = Cloud()}).ok());
  ASSERT_TRUE(layer.Put("between", Box{}).ok());
  Vertices triangles = Cloud(30'000);
  std::vector<uint32_t> indices(90'000);
  for (size_t i = 0; i < indices.size(); ++i)
    indices[i] = static_cast<uint32_t>(i / 3 + i % 3) % 30'000;
  triangles.indices = std::move(indices);
  ASSERT_TRUE(layer.Put("mesh", Mesh{.vertices = triangles}).ok());
  ASSERT_TRUE(session->DefineObject("o", {{.shape = Segments{.vertices = Cloud()}}}).ok());
  ASSERT_TRUE(layer.Put("instance", Instance{"o"}).ok());
  Accept(*session);
  const v1::ListEntitiesResponse all = daemon_.Entities();
  std::map<std::string, uint64_t> vertices;
  for (const v1::EntityInfo& entity : all.entities())
    vertices[entity.key().id()] = entity.vertices();
  EXPECT_EQ(vertices["points"], kVertices);
  EXPECT_EQ(vertices["mesh"], 30'000u);
  const Tally tally = session->GetTally();
  EXPECT_EQ(tally.memory_bytes, 2 * kVertices * 15 + 30'000 * 15 + 360'000);
  EXPECT_LT(tally.bytes_sent, 10'000u);
  EXPECT_EQ(tally.issue_count, 0u);
  EXPECT_TRUE(NothingIsHeld());
}

// The same image, uploaded in both ways, is the same content.
TEST_F(WithMemory, ItIsTheSameAsThatOfTheStream) {
  ASSERT_TRUE(daemon_.Await(daemon::services::AllShowing));
  std::vector<std::string> pictures;
  for (const bool local_memory : {true, false}) {
    auto session = Open({.local_memory = local_memory});
    ASSERT_TRUE(session->GetLayer("l").Put("a", Points{.vertices = Cloud()}).ok());
    const auto frame = session->Commit();
    const auto shown = session->WaitShown(*frame, kPatience);
    ASSERT_TRUE(shown.ok()) << shown.status();
    EXPECT_EQ(session->GetTally().memory_bytes > 0, local_memory);
    v1::CaptureVolumeRequest request;
    request.set_at_least_snapshot(shown->snapshot);
    grpc::ClientContext context;
    daemon::services::SetDeadline(context);
    const auto chunks = daemon_.displays().CaptureVolume(&context, request);
    std::string& picture = pictures.emplace_back();
    for (v1::VolumeChunk chunk; chunks->Read(&chunk);) picture += chunk.slices().rgb();
    EXPECT_TRUE(chunks->Finish().ok());
    EXPECT_NE(picture.find_first_not_of('\0'), std::string::npos) << "something is lit";
    EXPECT_TRUE(session->Close(kPatience).ok());
  }
  EXPECT_TRUE(pictures[0] == pictures[1]);
}

TEST_F(WithMemory, ManyFramesInMoreMemoryThanIsHeldAtOnce) {
  auto session = Open();
  const Layer layer = session->GetLayer("l");
  constexpr int kFrames = 600;  // at most 256 memories are held at once
  for (int i = 0; i < kFrames; ++i) {
    Frame frame = layer.BeginFrame();
    frame.Draw("a", Points{.vertices = Cloud(6'000)});
    auto number = frame.Commit();
    for (; absl::IsResourceExhausted(number.status()); number = frame.Commit())
      ASSERT_TRUE(session->WaitForRoom(kPatience).ok());
    ASSERT_TRUE(number.ok()) << number.status();
  }
  ASSERT_TRUE(session->WaitSettled(kPatience).ok());
  const Tally tally = session->GetTally();
  EXPECT_EQ(tally.accepted, static_cast<uint64_t>(kFrames));
  EXPECT_EQ(tally.refused_operations + tally.issue_count, 0u);
  EXPECT_GT(tally.memory_bytes, 0u);
  EXPECT_TRUE(NothingIsHeld());
}

class WithoutMemory : public WithMemory {
 protected:
  WithoutMemory() : WithMemory(false) {}
};

TEST_F(WithoutMemory, ItGoesOverTheStream) {
  auto session = Open();
  ASSERT_TRUE(session->GetLayer("l").Put("a", Points{.vertices = Cloud()}).ok());
  Accept(*session);
  EXPECT_EQ(session->GetTally().memory_bytes, 0u);
  EXPECT_EQ(daemon_.Entities().entities(0).vertices(), kVertices);
}

// A local socket that answers as the test specifies.
class Peer {
 public:
  // Returning nullopt ends the connection; an empty answer sends none.
  using Script = std::function<std::optional<v1::LocalAnswer>(const v1::LocalMessage&, int memory)>;

  Peer(const std::string& path, Script script) : script_(std::move(script)) {
    listening_ = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.copy(address.sun_path, sizeof(address.sun_path) - 1);
    EXPECT_EQ(bind(listening_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    EXPECT_EQ(listen(listening_, 4), 0);
    thread_ = std::thread([this] { Serve(); });
  }
  // Runs after the channel has ended.
  ~Peer() {
    shutdown(listening_, SHUT_RDWR);
    thread_.join();
    close(listening_);
  }

 private:
  void Serve() {
    const int connection = accept(listening_, nullptr, nullptr);
    if (connection < 0) return;
    while (const std::optional<v1::LocalAnswer> answer = Take(connection)) {
      if (answer->what_case() == v1::LocalAnswer::WHAT_NOT_SET) continue;
      const std::string packet = answer->SerializeAsString();
      send(connection, packet.data(), packet.size(), MSG_NOSIGNAL);
    }
    close(connection);
  }

  std::optional<v1::LocalAnswer> Take(int connection) {
    std::array<char, 4096> bytes;
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> control{};
    iovec part{.iov_base = bytes.data(), .iov_len = bytes.size()};
    msghdr received{};
    received.msg_iov = &part;
    received.msg_iovlen = 1;
    received.msg_control = control.data();
    received.msg_controllen = control.size();
    const ssize_t size = recvmsg(connection, &received, MSG_CMSG_CLOEXEC);
    if (size <= 0) return std::nullopt;
    int memory = -1;
    if (const cmsghdr* head = CMSG_FIRSTHDR(&received); head != nullptr)
      std::memcpy(&memory, CMSG_DATA(head), sizeof memory);
    v1::LocalMessage message;
    EXPECT_TRUE(message.ParseFromArray(bytes.data(), static_cast<int>(size)));
    EXPECT_EQ(message.has_memory(), memory >= 0);
    std::optional<v1::LocalAnswer> answer = script_(message, memory);
    if (memory >= 0) close(memory);
    return answer;
  }

  const Script script_;
  int listening_ = -1;
  std::thread thread_;
};

v1::LocalAnswer Welcome(uint32_t memories = 8, uint64_t bytes = 1 << 20) {
  v1::LocalAnswer answer;
  answer.mutable_welcome()->set_max_memories(memories);
  answer.mutable_welcome()->set_max_bytes(bytes);
  return answer;
}
v1::LocalAnswer Held(uint64_t id) {
  v1::LocalAnswer answer;
  answer.mutable_held()->set_id(id);
  return answer;
}
v1::LocalAnswer Refused(uint64_t id) {
  v1::LocalAnswer answer;
  answer.mutable_refused()->set_id(id);
  return answer;
}
v1::LocalAnswer Welcoming(const v1::LocalMessage& message) {
  if (message.has_hello()) return Welcome();
  if (message.has_memory()) return Held(message.memory().id());
  v1::LocalAnswer answer;
  answer.mutable_released()->set_id(message.release().id());
  return answer;
}

class Channel : public testing::Test, protected MemoryChannel::Events {
 protected:
  std::string path() const { return folder_.Path("local"); }
  void Connect() { channel_ = ConnectLocalSocket(path(), "token", this); }
  // Holds content of `bytes` bytes.
  Answer Hold(uint64_t id, size_t bytes = 1000) { return Hold(id, Rope(std::string(bytes, 'x'))); }
  Answer Hold(uint64_t id, Rope content) {
    channel_->Hold(id, std::move(content));
    sync::MutexLock lock(mutex_);
    while (!answer_) changed_.Wait(mutex_);
    EXPECT_EQ(answered_, id);
    return *std::exchange(answer_, std::nullopt);
  }
  void OnHold(uint64_t id, Answer answer) override {
    sync::MutexLock lock(mutex_);
    answered_ = id;
    answer_ = answer;
    changed_.NotifyAll();
  }

  voxelctl::TempFolder folder_;
  std::unique_ptr<MemoryChannel> channel_;

 private:
  sync::Mutex mutex_;
  sync::CondVar changed_;
  uint64_t answered_ VOXELD_GUARDED_BY(mutex_) = 0;
  std::optional<Answer> answer_ VOXELD_GUARDED_BY(mutex_);
};

TEST_F(Channel, MemoryIsSealedAndHasTheContent) {
  std::string token, content;
  int seals = 0;
  auto peer = std::make_unique<Peer>(path(), [&](const v1::LocalMessage& message, int memory) {
    if (message.has_hello()) token = message.hello().token();
    if (memory >= 0) {
      seals = fcntl(memory, F_GET_SEALS);
      content.resize(message.memory().size() + 1);
      const ssize_t size = pread(memory, content.data(), content.size(), 0);
      content.resize(static_cast<size_t>(std::max<ssize_t>(size, 0)));
    }
    return std::optional(Welcoming(message));
  });
  Connect();
  Rope rope(std::string("head, "));
  const auto owned = std::make_shared<const std::string>(100'000, 'y');
  rope.AppendShared(owned, *owned);
  rope.Append(", tail");
  EXPECT_EQ(Hold(7, rope), Answer::kHeld);
  channel_.reset();
  peer.reset();
  EXPECT_EQ(token, "token");
  EXPECT_TRUE(content == "head, " + *owned + ", tail");
  EXPECT_EQ(seals & (F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE),
            F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE);
}

TEST_F(Channel, WhereThereIsNobodyNothingIsHeld) {
  Connect();
  EXPECT_EQ(Hold(1), Answer::kGone);
  EXPECT_EQ(Hold(2), Answer::kGone);
  channel_ = ConnectLocalSocket(std::string(200, 'x'), "token", this);
  EXPECT_EQ(Hold(1), Answer::kGone) << "a socket cannot have such a path";
}

TEST_F(Channel, WhoIsNotWelcomeHoldsNothing) {
  Peer peer(path(), [](const v1::LocalMessage&, int) { return std::optional(Refused(0)); });
  Connect();
  EXPECT_EQ(Hold(1), Answer::kGone);
  channel_.reset();
}

TEST_F(Channel, ARefusalIsOfOneMemory) {
  Peer peer(path(), [](const v1::LocalMessage& message, int) {
    return std::optional(message.memory().id() == 1 ? Refused(1) : Welcoming(message));
  });
  Connect();
  EXPECT_EQ(Hold(1), Answer::kRefused);
  EXPECT_EQ(Hold(2), Answer::kHeld);
  channel_.reset();
}

TEST_F(Channel, ItKeepsToTheLimitsThatItIsTold) {
  Peer peer(path(), [](const v1::LocalMessage& message, int) {
    return std::optional(message.has_hello() ? Welcome(2, 10'000) : Welcoming(message));
  });
  Connect();
  EXPECT_EQ(Hold(1, 10'001), Answer::kNoRoom);
  EXPECT_EQ(Hold(2, 9'000), Answer::kHeld);
  EXPECT_EQ(Hold(3, 1'001), Answer::kNoRoom);
  EXPECT_EQ(Hold(4, 1'000), Answer::kHeld);
  channel_->Release(2);
  EXPECT_EQ(Hold(5, 1), Answer::kHeld);
  EXPECT_EQ(Hold(6, 1), Answer::kNoRoom) << "two are held";
  channel_.reset();
}

TEST_F(Channel, AnEndInTheMiddleIsTheEnd) {
  Peer peer(path(), [](const v1::LocalMessage& message, int) {
    return message.memory().id() == 2 ? std::nullopt : std::optional(Welcoming(message));
  });
  Connect();
  EXPECT_EQ(Hold(1), Answer::kHeld);
  EXPECT_EQ(Hold(2), Answer::kGone);
  EXPECT_EQ(Hold(3), Answer::kGone);
  channel_->Release(1);
  channel_.reset();
}

TEST_F(Channel, WhoDoesNotAnswerIsGivenUp) {
  Peer peer(path(), [](const v1::LocalMessage& message, int) {
    return std::optional(message.has_hello() ? Welcome() : v1::LocalAnswer());
  });
  Connect();
  EXPECT_EQ(Hold(1), Answer::kGone);
  channel_.reset();
}

}  // namespace local_socket_test
}  // namespace voxeld::client
