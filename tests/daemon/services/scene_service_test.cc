// Tests SceneService's other calls with a real server.
#include <gmock/gmock.h>

#include <span>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "daemon/services/apply_update.h"
#include "display/sync/fake_clock.h"
#include "tests/daemon/services/daemon_fixture.h"

namespace voxeld::daemon::services {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

// Returns how often `part` occurs in `text`.
int Occurrences(std::string_view part, std::string_view text) {
  int count = 0;
  for (size_t at = text.find(part); at != text.npos; at = text.find(part, at + 1)) ++count;
  return count;
}

// Makes one call. Returns its status and answer.
template <typename Response, typename Method, typename Request>
std::pair<grpc::Status, Response> Call(v1::SceneService::Stub& stub, Method method,
                                       const Request& request) {
  grpc::ClientContext context;
  SetDeadline(context);
  Response response;
  grpc::Status status = (stub.*method)(&context, request, &response);
  return {std::move(status), std::move(response)};
}

std::pair<grpc::Status, v1::ApplyUpdateResponse> Apply(Daemon& daemon,
                                                       const v1::ApplyUpdateRequest& request) {
  return Call<v1::ApplyUpdateResponse>(daemon.scene(), &v1::SceneService::Stub::ApplyUpdate,
                                       request);
}

TEST(ApplyUpdate, IsKeptWithItsIssues) {
  Daemon daemon;
  v1::ApplyUpdateRequest request;
  *request.add_operations() = SphereIn("layer", "good");
  *request.add_operations() = SphereIn("layer", "bad", -1);
  const auto [status, response] = Apply(daemon, request);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_GT(response.snapshot(), 0u);
  ASSERT_EQ(response.issues_size(), 1);
  EXPECT_EQ(response.issues(0).field(), "operations[1].upsert.entity.primitive.sphere.radius");
  const v1::ListEntitiesResponse entities = daemon.Entities();
  ASSERT_EQ(entities.entities_size(), 1);
  EXPECT_EQ(entities.entities(0).key().id(), "good");
  EXPECT_EQ(entities.entities(0).kind(), "sphere");
  ASSERT_EQ(entities.layers_size(), 1);
  EXPECT_TRUE(entities.layers(0).orphaned());
  EXPECT_EQ(daemon.Stats().sessions(), 0u);
}

TEST(ApplyUpdate, StrictIsRefusedWhole) {
  Daemon daemon;
  v1::ApplyUpdateRequest request;
  request.mutable_open()->set_strict(true);
  *request.add_operations() = SphereIn("layer", "good");
  *request.add_operations() = SphereIn("layer", "bad", -1);
  const auto [status, response] = Apply(daemon, request);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(
      status.error_message(),
      StartsWith("the session is strict and 1 operation was refused, so nothing of the "
                 "commit was applied; the first: layer/bad, "
                 "operations[1].upsert.entity.primitive.sphere.radius: radius is -1; give"));
  EXPECT_EQ(Occurrences("is -1", status.error_message()), 1) << "reported once";
  EXPECT_EQ(daemon.Entities().total(), 0u);
}

TEST(ApplyUpdate, RefusesWhatIsNoUpdate) {
  Daemon daemon;
  v1::ApplyUpdateRequest request;
  request.add_operations()->mutable_commit();
  EXPECT_EQ(Apply(daemon, request).first.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  request.Clear();
  request.mutable_open()->set_resume_token("0123456789abcdef");
  EXPECT_EQ(Apply(daemon, request).first.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  request.Clear();
  request.add_operations()->mutable_ping();
  EXPECT_EQ(Apply(daemon, request).first.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST(ApplyUpdate, HasAsManyOperationsAndIssuesAsAllowed) {
  DaemonOptions options;
  options.limits.max_operations_per_commit = 5;
  options.limits.max_issues_per_commit = 2;
  Daemon daemon(options);
  v1::ApplyUpdateRequest request;
  *request.add_operations() = SphereIn("layer", "good");
  for (int i = 0; i < 4; ++i) request.add_operations();
  const auto [status, response] = Apply(daemon, request);
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_EQ(response.issues_size(), 3);
  EXPECT_EQ(response.issues(1).field(), "operations[2].op");
  EXPECT_EQ(response.issues(2).field(), "commit");
  EXPECT_EQ(response.issues(2).reason(), v1::REASON_QUOTA_EXCEEDED);
  EXPECT_THAT(response.issues(2).message(), HasSubstr("2 more issues are left out"));

  request.add_operations();
  const grpc::Status refused = Apply(daemon, request).first;
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_THAT(refused.error_message(), HasSubstr("operations has 6 elements"));
}

TEST(ApplyUpdate, IsAnsweredAlsoByACoreThatStops) {
  for (const bool opened : {true, false}) {
    sync::FakeClock clock;
    Core core({.version = "1", .threads = false}, clock);
    ASSERT_TRUE(core.Start().ok());
    listen::Counters counters;
    ServiceContext context{core, clock, counters, "1"};
    v1::ApplyUpdateRequest request;
    *request.add_operations() = SphereIn("layer", "ball");
    const std::string bytes = request.SerializeAsString();
    const std::string_view view = bytes;
    std::vector<absl::Status> answers;
    if (!opened) {
      ASSERT_TRUE(core.Stop(sync::kSecond).ok());
    }
    ApplyUpdate(context, {}, std::span(&view, 1),
                [&](const absl::Status& status, const v1::ApplyUpdateResponse&) {
                  answers.push_back(status);
                });
    // It can open the session, but no longer accepts its operations.
    ASSERT_TRUE(core.Stop(sync::kSecond).ok());
    ASSERT_EQ(answers.size(), 1u);
    EXPECT_TRUE(absl::IsUnavailable(answers[0])) << answers[0];
  }
}

TEST(ListEntities, InPages) {
  Daemon daemon;
  v1::ApplyUpdateRequest update;
  for (int i = 0; i < 25; ++i) {
    *update.add_operations() = SphereIn("layer", absl::StrCat("e", 100 + i));
  }
  ASSERT_TRUE(Apply(daemon, update).first.ok());
  v1::ListEntitiesRequest request;
  request.set_page_size(10);
  std::vector<std::string> ids;
  for (int page = 0; page < 3; ++page) {
    const auto [status, response] = Call<v1::ListEntitiesResponse>(
        daemon.scene(), &v1::SceneService::Stub::ListEntities, request);
    ASSERT_TRUE(status.ok()) << status.error_message();
    EXPECT_EQ(response.total(), 25u);
    EXPECT_EQ(response.layers_size(), page == 0 ? 1 : 0);
    for (const auto& entity : response.entities()) ids.push_back(entity.key().id());
    request.set_page_token(response.next_page_token());
    EXPECT_EQ(response.next_page_token().empty(), page == 2);
  }
  EXPECT_EQ(ids.size(), 25u);
  EXPECT_TRUE(std::is_sorted(ids.begin(), ids.end()));
  request.Clear();
  request.set_id_prefix("e12");
  EXPECT_EQ(
      Call<v1::ListEntitiesResponse>(daemon.scene(), &v1::SceneService::Stub::ListEntities, request)
          .second.total(),
      5u);
}

TEST(ListEntities, LayersHaveTheirClipRegionAndMask) {
  Daemon daemon;
  v1::ApplyUpdateRequest update;
  v1::LayerState* state = update.add_operations()->mutable_layer_state();
  state->set_layer("layer");
  v1::Clip::Plane* plane = state->mutable_clip()->add_planes();
  plane->set_c(-2);
  plane->set_d(7);
  state->mutable_region()->mutable_min()->set_x(-1);
  state->mutable_region()->mutable_max()->set_x(1);
  state->mutable_region()->mutable_max()->set_y(1);
  state->mutable_region()->mutable_max()->set_z(1);
  state->set_mask_layer("stencil");
  const auto [status, response] = Apply(daemon, update);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(response.issues_size(), 0);
  const v1::ListEntitiesResponse listed = daemon.Entities();
  ASSERT_EQ(listed.layers_size(), 1);
  EXPECT_EQ(listed.layers(0).clip().SerializeAsString(), state->clip().SerializeAsString());
  EXPECT_EQ(listed.layers(0).region().ShortDebugString(), "min { x: -1 } max { x: 1 y: 1 z: 1 }");
  EXPECT_EQ(listed.layers(0).mask_layer(), "stencil");
}

TEST(GetEntity, ByKeyOrNotFound) {
  Daemon daemon;
  v1::ApplyUpdateRequest update;
  *update.add_operations() = SphereIn("layer", "ball");
  update.mutable_operations(0)->mutable_upsert()->mutable_entity()->set_label("a ball");
  ASSERT_TRUE(Apply(daemon, update).first.ok());
  const auto get = [&](const std::string& layer, const std::string& id) {
    v1::GetEntityRequest request;
    request.mutable_key()->set_layer(layer);
    request.mutable_key()->set_id(id);
    return Call<v1::GetEntityResponse>(daemon.scene(), &v1::SceneService::Stub::GetEntity, request);
  };
  const auto found = get("layer", "ball");
  ASSERT_TRUE(found.first.ok()) << found.first.error_message();
  EXPECT_EQ(found.second.info().label(), "a ball");
  const auto lost = get("layer", "cube");
  EXPECT_EQ(lost.first.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_THAT(lost.first.error_message(), HasSubstr("cube"));
  EXPECT_THAT(get("", "ball").first.error_message(), HasSubstr("key.layer is empty"));
  EXPECT_THAT(get("layer", "").first.error_message(), HasSubstr("key.id is empty"));
}

TEST(ExplainEntity, SaysWhyItIsSeenOrNot) {
  Daemon daemon;
  v1::ApplyUpdateRequest update;
  *update.add_operations() = SphereIn("layer", "ball");
  *update.add_operations() = SphereIn("layer", "black");
  update.mutable_operations(1)
      ->mutable_upsert()
      ->mutable_entity()
      ->mutable_primitive()
      ->mutable_color()
      ->set_rgb(0);
  ASSERT_TRUE(Apply(daemon, update).first.ok());
  const auto why = [&](const std::string& id, const std::string& display = "") {
    v1::ExplainEntityRequest request;
    request.mutable_key()->set_layer("layer");
    request.mutable_key()->set_id(id);
    request.set_display(display);
    return Call<v1::ExplainEntityResponse>(daemon.scene(), &v1::SceneService::Stub::ExplainEntity,
                                           request);
  };
  const auto black = why("black");
  ASSERT_TRUE(black.first.ok()) << black.first.error_message();
  EXPECT_EQ(black.second.visibility(), v1::VISIBILITY_BLACK);
  EXPECT_GT(black.second.covered_voxels(), 0u);
  EXPECT_THAT(black.second.text(), HasSubstr("black"));
  EXPECT_EQ(black.second.info().key().id(), "black");
  EXPECT_FALSE(black.second.display().empty());
  const auto ball = why("ball");
  ASSERT_TRUE(ball.first.ok()) << ball.first.error_message();
  EXPECT_EQ(ball.second.seen_voxels(), ball.second.lit_voxels());
  EXPECT_GT(ball.second.voxels().max().x(), ball.second.voxels().min().x());
  EXPECT_EQ(why("cube").first.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(why("").first.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(why("ball", "none").first.error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST(ExplainEntity, ADisplayThatIsBlankedIsDark) {
  Daemon daemon;
  v1::ApplyUpdateRequest update;
  *update.add_operations() = SphereIn("layer", "ball");
  ASSERT_TRUE(Apply(daemon, update).first.ok());
  v1::UpdateDisplayRequest blank;
  blank.set_blank(true);
  grpc::ClientContext context;
  v1::DisplayDescription display;
  ASSERT_TRUE(daemon.displays().UpdateDisplay(&context, blank, &display).ok());
  v1::ExplainEntityRequest request;
  request.mutable_key()->set_layer("layer");
  request.mutable_key()->set_id("ball");
  const auto why = Call<v1::ExplainEntityResponse>(daemon.scene(),
                                                   &v1::SceneService::Stub::ExplainEntity, request);
  ASSERT_TRUE(why.first.ok()) << why.first.error_message();
  EXPECT_EQ(why.second.visibility(), v1::VISIBILITY_DARK);
  EXPECT_THAT(why.second.text(), HasSubstr("is blanked"));
}

TEST(ClearLayer, RemovesWhatMatches) {
  Daemon daemon;
  v1::ApplyUpdateRequest update;
  *update.add_operations() = SphereIn("a", "1");
  *update.add_operations() = SphereIn("a", "2");
  *update.add_operations() = SphereIn("b", "3");
  ASSERT_TRUE(Apply(daemon, update).first.ok());
  v1::ClearLayerRequest request;
  request.set_layer("a");
  const auto [status, response] =
      Call<v1::ClearLayerResponse>(daemon.scene(), &v1::SceneService::Stub::ClearLayer, request);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(response.entities(), 2u);
  EXPECT_EQ(response.layers(), 1u);
  EXPECT_EQ(daemon.Entities().total(), 1u);
}

TEST(SceneService, OwnersAreListedAndControlled) {
  Daemon daemon;
  Client client(daemon.scene());
  v1::Open open;
  open.set_client_name("artist");
  const v1::Opened opened = client.Open(open);
  client.Send(SphereIn("layer", "ball"));
  client.Commit(1);
  client.ReadOutcomes(1);
  const auto list = [&] {
    grpc::ClientContext context;
    SetDeadline(context);
    v1::ListOwnersResponse response;
    EXPECT_TRUE(daemon.scene().ListOwners(&context, {}, &response).ok());
    return response;
  };
  const auto control = [&](const v1::ControlOwnerRequest& request) {
    grpc::ClientContext context;
    SetDeadline(context);
    v1::OwnerInfo info;
    const grpc::Status status = daemon.scene().ControlOwner(&context, request, &info);
    return std::pair(status, info);
  };
  ASSERT_EQ(list().owners_size(), 1);
  EXPECT_EQ(list().owners(0).owner(), opened.owner());
  EXPECT_EQ(list().owners(0).client_names(0), "artist");
  EXPECT_EQ(list().owners(0).entities(), 1u);
  EXPECT_EQ(list().owners(0).max_entities(), Limits().max_entities_per_owner);

  v1::ControlOwnerRequest request;
  request.set_owner(opened.owner());
  request.set_hidden(true);
  request.set_max_entities(7);
  auto [status, info] = control(request);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_TRUE(info.hidden());
  EXPECT_EQ(info.max_entities(), 7u);
  request.Clear();
  request.set_owner(opened.owner());
  request.set_evict(true);
  EXPECT_TRUE(control(request).first.ok());
  const grpc::Status ended = client.Finish();
  EXPECT_EQ(ended.error_code(), grpc::StatusCode::PERMISSION_DENIED);
  EXPECT_EQ(daemon.Entities().total(), 0u);
  EXPECT_EQ(control(request).first.error_code(), grpc::StatusCode::NOT_FOUND);
}

}  // namespace
}  // namespace voxeld::daemon::services
