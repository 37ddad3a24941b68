#include "daemon/wire/convert.h"

#include <gmock/gmock.h>

#include <limits>
#include <optional>
#include <set>

#include "daemon/wire/encode.h"

namespace voxeld::daemon::wire {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Converts every value there and back; a value beyond the last is refused with its number.
template <typename Ours, typename Theirs>
void CheckEnum(int last, int unknown) {
  for (int value = 0; value <= last; ++value) {
    const Ours ours = static_cast<Ours>(value);
    const absl::StatusOr<Ours> back = FromWire(ToWire(ours));
    ASSERT_TRUE(back.ok()) << back.status();
    EXPECT_EQ(*back, ours);
  }
  const absl::StatusOr<Ours> wrong = FromWire(static_cast<Theirs>(unknown));
  ASSERT_TRUE(absl::IsInvalidArgument(wrong.status()));
  EXPECT_THAT(std::string(wrong.status().message()), HasSubstr(std::to_string(unknown)));
}

TEST(Convert, EnumsBothWays) {
  CheckEnum<Reason, v1::Reason>(15, 16);
  CheckEnum<gpu::BlendMode, v1::BlendMode>(2, 0);
  CheckEnum<display::Evidence, v1::Evidence>(1, 0);
  CheckEnum<CommitOutcome::NotShown, v1::NotShown::Why>(3, 0);
  CheckEnum<display::DisplayState, v1::DisplayState>(4, 0);
  CheckEnum<display::PixelFormat, v1::PixelFormat>(2, 0);
  CheckEnum<TestPattern, v1::TestPattern>(5, 0);
  CheckEnum<display::DecodedVolume::Source, v1::VolumeHeader::Source>(1, 0);
}

TEST(Convert, ReasonsHaveTheWiresNumbers) {
  for (int value = 0; value <= 14; ++value) {
    EXPECT_EQ(static_cast<int>(ToWire(static_cast<Reason>(value))), value);
  }
}

display::Geometry Stack() {
  display::PlanarStack stack;
  stack.normal = display::PlanarStack::Normal::kY;
  stack.width_px = 3;
  stack.height_px = 4;
  stack.pitch_u_mm = 0.5;
  stack.pitch_v_mm = 0.25;
  stack.positions_mm = {-1, 0.5, 2};
  stack.thickness_mm = 7;
  stack.mirror_v = true;
  return {stack, {5, 6, 7, {1, 2, 3}, {-1, -2, -3}}};
}

TEST(Convert, GeometriesBothWays) {
  v1::Geometry message;
  ToWire(Stack(), &message);
  absl::StatusOr<display::Geometry> back = FromWire(message);
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(*back, Stack());

  display::Geometry corrected = Stack();
  std::get<display::PlanarStack>(corrected.shape).strokes = 2;
  corrected.correction.emplace();
  corrected.correction->affine[3] = 0.5;
  corrected.correction->homographies = {{1, 2, 3, 4, 5, 6, 7, 8, 9}, {9, 8, 7, 6, 5, 4, 3, 2, 1}};
  corrected.correction->displacement = {
      2, 2, 2, {0, 1, 2}, {3, 4, 5}, std::vector<display::Vec3>(8, {0.25, -1, 7})};
  message.Clear();
  ToWire(corrected, &message);
  back = FromWire(message);
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(*back, corrected);
  message.mutable_correction()->add_homographies(1);
  EXPECT_THAT(std::string(FromWire(message).status().message()),
              HasSubstr("correction.homographies has 19 values"));
  message.mutable_correction()->clear_homographies();
  message.mutable_correction()->add_affine(1);
  EXPECT_THAT(std::string(FromWire(message).status().message()),
              HasSubstr("correction.affine has 13 values"));

  display::Helix helix;
  helix.slices_per_turn = 90;
  helix.width_px = 20;
  helix.height_px = 18;
  helix.pitch_u_mm = 0.5;
  helix.pitch_v_mm = 0.75;
  helix.blades = 2;
  helix.span_turns = 0.25;
  helix.height_mm = 30;
  helix.hub_mm = 1;
  helix.radius_mm = 8;
  helix.phase_turns = 0.5;
  helix.left_handed = helix.mirror_u = true;
  const display::Geometry turning{helix, {1, 2, 3, {1, 1, 1}, {0, 0, 0}}};
  message.Clear();
  ToWire(turning, &message);
  back = FromWire(message);
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(*back, turning);

  display::Rotor rotor;
  rotor.slices_per_turn = 360;
  rotor.width_px = 64;
  rotor.height_px = 32;
  rotor.clockwise = true;
  rotor.panels = {{1, 2, 3, 4, 5, 0.25, true, false},
                  {0.5, 0.5, -3, 0, 0, 0.75, false, true, 12.5F}};
  const display::Geometry spinning{rotor, {1, 2, 3, {1, 1, 1}, {0, 0, 0}}};
  message.Clear();
  ToWire(spinning, &message);
  back = FromWire(message);
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(*back, spinning);

  EXPECT_TRUE(absl::IsInvalidArgument(FromWire(v1::Geometry()).status()));
  message.mutable_planar_stack()->set_normal(static_cast<v1::PlanarStack::Normal>(2));
  EXPECT_THAT(std::string(FromWire(message).status().message()), HasSubstr("planar_stack.normal"));

  v1::FrameLayout layout;
  const display::FrameLayout ours{3, 4, 5, 6, display::PixelFormat::kBitPlanes};
  ToWire(ours, &layout);
  EXPECT_EQ(*FromWire(layout), ours);
}

display::Geometry Lights() {
  const display::Lattice lattice{
      .width_px = 3,
      .points_mm = {std::nullopt, display::Vec3{1, 2, 3}, display::Vec3{-1, 0, 1e6},
                    display::Vec3{0.1, 0.2, 0.3}, std::nullopt, std::nullopt},
      .cell_mm = {1, 2, 0.5}};
  return {lattice, {5, 6, 7, {1, 2, 3}, {-1, -2, -3}}};
}

TEST(Convert, LatticesBothWays) {
  v1::Geometry message;
  ToWire(Lights(), &message);
  EXPECT_EQ(message.lattice().slices(), 2);
  EXPECT_THAT(message.lattice().pixels(), ElementsAre(1, 2, 3));
  EXPECT_THAT(message.lattice().y_mm(), ElementsAre(2, 0, 0.2));
  const absl::StatusOr<display::Geometry> back = FromWire(message);
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(*back, Lights());
}

TEST(Convert, LatticesThatDoNotHoldTogether) {
  v1::Geometry good;
  ToWire(Lights(), &good);
  const auto refusal = [&](auto spoil) {
    v1::Geometry wrong = good;
    spoil(*wrong.mutable_lattice());
    const absl::Status status = FromWire(wrong).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status));
    return std::string(status.message());
  };
  EXPECT_THAT(refusal([](v1::Lattice& l) { l.set_width_px(0); }),
              HasSubstr("slices·width_px is 2·0; both must be 1 at least"));
  EXPECT_THAT(refusal([](v1::Lattice& l) { l.set_slices(-2); }), HasSubstr("is -2·3"));
  EXPECT_THAT(refusal([](v1::Lattice& l) {
                l.set_slices(2147483647);
                l.set_width_px(2147483647);
              }),
              HasSubstr("at most 16777216"));
  EXPECT_THAT(refusal([](v1::Lattice& l) { l.add_z_mm(1); }), HasSubstr("3, 3, 3 and 4 values"));
  EXPECT_THAT(refusal([](v1::Lattice& l) { l.set_pixels(1, 1); }),
              HasSubstr("lattice.pixels[1] is 1; pixels must ascend strictly"));
  EXPECT_THAT(refusal([](v1::Lattice& l) { l.set_pixels(2, 6); }),
              HasSubstr("lattice.pixels[2] is 6; pixels must ascend strictly and be below "
                        "slices·width_px, 6"));
}

