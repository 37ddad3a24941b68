// Tests memory passed beside the stream, through a whole daemon.
#include <gmock/gmock.h>

#include <cstring>
#include <random>

#include "absl/strings/str_cat.h"
#include "tests/daemon/local/local_client.h"
#include "tests/daemon/services/daemon_fixture.h"

namespace voxeld::daemon::services {
namespace {

using local::LocalClient;
using local::MakeMemfd;
using local::MemoryMessage;
using local::ReleaseMessage;
using ::testing::HasSubstr;
using ::testing::SizeIs;

template <typename T>
std::string Bytes(const std::vector<T>& values) {
  return {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)};
}

struct Lines {
  std::string positions, colors, indices;
};

Lines RandomLines(uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<float> positions;
  std::vector<uint16_t> indices;
  std::string colors;
  for (uint16_t i = 0; i < 40; ++i) {
    for (const float end : {8.0f, 8.0f, 4.0f}) {
      positions.push_back(std::uniform_real_distribution<float>(0, end)(random));
    }
    for (int c = 0; c < 3; ++c) colors += static_cast<char>(64 + random() % 192);
    indices.push_back(static_cast<uint16_t>(39 - i));
  }
  return {Bytes(positions), colors, Bytes(indices)};
}

v1::Vertices* LinesIn(v1::StreamRequest* request) {
  v1::Upsert* upsert = request->mutable_upsert();
  upsert->set_layer("layer");
  upsert->set_id("lines");
  v1::Vertices* vertices =
      upsert->mutable_entity()->mutable_primitive()->mutable_segments()->mutable_vertices();
  vertices->set_count(40);
  vertices->set_index_count(40);
  vertices->set_index_type(v1::ELEMENT_TYPE_U16);
  return vertices;
}

void Set(v1::MemoryRange* range, uint64_t memory, uint64_t offset, uint64_t size) {
  range->set_memory(memory);
  range->set_offset(offset);
  range->set_size(size);
}

void ShowVoxelsAsTheyAre(Daemon& daemon) {
  grpc::ClientContext context;
  SetDeadline(context);
  v1::UpdateDisplayRequest view;
  view.mutable_view()->set_mode(v1::View::VOXELS);
  v1::DisplayDescription ignored;
  ASSERT_TRUE(daemon.displays().UpdateDisplay(&context, view, &ignored).ok());
}

// Commits what was sent, and returns what the display shows of it.
std::string CommitAndCapture(Daemon& daemon, Client& client) {
  client.Commit(1);
  client.ReadOutcomes(1);
  EXPECT_THAT(client.issues, SizeIs(0));
  v1::CaptureVolumeRequest request;
  request.set_at_least_snapshot(client.answers.at(0).accepted().snapshot());
  request.set_timeout_ns(30 * sync::kSecond);
  grpc::ClientContext context;
  SetDeadline(context);
  const auto call = daemon.displays().CaptureVolume(&context, request);
  std::string rgb;
  v1::VolumeChunk chunk;
  while (call->Read(&chunk)) rgb += chunk.slices().rgb();
  EXPECT_TRUE(call->Finish().ok());
  return rgb;
}

TEST(LocalSocket, LinesInMemoryAreTheLinesThatWereSent) {
  const Lines lines = RandomLines(5);
  std::string sent;
  {
    Daemon daemon;
    ShowVoxelsAsTheyAre(daemon);
    Client client(daemon.scene());
    const v1::Opened opened = client.Open();
    EXPECT_EQ(opened.local_socket(), "");
    EXPECT_EQ(opened.local_token(), "");
    v1::StreamRequest request;
    v1::Vertices* vertices = LinesIn(&request);
    vertices->set_positions(lines.positions);
    vertices->set_colors(lines.colors);
    vertices->set_indices(lines.indices);
    client.Send(request);
    sent = CommitAndCapture(daemon, client);
  }
  Daemon daemon({.local_socket = true});
  ShowVoxelsAsTheyAre(daemon);
  Client client(daemon.scene());
  const v1::Opened opened = client.Open();
  EXPECT_EQ("unix:" + opened.local_socket(), daemon.target() + ".local");
  EXPECT_EQ(opened.limits().max_local_bytes(), uint64_t{1} << 30);
  LocalClient local(opened.local_socket());
  const v1::LocalAnswer welcome = local.Hello(opened.local_token());
  EXPECT_EQ(welcome.welcome().max_bytes(), opened.limits().max_local_bytes());
  // Positions are in a memory of their own, the rest in another.
  const std::string both = lines.colors + lines.indices;
  ASSERT_TRUE(
      local.Call(MemoryMessage(1, lines.positions.size()), {MakeMemfd(lines.positions).get()})
          .has_held());
  ASSERT_TRUE(local.Call(MemoryMessage(2, both.size()), {MakeMemfd(both).get()}).has_held());
  v1::StreamRequest request;
  v1::Vertices* vertices = LinesIn(&request);
  Set(vertices->mutable_positions_in(), 1, 0, lines.positions.size());
  Set(vertices->mutable_colors_in(), 2, 0, lines.colors.size());
  Set(vertices->mutable_indices_in(), 2, lines.colors.size(), lines.indices.size());
  client.Send(request);
  const std::string named = CommitAndCapture(daemon, client);
  EXPECT_THAT(named, SizeIs(8 * 8 * 4 * 3));
  EXPECT_EQ(named, sent);
  EXPECT_NE(named.find_first_not_of('\0'), std::string::npos) << "nothing is lit";

  // Copied content stays when the memory is released.
  EXPECT_TRUE(local.Call(ReleaseMessage(1)).has_released());
  EXPECT_EQ(daemon.Entities().total(), 1u);
  client.HalfClose();
  EXPECT_TRUE(client.Finish().ok());
}

TEST(LocalSocket, AnUnknownMemoryIsAnIssueAndTheStreamGoesOn) {
  Daemon daemon({.local_socket = true});
  Client client(daemon.scene()), other(daemon.scene());
  const v1::Opened opened = client.Open(), others = other.Open();
  EXPECT_NE(opened.local_token(), others.local_token());
  LocalClient local(others.local_socket());
  ASSERT_TRUE(local.Hello(others.local_token()).has_welcome());
  const Lines lines = RandomLines(6);
  ASSERT_TRUE(
      local.Call(MemoryMessage(1, lines.positions.size()), {MakeMemfd(lines.positions).get()})
          .has_held());
  v1::StreamRequest request;
  v1::Vertices* vertices = LinesIn(&request);
  vertices->clear_index_count();
  vertices->clear_index_type();
  Set(vertices->mutable_positions_in(), 1, 0, lines.positions.size());
  for (Client* each : {&client, &other}) {
    each->Send(request);
    each->Commit(1);
    each->ReadOutcomes(1);
  }
  EXPECT_THAT(other.issues, SizeIs(0));
  ASSERT_THAT(client.issues, SizeIs(1)) << "memory belongs to its session";
  EXPECT_EQ(client.issues[0].reason(), v1::REASON_NOT_FOUND);
  EXPECT_EQ(client.issues[0].field(),
            "upsert.entity.primitive.segments.vertices.positions_in.memory");
  EXPECT_THAT(client.issues[0].message(), HasSubstr("send it there and wait for Held"));
  EXPECT_EQ(client.answers[0].accepted().refused_operations(), 1u);

  v1::ApplyUpdateRequest update;
  *update.add_operations() = request;
  v1::ApplyUpdateResponse response;
  grpc::ClientContext context;
  SetDeadline(context);
  ASSERT_TRUE(daemon.scene().ApplyUpdate(&context, update, &response).ok());
  ASSERT_EQ(response.issues_size(), 1);
  EXPECT_THAT(response.issues(0).message(), HasSubstr("has no local socket"));
}

TEST(LocalSocket, EndsWithItsStream) {
  Daemon daemon({.local_socket = true});
  for (const bool cancel : {false, true}) {
    Client client(daemon.scene());
    const v1::Opened opened = client.Open();
    LocalClient local(opened.local_socket());
    ASSERT_TRUE(local.Hello(opened.local_token()).has_welcome());
    ASSERT_TRUE(local.Call(MemoryMessage(1, 4), {MakeMemfd("0123").get()}).has_held());
    cancel ? client.Cancel() : client.HalfClose();
    client.Finish();
    const std::optional<v1::LocalAnswer> last = local.Read();
    ASSERT_TRUE(last.has_value());
    EXPECT_THAT(last->refused().message(), HasSubstr("the session has ended"));
    EXPECT_FALSE(local.Read().has_value());
    LocalClient again(opened.local_socket());
    EXPECT_TRUE(again.Hello(opened.local_token()).has_refused());
  }
}

TEST(LocalSocket, AStreamThatTakesUpASessionHasItsOwn) {
  Daemon daemon({.local_socket = true});
  Client client(daemon.scene());
  v1::Open open;
  open.set_on_disconnect(v1::DISCONNECT_POLICY_KEEP);
  const v1::Opened opened = client.Open(open);
  LocalClient older(opened.local_socket());
  ASSERT_TRUE(older.Hello(opened.local_token()).has_welcome());
  const Lines lines = RandomLines(7);
  const Descriptor positions = MakeMemfd(lines.positions);
  const v1::LocalMessage memory = MemoryMessage(1, lines.positions.size());
  ASSERT_TRUE(older.Call(memory, {positions.get()}).has_held());

  open.set_resume_token(opened.resume_token());
  Client again(daemon.scene());
  const v1::Opened resumed = again.Open(open);
  ASSERT_EQ(resumed.session(), opened.session());
  EXPECT_EQ(client.Finish().error_code(), grpc::StatusCode::ABORTED);
  const std::optional<v1::LocalAnswer> last = older.Read();
  ASSERT_TRUE(last.has_value());
  EXPECT_THAT(last->refused().message(), HasSubstr("the session has ended"));

  // The older stream has ended, and its removal has deleted nothing of the newer one.
  EXPECT_NE(resumed.local_token(), opened.local_token());
  LocalClient newer(resumed.local_socket());
  ASSERT_TRUE(newer.Hello(resumed.local_token()).has_welcome());
  v1::StreamRequest request;
  v1::Vertices* vertices = LinesIn(&request);
  vertices->clear_index_count();
  vertices->clear_index_type();
  Set(vertices->mutable_positions_in(), 1, 0, lines.positions.size());
  again.Send(request);
  again.Commit(1);
  again.ReadOutcomes(1);
  ASSERT_THAT(again.issues, SizeIs(1));
  EXPECT_EQ(again.issues[0].reason(), v1::REASON_NOT_FOUND);
  ASSERT_TRUE(newer.Call(memory, {positions.get()}).has_held());
  again.Send(request);
  again.Commit(2);
  again.ReadOutcomes(2);
  EXPECT_THAT(again.issues, SizeIs(1));
  EXPECT_EQ(daemon.Entities().total(), 1u);
}

TEST(LocalSocket, WhatItHoldsCountsForTheMemoryOfAll) {
  constexpr uint64_t kLimit = 8 << 20;
  Daemon daemon({.limits = {.max_memory_bytes = kLimit}, .local_socket = true});
  Client client(daemon.scene());
  const v1::Opened opened = client.Open();
  LocalClient local(opened.local_socket());
  ASSERT_TRUE(local.Hello(opened.local_token()).has_welcome());
  const std::string large(kLimit + 1, 'x'), small(100'000, 'x');
  EXPECT_THAT(
      local.Call(MemoryMessage(1, large.size()), {MakeMemfd(large).get()}).refused().message(),
      HasSubstr("max_memory_bytes allows 8388608"));
  ASSERT_TRUE(local.Call(MemoryMessage(1, small.size()), {MakeMemfd(small).get()}).has_held());
  const auto holds = [&](uint64_t bytes) {
    return daemon.Await(
        [bytes](const v1::Stats& stats) { return stats.memory().local_bytes() == bytes; });
  };
  EXPECT_TRUE(holds(small.size()));
  ASSERT_TRUE(local.Call(ReleaseMessage(1)).has_released());
  EXPECT_TRUE(holds(0));
  ASSERT_TRUE(local.Call(MemoryMessage(2, small.size()), {MakeMemfd(small).get()}).has_held());
  EXPECT_TRUE(holds(small.size()));
  client.Cancel();
  EXPECT_TRUE(holds(0));
}

TEST(LocalSocket, MuchMemoryGoesThroughFewBytes) {
  Daemon daemon({.limits = {.max_message_bytes = 64 << 10}, .local_socket = true});
  Client client(daemon.scene());
  const v1::Opened opened = client.Open();
  LocalClient local(opened.local_socket());
  ASSERT_TRUE(local.Hello(opened.local_token()).has_welcome());
  // More than may be in flight at once: it is read as the core accepts it.
  constexpr uint32_t kPoints = 30'000;
  const std::string positions(size_t{kPoints} * 6, '\1');
  ASSERT_TRUE(
      local.Call(MemoryMessage(1, positions.size()), {MakeMemfd(positions).get()}).has_held());
  for (uint64_t frame = 1; frame <= 40; ++frame) {
    v1::StreamRequest request;
    request.mutable_upsert()->set_layer("layer");
    request.mutable_upsert()->set_id("points");
    v1::Vertices* vertices = request.mutable_upsert()
                                 ->mutable_entity()
                                 ->mutable_primitive()
                                 ->mutable_points()
                                 ->mutable_vertices();
    vertices->set_count(kPoints);
    vertices->set_position_type(v1::ELEMENT_TYPE_I16);
    Set(vertices->mutable_positions_in(), 1, 0, positions.size());
    ASSERT_TRUE(client.Send(request));
    ASSERT_TRUE(client.Commit(frame));
  }
  client.ReadOutcomes(40);
  EXPECT_THAT(client.issues, SizeIs(0));
  EXPECT_THAT(client.answers, SizeIs(40));
}

}  // namespace
}  // namespace voxeld::daemon::services
