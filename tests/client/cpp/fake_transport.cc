#include "tests/client/cpp/fake_transport.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "client/cpp/src/encode.h"

namespace voxeld::client {

FakeStream::~FakeStream() { std::erase(*list_, this); }

void FakeStream::Write(const Rope& message) {
  EXPECT_FALSE(writing) << "one at a time";
  EXPECT_FALSE(half_closed);
  writing = true;
  bytes += message.size();
  EXPECT_TRUE(written.emplace_back().ParseFromString(message.Flat()));
}

std::unique_ptr<Stream> FakeTransport::Start(Stream::Events* events) {
  auto stream = std::make_unique<FakeStream>(events, &streams);
  streams.push_back(stream.get());
  ++started;
  return stream;
}

SessionUnderTest::SessionUnderTest(Options options) {
  if (options.address.empty()) options.address = "there:1";
  auto transport = std::make_unique<FakeTransport>();
  transport_ = transport.get();
  core_ = std::make_unique<SessionCore>(std::move(options), std::move(transport), clock_);
  Settle();
}

SessionUnderTest::~SessionUnderTest() {
  if (connected()) End(absl::UnavailableError("the test is over"));
  core_->Stop();
}

void SessionUnderTest::Settle() {
  for (bool again = true; again;) {
    core_->Step();
    again = connected() && std::exchange(stream().writing, false);
    if (again) stream().events->OnWritten();
  }
}

void SessionUnderTest::Say(const v1::StreamResponse& response) {
  stream().events->OnRead(response);
  Settle();
}

void SessionUnderTest::SayOpened(uint64_t credit_bytes, const std::string& token) {
  v1::Opened opened;
  opened.set_credit_bytes(credit_bytes);
  opened.set_resume_token(token);
  opened.add_displays("sim");
  SayOpened(opened);
}

void SessionUnderTest::SayOpened(const v1::Opened& opened) {
  v1::StreamResponse response;
  *response.mutable_opened() = opened;
  Say(response);
}

void SessionUnderTest::SayAccepted(uint64_t frame, const std::vector<std::string>& displays) {
  v1::StreamResponse response;
  v1::Receipt* receipt = response.add_receipts();
  receipt->set_frame_id(frame);
  receipt->mutable_accepted();
  for (const std::string& display : displays) receipt->mutable_accepted()->add_displays(display);
  Say(response);
}

void SessionUnderTest::SayRefused(uint64_t frame, const std::string& message) {
  v1::StreamResponse response;
  v1::Receipt* receipt = response.add_receipts();
  receipt->set_frame_id(frame);
  receipt->mutable_refused()->set_message(message);
  Say(response);
}

void SessionUnderTest::SayPresented(uint64_t frame, const std::string& display) {
  v1::StreamResponse response;
  v1::Receipt* receipt = response.add_receipts();
  receipt->set_frame_id(frame);
  receipt->mutable_outcome()->set_display(display);
  receipt->mutable_outcome()->mutable_presented();
  Say(response);
}

void SessionUnderTest::SayIssue(size_t index, const std::string& layer, const std::string& id) {
  v1::StreamResponse response;
  v1::Issue* issue = response.add_issues();
  issue->set_sequence(stream().written.at(index).sequence());
  issue->set_layer(layer);
  issue->set_id(id);
  Say(response);
}

void SessionUnderTest::End(const absl::Status& status) {
  stream().events->OnEnd(status);
  core_->Step();
  Settle();
}

uint64_t SessionUnderTest::Put(const std::string& id) {
  EXPECT_TRUE(core_->StageUpsert("l", id, Sphere{}, {}).ok());
  const absl::StatusOr<uint64_t> frame = core_->Commit(nullptr, {});
  EXPECT_TRUE(frame.ok()) << frame.status();
  Settle();
  return frame.value_or(0);
}

absl::StatusOr<uint64_t> SessionUnderTest::DrawFrame(const std::string& layer) {
  FrameOperation frame{layer, {}};
  frame.upserts.push_back(
      {.layer = layer, .id = "x", .primitive = *EncodePrimitive(Sphere{}, {}), .label = {}});
  const absl::StatusOr<uint64_t> number = core_->Commit(&frame, {});
  Settle();
  return number;
}

std::vector<std::string> SessionUnderTest::TakeWords() {
  if (std::exchange(told_, started()) != started()) told_count_ = 0;
  std::vector<std::string> words;
  for (; told_count_ < stream().written.size(); ++told_count_) {
    const v1::StreamRequest& request = stream().written[told_count_];
    if (request.has_open()) {
      words.push_back(absl::StrCat("open", request.open().resume_token().empty() ? "" : " resume ",
                                   request.open().resume_token(),
                                   request.open().owner_token().empty() ? "" : " owner ",
                                   request.open().owner_token()));
    } else if (request.has_batch()) {
      std::string ids;
      for (const v1::Upsert& upsert : request.batch().upserts())
        absl::StrAppend(&ids, ids.empty() ? "" : " ", upsert.layer(), "/", upsert.id());
      words.push_back(ids);
    } else if (request.has_commit()) {
      words.push_back(absl::StrCat("commit ", request.commit().frame_id()));
    } else if (request.has_frame_begin()) {
      words.push_back("begin " + request.frame_begin().layer());
    } else if (request.has_frame_end()) {
      words.push_back("end " + request.frame_end().layer());
    } else if (request.has_layer_state()) {
      words.push_back("layer " + request.layer_state().layer());
    } else if (request.has_set_transform()) {
      words.push_back("move " + request.set_transform().id());
    } else if (request.has_define_object()) {
      words.push_back("define " + request.define_object().object());
    } else if (request.has_ping()) {
      words.push_back("ping");
    } else {
      words.push_back(request.ShortDebugString());
    }
  }
  return words;
}

}  // namespace voxeld::client