TEST(Convert, ViewsBothWaysAndChecked) {
  ViewOptions view;
  view.box.emplace(display::Vec3{-1, -2, -3}, display::Vec3{1, 2, 3});
  view.transform.m[3] = 5;
  v1::View message;
  ToWire(view, &message);
  const absl::StatusOr<ViewOptions> back = FromWire(message);
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(back->mode, ViewOptions::Mode::kFit);
  EXPECT_EQ(back->box, view.box);
  EXPECT_EQ(back->transform, view.transform);
  for (const auto mode : {ViewOptions::Mode::kMillimetres, ViewOptions::Mode::kVoxels}) {
    v1::View other;
    ToWire(ViewOptions{.mode = mode}, &other);
    EXPECT_EQ(FromWire(other)->mode, mode);
  }

  const auto refusal = [](const v1::View& wrong) {
    return std::string(FromWire(wrong).status().message());
  };
  v1::View wrong = message;
  wrong.set_mode(v1::View::VOXELS);
  EXPECT_THAT(refusal(wrong), HasSubstr("view.box is set"));
  wrong = message;
  wrong.set_mode(static_cast<v1::View::Mode>(9));
  EXPECT_THAT(refusal(wrong), HasSubstr("view.mode has the unknown value 9"));
  wrong = message;
  wrong.mutable_box()->mutable_max()->set_y(-2);
  EXPECT_THAT(refusal(wrong), HasSubstr("view.box.max.y is -2"));
  wrong = message;
  wrong.mutable_box()->mutable_min()->set_z(std::numeric_limits<double>::quiet_NaN());
  EXPECT_THAT(refusal(wrong), HasSubstr("view.box.min.z is NaN"));
  wrong = message;
  wrong.mutable_transform()->add_m(1);
  EXPECT_THAT(refusal(wrong), HasSubstr("view.transform.m has 13 values"));
}

