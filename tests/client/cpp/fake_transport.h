// A transport whose other end is the test, in one thread: it records what is written, and the test
// supplies the server's answers.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "client/cpp/src/session_core.h"
#include "client/cpp/src/transport.h"
#include "display/sync/fake_clock.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::client {

class FakeStream final : public Stream {
 public:
  explicit FakeStream(Stream::Events* events, std::vector<FakeStream*>* list)
      : events(events), list_(list) {}
  ~FakeStream() override;
  void Write(const Rope& message) override;
  void WritesDone() override { half_closed = true; }
  void Cancel() override { cancelled = true; }

  Stream::Events* const events;
  std::vector<v1::StreamRequest> written;
  uint64_t bytes = 0;
  bool writing = false, half_closed = false, cancelled = false;

 private:
  std::vector<FakeStream*>* const list_;
};

// Memory whose Holds are granted or not, as the test decides.
class FakeMemory final : public MemoryChannel {
 public:
  FakeMemory(MemoryChannel::Events* events, FakeMemory** place) : events_(events), place_(place) {
    *place_ = this;
  }
  ~FakeMemory() override {
    if (*place_ == this) *place_ = nullptr;
  }
  void Hold(uint64_t id, Rope content) override { held.emplace_back(id, content.Flat()); }
  void Release(uint64_t id) override { released.push_back(id); }
  // Answers the newest Hold.
  void Answer(MemoryChannel::Answer answer) { events_->OnHold(held.back().first, answer); }

  std::vector<std::pair<uint64_t, std::string>> held;
  std::vector<uint64_t> released;

 private:
  MemoryChannel::Events* const events_;
  FakeMemory** const place_;
};

class FakeTransport final : public Transport {
 public:
  std::unique_ptr<Stream> Start(Stream::Events* events) override;
  std::unique_ptr<MemoryChannel> OpenMemory(const std::string& path, const std::string& token,
                                            MemoryChannel::Events* events) override {
    memory_path = path + " " + token;
    return std::make_unique<FakeMemory>(events, &memory);
  }
  FakeMemory* memory = nullptr;  // the newest, if it still exists
  std::string memory_path;       // and its token
  // The streams that still exist, in the order of their starts.
  std::vector<FakeStream*> streams;
  uint64_t started = 0;
};

// A session over the fake transport, with a clock that stands still.
class SessionUnderTest {
 public:
  explicit SessionUnderTest(Options options = {});
  ~SessionUnderTest();

  SessionCore& operator*() { return *core_; }
  SessionCore* operator->() { return core_.get(); }
  FakeStream& stream() { return *transport_->streams.back(); }
  FakeMemory* memory() { return transport_->memory; }
  const std::string& memory_path() const { return transport_->memory_path; }
  bool connected() const { return !transport_->streams.empty(); }
  uint64_t started() const { return transport_->started; }
  sync::FakeClock& clock() { return clock_; }

  // Steps the session, and lets writes complete, until nothing more happens.
  void Settle();
  void Advance(sync::TimeNs by) {
    clock_.Advance(by);
    Settle();
  }
  void Say(const v1::StreamResponse& response);
  void SayOpened(uint64_t credit_bytes = 0, const std::string& token = "token");
  void SayOpened(const v1::Opened& opened);
  void SayAccepted(uint64_t frame, const std::vector<std::string>& displays = {});
  void SayRefused(uint64_t frame, const std::string& message);
  void SayPresented(uint64_t frame, const std::string& display);
  // Sends an Issue for the newest stream's request `index`; Open is request 0.
  void SayIssue(size_t index, const std::string& layer, const std::string& id);
  void End(const absl::Status& status);

  // Inserts a sphere with this id and commits it.
  uint64_t Put(const std::string& id);
  // Commits a draw batch of one sphere.
  absl::StatusOr<uint64_t> DrawFrame(const std::string& layer);

  // Returns what was written to the newest stream since the last call: "open", "layer/id …", "begin
  // layer", "commit 3" and so on.
  std::vector<std::string> TakeWords();

 private:
  sync::FakeClock clock_;
  FakeTransport* transport_;
  std::unique_ptr<SessionCore> core_;
  uint64_t told_ = 0;  // the stream whose words were taken last
  size_t told_count_ = 0;
};

}  // namespace voxeld::client
