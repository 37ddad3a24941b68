// Tests DisplayService with a real server.
#include <gmock/gmock.h>

#include "tests/daemon/services/daemon_fixture.h"

namespace voxeld::daemon::services {
namespace {

using ::testing::HasSubstr;

template <typename Method, typename Request>
std::pair<grpc::Status, v1::DisplayDescription> Call(Daemon& daemon, Method method,
                                                     const Request& request) {
  grpc::ClientContext context;
  SetDeadline(context);
  v1::DisplayDescription response;
  grpc::Status status = (daemon.displays().*method)(&context, request, &response);
  return {std::move(status), std::move(response)};
}

struct Captured {
  grpc::Status status;
  v1::VolumeHeader header;
  std::string rgb;
  int chunks = 0;
};

Captured Capture(Daemon& daemon, const v1::CaptureVolumeRequest& request) {
  grpc::ClientContext context;
  SetDeadline(context);
  const auto call = daemon.displays().CaptureVolume(&context, request);
  Captured out;
  v1::VolumeChunk chunk;
  while (call->Read(&chunk)) {
    EXPECT_EQ(chunk.has_header(), out.chunks == 0);
    if (chunk.has_header()) out.header = chunk.header();
    if (chunk.has_slices()) {
      EXPECT_EQ(static_cast<size_t>(chunk.slices().first_slice()) * out.header.layout().width() *
                    out.header.layout().height() * 3,
                out.rgb.size());
      EXPECT_LE(chunk.slices().rgb().size(), 1u << 20);
      out.rgb += chunk.slices().rgb();
    }
    ++out.chunks;
  }
  out.status = call->Finish();
  return out;
}

TEST(Displays, AreListedAndDescribed) {
  Daemon daemon({.displays = {"one", "two"}});
  grpc::ClientContext context;
  SetDeadline(context);
  v1::ListDisplaysResponse list;
  ASSERT_TRUE(daemon.displays().ListDisplays(&context, {}, &list).ok());
  ASSERT_EQ(list.displays_size(), 2);
  EXPECT_EQ(list.displays(0).name(), "one");
  EXPECT_EQ(list.displays(0).driver(), "simulated");
  EXPECT_EQ(list.displays(0).layout().slices(), 4);
  EXPECT_EQ(list.displays(0).geometry().grid().nx(), 8);
  EXPECT_TRUE(list.displays(0).geometry().has_planar_stack());
  EXPECT_EQ(list.displays(0).scene_to_voxel().m_size(), 12);

  v1::GetDisplayRequest request;
  EXPECT_EQ(Call(daemon, &v1::DisplayService::Stub::GetDisplay, request).second.name(), "one");
  request.set_name("two");
  EXPECT_EQ(Call(daemon, &v1::DisplayService::Stub::GetDisplay, request).second.name(), "two");
  request.set_name("three");
  const auto [status, none] = Call(daemon, &v1::DisplayService::Stub::GetDisplay, request);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_THAT(status.error_message(), HasSubstr("three"));
  EXPECT_THAT(status.error_message(), HasSubstr("two"));
}

TEST(Displays, AreUpdatedWholeOrNotAtAll) {
  Daemon daemon;
  v1::UpdateDisplayRequest request;
  request.set_brightness(0.5);
  request.set_test_pattern(v1::TEST_PATTERN_AXES);
  request.mutable_view()->set_mode(v1::View::VOXELS);
  auto [status, display] = Call(daemon, &v1::DisplayService::Stub::UpdateDisplay, request);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(display.brightness(), 0.5);
  EXPECT_EQ(display.test_pattern(), v1::TEST_PATTERN_AXES);
  EXPECT_EQ(display.view().mode(), v1::View::VOXELS);

  request.Clear();
  request.set_brightness(0.25);
  request.mutable_view()->set_mode(static_cast<v1::View::Mode>(17));
  status = Call(daemon, &v1::DisplayService::Stub::UpdateDisplay, request).first;
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(status.error_message(), HasSubstr("view.mode"));
  EXPECT_EQ(Call(daemon, &v1::DisplayService::Stub::GetDisplay, v1::GetDisplayRequest())
                .second.brightness(),
            0.5);
}

TEST(Displays, ABlankedOneSaysSoInTheOutcome) {
  Daemon daemon;
  v1::UpdateDisplayRequest request;
  request.set_blank(true);
  ASSERT_TRUE(Call(daemon, &v1::DisplayService::Stub::UpdateDisplay, request).second.blank());
  Client client(daemon.scene());
  client.Open();
  client.Send(SphereIn("layer", "ball"));
  client.Commit(1);
  client.ReadOutcomes(1);
  EXPECT_EQ(client.outcomes[0].outcome().not_shown().why(), v1::NotShown::BLANKED);
}

TEST(Capture, ShowsWhatWasPutUp) {
  Daemon daemon;
  v1::UpdateDisplayRequest view;
  view.mutable_view()->set_mode(v1::View::VOXELS);
  ASSERT_TRUE(Call(daemon, &v1::DisplayService::Stub::UpdateDisplay, view).first.ok());
  Client client(daemon.scene());
  client.Open();
  v1::StreamRequest request = SphereIn("layer", "box");
  v1::Primitive* primitive = request.mutable_upsert()->mutable_entity()->mutable_primitive();
  v1::Box* box = primitive->mutable_box();
  for (auto [vec, values] : {std::pair(box->mutable_center(), std::array{4.0, 4.0, 2.0}),
                             {box->mutable_size(), std::array{20.0, 20.0, 20.0}}}) {
    vec->set_x(values[0]);
    vec->set_y(values[1]);
    vec->set_z(values[2]);
  }
  box->set_fill(v1::FILL_SOLID);
  primitive->mutable_color()->set_rgb(0xFF8000);
  client.Send(request);
  client.Commit(1);
  client.ReadOutcomes(1);
  v1::CaptureVolumeRequest capture;
  capture.set_at_least_snapshot(client.answers[0].accepted().snapshot());
  capture.set_timeout_ns(30 * sync::kSecond);
  const Captured volume = Capture(daemon, capture);
  ASSERT_TRUE(volume.status.ok()) << volume.status.error_message();
  EXPECT_EQ(volume.header.display(), "sim");
  EXPECT_EQ(volume.header.source(), v1::VolumeHeader::DECODED_FROM_SENT);
  EXPECT_EQ(volume.header.geometry().grid().nz(), 4);
  std::string expected;
  for (int i = 0; i < 8 * 8 * 4; ++i) expected += std::string("\xFF\x80\x00", 3);
  EXPECT_EQ(volume.rgb, expected);
}

TEST(Capture, RefusesAndTimesOut) {
  Daemon daemon;
  v1::CaptureVolumeRequest request;
  request.set_name("nobody");
  EXPECT_EQ(Capture(daemon, request).status.error_code(), grpc::StatusCode::NOT_FOUND);
  request.Clear();
  for (const int64_t timeout : {int64_t{-1}, 61 * sync::kSecond}) {
    request.set_timeout_ns(timeout);
    EXPECT_EQ(Capture(daemon, request).status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  }
  request.set_timeout_ns(50 * sync::kMillisecond);
  request.set_at_least_snapshot(1'000'000);
  EXPECT_EQ(Capture(daemon, request).status.error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
}

TEST(Capture, NoMoreAtOnceThanAllowed) {
  DaemonOptions options;
  options.limits.max_captures = 1;
  Daemon daemon(options);
  v1::CaptureVolumeRequest request;
  request.set_timeout_ns(60 * sync::kSecond);
  request.set_at_least_snapshot(1'000'000);
  grpc::ClientContext context;
  SetDeadline(context);
  const auto first = daemon.displays().CaptureVolume(&context, request);
  v1::CaptureVolumeRequest second;
  second.set_timeout_ns(50 * sync::kMillisecond);
  second.set_at_least_snapshot(1'000'000);
  // Whichever of the two the server receives first, one is refused and one waits.
  grpc::Status status = Capture(daemon, second).status;
  while (status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED) {
    status = Capture(daemon, second).status;
  }
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(status.error_message(), ::testing::HasSubstr("max_captures"));
  // The place of a call that has ended is free again.
  context.TryCancel();
  EXPECT_EQ(first->Finish().error_code(), grpc::StatusCode::CANCELLED);
  do {
    status = Capture(daemon, second).status;
  } while (status.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
}

TEST(Stats, AreWatchedAtAnInterval) {
  Daemon daemon;
  grpc::ClientContext context;
  SetDeadline(context);
  v1::WatchStatsRequest request;
  request.set_interval_ns(10 * sync::kMillisecond);
  const auto call = daemon.displays().WatchStats(&context, request);
  v1::Stats stats;
  int64_t last = 0;
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(call->Read(&stats));
    EXPECT_GT(stats.time_ns(), last);
    if (i > 0) {
      EXPECT_GE(stats.time_ns() - last, 10 * sync::kMillisecond);
    }
    last = stats.time_ns();
  }
  EXPECT_EQ(stats.version(), "9.8.7");
  ASSERT_EQ(stats.displays_size(), 1);
  EXPECT_EQ(stats.displays(0).engine(), "cpu");
  context.TryCancel();
  EXPECT_EQ(call->Finish().error_code(), grpc::StatusCode::CANCELLED);
}

TEST(Stats, RefuseAnIntervalOutOfRange) {
  Daemon daemon;
  for (const int64_t interval : {int64_t{-1}, int64_t{1}, 3601 * sync::kSecond}) {
    grpc::ClientContext context;
    SetDeadline(context);
    v1::WatchStatsRequest request;
    request.set_interval_ns(interval);
    const auto call = daemon.displays().WatchStats(&context, request);
    v1::Stats stats;
    EXPECT_FALSE(call->Read(&stats));
    const grpc::Status status = call->Finish();
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    EXPECT_THAT(status.error_message(), HasSubstr(std::to_string(interval)));
  }
}

TEST(Stats, AreWatchedByNoMoreAtOnceThanAllowed) {
  DaemonOptions options;
  options.max_stats_watches = 2;
  Daemon daemon(options);
  struct Watch {
    explicit Watch(Daemon& daemon) {
      SetDeadline(context);
      call = daemon.displays().WatchStats(&context, {});
    }
    bool Read() {
      v1::Stats stats;
      return call->Read(&stats);
    }
    grpc::ClientContext context;
    std::unique_ptr<grpc::ClientReader<v1::Stats>> call;
  };
  // The call that waited for the displays may still exist for a moment.
  const auto begin = [&daemon] {
    auto watch = std::make_unique<Watch>(daemon);
    while (!watch->Read()) {
      EXPECT_EQ(watch->call->Finish().error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
      watch = std::make_unique<Watch>(daemon);
    }
    return watch;
  };
  const std::unique_ptr<Watch> first = begin(), second = begin();
  Watch third(daemon);
  EXPECT_FALSE(third.Read());
  const grpc::Status refused = third.call->Finish();
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_THAT(refused.error_message(), HasSubstr("max_stats_watches"));
  first->context.TryCancel();
  EXPECT_EQ(first->call->Finish().error_code(), grpc::StatusCode::CANCELLED);
  // The place of a call that has ended is free again.
  for (bool free = false; !free;) {
    Watch another(daemon);
    free = another.Read();
    if (free) another.context.TryCancel();
    const grpc::StatusCode code = another.call->Finish().error_code();
    ASSERT_EQ(code, free ? grpc::StatusCode::CANCELLED : grpc::StatusCode::RESOURCE_EXHAUSTED);
  }
}

// The state that a client assembles from a watch.
struct Watched {
  explicit Watched(Daemon& daemon, const std::string& name = "") {
    SetDeadline(context);
    v1::WatchVolumeRequest request;
    request.set_name(name);
    call = daemon.displays().WatchVolume(&context, request);
  }
  ~Watched() { context.TryCancel(); }

  // Reads one more message.
  bool Read() {
    v1::VolumeChunk chunk;
    if (!call->Read(&chunk)) return false;
    if (chunk.has_header()) {
      header = chunk.header();
      const v1::FrameLayout& layout = header.layout();
      each = static_cast<size_t>(layout.width()) * static_cast<size_t>(layout.height()) * 3;
      rgb.resize(each * static_cast<size_t>(layout.slices()), '?');
      ++volumes;
      slices.clear();
      return true;
    }
    const size_t first = static_cast<size_t>(chunk.slices().first_slice());
    rgb.replace(first * each, chunk.slices().rgb().size(), chunk.slices().rgb());
    for (size_t i = 0; i < chunk.slices().rgb().size() / each; ++i) slices.push_back(first + i);
    return true;
  }

  grpc::ClientContext context;
  std::unique_ptr<grpc::ClientReader<v1::VolumeChunk>> call;
  v1::VolumeHeader header;
  std::string rgb;
  size_t each = 0;
  std::vector<size_t> slices;  // of the newest volume
  int volumes = 0;
};

std::string Whole(Daemon& daemon) {
  const Captured captured = Capture(daemon, {});
  EXPECT_TRUE(captured.status.ok()) << captured.status.error_message();
  return captured.rgb;
}

TEST(WatchVolume, TellsWhatChangesAndIsWhatACaptureTells) {
  Daemon daemon;
  ASSERT_TRUE(daemon.Await(AllShowing));
  Client client(daemon.scene());
  client.Open();
  client.Send(SphereIn("l", "small", 0.1));
  client.Commit(1);
  client.ReadOutcomes(1);
  Watched watch(daemon);
  while (watch.slices.size() < 4) ASSERT_TRUE(watch.Read());
  EXPECT_EQ(watch.header.display(), "sim");
  EXPECT_EQ(watch.rgb, Whole(daemon));
  EXPECT_THAT(watch.rgb, HasSubstr(std::string(1, '\xff')));

  // A point in one slice only: only that slice is sent.
  v1::StreamRequest point;
  point.mutable_upsert()->set_layer("l");
  point.mutable_upsert()->set_id("point");
  v1::Primitive* primitive = point.mutable_upsert()->mutable_entity()->mutable_primitive();
  v1::Vertices* vertices = primitive->mutable_points()->mutable_vertices();
  vertices->set_count(1);
  const float at[3] = {-0.9f, -0.9f, 0.1f};
  vertices->set_positions(std::string(reinterpret_cast<const char*>(at), 12));
  client.Send(point);
  client.Commit(2);
  while (watch.volumes < 2 || watch.slices.empty()) {
    if (!watch.Read()) FAIL() << watch.call->Finish().error_message();
  }
  EXPECT_EQ(watch.slices.size(), 1u);
  EXPECT_EQ(watch.rgb, Whole(daemon));
  client.Cancel();
}

TEST(WatchVolume, NamesThatAreNotThereAndTooMany) {
  DaemonOptions options;
  options.max_volume_watches = 1;
  Daemon daemon(options);
  {
    Watched wrong(daemon, "no such");
    EXPECT_FALSE(wrong.Read());
    const grpc::Status status = wrong.call->Finish();
    EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND);
    EXPECT_THAT(status.error_message(), HasSubstr("there are: \"sim\""));
  }
  bool open = false;
  while (!open) {  // until the first one's place is free
    Watched watch(daemon);
    open = watch.Read();
    if (!open) continue;
    Watched second(daemon);
    EXPECT_FALSE(second.Read());
    const grpc::Status refused = second.call->Finish();
    EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
    EXPECT_THAT(refused.error_message(), HasSubstr("max_volume_watches"));
  }
}

TEST(WatchVolume, EndsWithTheServer) {
  Daemon daemon;
  ASSERT_TRUE(daemon.Await(AllShowing));
  Watched watch(daemon);
  ASSERT_TRUE(watch.Read());
  daemon.server().Shutdown(10 * sync::kSecond);
  while (watch.Read()) continue;
  EXPECT_EQ(watch.call->Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST(Watches, EndAtShutdown) {
  Daemon daemon;
  grpc::ClientContext context;
  SetDeadline(context);
  v1::WatchStatsRequest request;
  request.set_interval_ns(3600 * sync::kSecond);
  const auto call = daemon.displays().WatchStats(&context, request);
  v1::Stats stats;
  ASSERT_TRUE(call->Read(&stats));
  daemon.server().Shutdown(10 * sync::kSecond);
  EXPECT_FALSE(call->Read(&stats));
  const grpc::Status status = call->Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(status.error_message(), "shutting down");
}

}  // namespace
}  // namespace voxeld::daemon::services