TEST(Convert, DisplayUpdatesHoldWhatIsPresent) {
  v1::UpdateDisplayRequest request;
  absl::StatusOr<DisplayUpdate> update = FromWire(request);
  ASSERT_TRUE(update.ok());
  EXPECT_FALSE(update->brightness || update->blank || update->pattern || update->view);
  request.set_brightness(0);
  request.set_blank(false);
  request.set_test_pattern(v1::TEST_PATTERN_AXES);
  request.mutable_view()->set_mode(v1::View::VOXELS);
  update = FromWire(request);
  ASSERT_TRUE(update.ok()) << update.status();
  EXPECT_EQ(update->brightness, 0);
  EXPECT_EQ(update->blank, false);
  EXPECT_EQ(update->pattern, TestPattern::kAxes);
  EXPECT_EQ(update->view->mode, ViewOptions::Mode::kVoxels);
  for (const double bad : {-0.1, 1.1, std::numeric_limits<double>::quiet_NaN()}) {
    request.set_brightness(bad);
    EXPECT_THAT(std::string(FromWire(request).status().message()), HasSubstr("brightness is"));
  }
  request.set_brightness(1);
  request.set_test_pattern(static_cast<v1::TestPattern>(77));
  EXPECT_THAT(std::string(FromWire(request).status().message()), HasSubstr("test_pattern"));
}

// The wire's messages of statistics and limits have a field for each of ours: gives each its own
// value, and checks that no two fields of the message are alike.
template <typename Message>
void ExpectAllDifferent(const Message& message) {
  std::set<std::string> seen;
  const auto* reflection = message.GetReflection();
  const auto* descriptor = message.GetDescriptor();
  for (int i = 0; i < descriptor->field_count(); ++i) {
    const auto* field = descriptor->field(i);
    if (field->is_repeated() || field->message_type() != nullptr) continue;
    EXPECT_TRUE(reflection->HasField(message, field)) << field->full_name();
    if (field->cpp_type() == field->CPPTYPE_BOOL) continue;  // all of them are true
    Message alone;
    google::protobuf::Message* copy = alone.New();
    copy->CopyFrom(message);
    std::vector<const google::protobuf::FieldDescriptor*> others;
    copy->GetReflection()->ListFields(*copy, &others);
    for (const auto* other : others) {
      if (other != field) copy->GetReflection()->ClearField(copy, other);
    }
    const std::string text = copy->ShortDebugString();
    EXPECT_TRUE(seen.insert(text.substr(text.find(' '))).second) << text;
    delete copy;
  }
}

TEST(Encode, ReceiptsOfEveryKind) {
  v1::Receipt message;
  Encode({4, 5, Accepted{6, 7, 8, {"a", "b"}}}, &message);
  EXPECT_EQ(message.frame_id(), 4u);
  EXPECT_EQ(message.sequence(), 5u);
  EXPECT_EQ(message.accepted().snapshot(), 6u);
  EXPECT_EQ(message.accepted().refused_operations(), 7u);
  EXPECT_EQ(message.accepted().applied_time_ns(), 8);
  EXPECT_THAT(message.accepted().displays(), ElementsAre("a", "b"));
  EXPECT_FALSE(message.accepted().late());
  Accepted late;
  late.late = true;
  late.dropped_frames = 3;
  late.stages = {1, 2, 3, 4, 5, 6, 7, 8, 9};
  Encode({4, 5, late}, &message);
  EXPECT_TRUE(message.accepted().late());
  EXPECT_EQ(message.accepted().dropped_frames(), 3u);
  ExpectAllDifferent(message.accepted().stages());
  EXPECT_EQ(message.accepted().stages().sent_ns(), 1);
  EXPECT_EQ(message.accepted().stages().shown_ns(), 9);
  Encode({4, 5, Scheduled{77}}, &message);
  EXPECT_EQ(message.scheduled().present_at_ns(), 77);
  Encode({4, 5, Refused{9, "why"}}, &message);
  EXPECT_EQ(message.refused().refused_operations(), 9u);
  EXPECT_EQ(message.refused().message(), "why");

  CommitOutcome outcome;
  outcome.display = "d";
  outcome.kind = CommitOutcome::Kind::kPresented;
  outcome.volume = 10;
  outcome.time_ns = 11;
  outcome.evidence = display::Evidence::kDevice;
  outcome.last_byte_ns = 12;
  Encode({4, 5, outcome}, &message);
  EXPECT_EQ(message.outcome().display(), "d");
  EXPECT_EQ(message.outcome().presented().volume(), 10u);
  EXPECT_EQ(message.outcome().presented().time_ns(), 11);
  EXPECT_EQ(message.outcome().presented().evidence(), v1::EVIDENCE_DEVICE);
  EXPECT_EQ(message.outcome().presented().last_byte_ns(), 12);
  outcome.kind = CommitOutcome::Kind::kUnchanged;
  Encode({4, 5, outcome}, &message);
  EXPECT_EQ(message.outcome().unchanged().volume(), 10u);
  outcome.kind = CommitOutcome::Kind::kSuperseded;
  outcome.by_frame_id = 13;
  outcome.by_sequence = 14;
  Encode({4, 5, outcome}, &message);
  EXPECT_EQ(message.outcome().superseded().by_frame_id(), 13u);
  EXPECT_EQ(message.outcome().superseded().by_sequence(), 14u);
  outcome.kind = CommitOutcome::Kind::kLost;
  outcome.reason = "gone";
  Encode({4, 5, outcome}, &message);
  EXPECT_EQ(message.outcome().lost().reason(), "gone");
  outcome.kind = CommitOutcome::Kind::kNotShown;
  outcome.why = CommitOutcome::NotShown::kHidden;
  Encode({4, 5, outcome}, &message);
  EXPECT_EQ(message.outcome().not_shown().why(), v1::NotShown::HIDDEN);
}

TEST(Encode, LayersSayWhereTheyAreDrawn) {
  EntityPage page;
  page.layers.resize(2);
  LayerInfo& layer = page.layers[1];
  layer.clip.count = 2;
  layer.clip.planes[0] = {1, 2, 3, 4};
  layer.clip.planes[1] = {0, 0, -1, 0.5};
  layer.clip.boxes_count = layer.clip.cylinders_count = 1;
  layer.clip.boxes[0] = {{1, 0, 0}, {2, 3, 4}, {}};
  layer.clip.cylinders[0] = {{0, 0, 1}, {0, 0, 2}, 3};
  layer.region = {{-1, -2, -3}, {0, 5, 6}};
  v1::ListEntitiesResponse message;
  Encode(page, &message);
  ASSERT_EQ(message.layers_size(), 2);
  EXPECT_FALSE(message.layers(0).has_clip() || message.layers(0).has_region());
  ASSERT_EQ(message.layers(1).clip().planes_size(), 2);
  EXPECT_EQ(message.layers(1).clip().planes(0).ShortDebugString(), "a: 1 b: 2 c: 3 d: 4");
  EXPECT_EQ(message.layers(1).clip().planes(1).ShortDebugString(), "c: -1 d: 0.5");
  ASSERT_EQ(message.layers(1).clip().boxes_size(), 1);
  EXPECT_EQ(message.layers(1).clip().boxes(0).size().ShortDebugString(), "x: 2 y: 3 z: 4");
  ASSERT_EQ(message.layers(1).clip().cylinders_size(), 1);
  EXPECT_EQ(message.layers(1).clip().cylinders(0).ShortDebugString(),
            "start { z: 1 } end { z: 2 } radius: 3");
  EXPECT_EQ(message.layers(1).region().ShortDebugString(),
            "min { x: -1 y: -2 z: -3 } max { y: 5 z: 6 }");
}

TEST(Encode, StatsHaveEveryFigure) {
  Stats stats;
  stats.time_ns = 1, stats.version = "v", stats.uptime_ns = 2, stats.sessions = 3;
  stats.owners = 4, stats.layers = 5, stats.entities = 6, stats.objects = 7, stats.scene_bytes = 8;
  stats.commits_accepted = 9, stats.commits_refused = 10, stats.operations_applied = 11;
  stats.operations_refused = 12, stats.bytes_in = 13, stats.outcomes_undelivered = 14;
  stats.client_drops = 15, stats.streams_overrun = 16;
  stats.frames_dropped = 101, stats.timed_pending = 102, stats.timed_dropped = 103;
  stats.must_show_timeouts = 104, stats.sessions_dormant = 105, stats.sessions_resumed = 106;
  stats.sending = {107, 108, 109, 110}, stats.decoding = {111, 112, 113, 114};
  stats.applying = {115, 116, 117, 118};
  stats.volume_watches_asleep = 162, stats.connections.accept_trouble = "at";
  stats.connections.tls_taken = 167, stats.connections.tls_refused = 168;
  stats.process.segments_refused = 163, stats.process.pauses = 164;
  stats.process.clock_steps = 165, stats.process.time_trouble = "tt";
  stats.memory = {121, 122, 123, 124, 125, 126, 127, 128, 129};
  DisplayFigures& d = stats.displays.emplace_back();
  d.name = "n", d.state = display::DisplayState::kShowing, d.state_reason = "s", d.engine = "e",
  d.engine_device = "d";
  d.engine_reason = "r", d.lit_voxels = 21, d.singular_drawables = 20, d.volumes_drawn = 22,
  d.volumes_unchanged = 19, d.volumes_presented = 23;
  d.volumes_replaced = 24, d.volumes_lost = 25, d.volumes_per_second = 26, d.bytes_out = 27;
  d.slices_sent = 28, d.slices_resent = 29, d.underruns = 30, d.attaches = 31,
  d.transfers_failed = 161, d.device_trouble = "dt", d.engine_out_of_memory = 166;
  d.volumes_late = 131, d.sweeps = {sync::SweepLock::State::kLocked, 132, 133, 134, 135};
  d.genlock_volumes = 136, d.genlock_dropped = 137, d.genlock_postponed = 138;
  d.genlock_slips = 139, d.light = 140, d.power_w = 141, d.power_unlimited = true;
  d.commits_owed = 32, d.commits_presented = 33, d.commits_unchanged = 34;
  d.commits_superseded = 35, d.commits_lost = 36, d.commits_not_shown = 37, d.commits_pending = 38;
  d.commit_to_last_byte = {41, 42, 43, 44}, d.commit_to_presented = {45, 46, 47, 48};
  d.assemble = {49, 50, 51, 52}, d.slice = {53, 54, 55, 56}, d.copy = {83, 84, 85, 86};
  d.packed_as_drawn = true;
  d.engine_degraded = "w", d.volume_held = true, d.engine_faults = 57, d.engine_returns = 58;
  d.engine_mismatches = 59, d.takeover_last_ns = 60, d.takeover_max_ns = 61;
  d.redraw_last_ns = 64, d.redraw_max_ns = 65, d.return_last_ns = 62, d.return_max_ns = 63,
  d.pinned_entities = {"p"};
  d.waiting = {71, 72, 73, 74}, d.transferring = {75, 76, 77, 78}, d.showing = {79, 80, 81, 82};
  v1::Stats message;
  Encode(stats, &message);
  ExpectAllDifferent(message);
  ASSERT_EQ(message.displays_size(), 1);
  ExpectAllDifferent(message.displays(0));
  EXPECT_EQ(message.displays(0).commit_to_last_byte().p99_ns(), 43);
  EXPECT_EQ(message.displays(0).commit_to_presented().count(), 45u);
  EXPECT_EQ(message.displays(0).assemble().p50_ns(), 50);
  EXPECT_EQ(message.displays(0).slice().max_ns(), 56);
  EXPECT_EQ(message.displays(0).copy().max_ns(), 86);
  EXPECT_EQ(message.displays(0).sweep_lock(), v1::SWEEP_LOCK_LOCKED);
  d.packed_as_drawn = false;
  message.Clear();
  Encode(stats, &message);
  EXPECT_FALSE(message.displays(0).packed_as_drawn());
  EXPECT_TRUE(message.displays(0).volume_held());
  d.packed_as_drawn = true, d.volume_held = false;
  message.Clear();
  Encode(stats, &message);
  EXPECT_TRUE(message.displays(0).packed_as_drawn());
  EXPECT_FALSE(message.displays(0).volume_held());
  EXPECT_EQ(message.displays(0).waiting().p50_ns(), 72);
  EXPECT_EQ(message.displays(0).transferring().p50_ns(), 76);
  EXPECT_EQ(message.displays(0).showing().p50_ns(), 80);
  EXPECT_EQ(message.sending().count(), 107u);
  EXPECT_EQ(message.decoding().p50_ns(), 112);
  EXPECT_EQ(message.applying().max_ns(), 118);
  ExpectAllDifferent(message.memory());
  EXPECT_EQ(message.displays(0).device_trouble(), "dt");
  EXPECT_EQ(message.displays(0).engine_out_of_memory(), 166u);
  EXPECT_EQ(message.volume_watches_asleep(), 162u);
  EXPECT_EQ(message.connections().accept_trouble(), "at");
  EXPECT_EQ(message.connections().tls_taken(), 167u);
  EXPECT_EQ(message.connections().tls_refused(), 168u);
  EXPECT_EQ(message.process().segments_refused(), 163u);
  EXPECT_EQ(message.process().pauses(), 164u);
  EXPECT_EQ(message.process().clock_steps(), 165u);
  EXPECT_EQ(message.process().time_trouble(), "tt");
}

TEST(Encode, LimitsHaveEveryField) {
  Limits limits;
  limits.max_uncommitted_bytes = 1;
  limits.max_operations_per_commit = 3;
  v1::Limits message;
  Encode(limits, &message);
  EXPECT_EQ(message.max_id_bytes(), 256u);
  const auto* descriptor = message.GetDescriptor();
  for (int i = 0; i < descriptor->field_count(); ++i) {
    const auto* field = descriptor->field(i);
    EXPECT_TRUE(message.GetReflection()->HasField(message, field)) << field->name();
  }
}

}  // namespace
}  // namespace voxeld::daemon::wire
