#include <algorithm>
#include <cmath>
#include <future>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "absl/algorithm/container.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/strip.h"
#include "common/text/printable.h"
#include "display/sync/clock.h"
#include "tools/voxelctl/commands/choose_space.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/commands/end_patterns.h"
#include "tools/voxelctl/commands/own_layer.h"
#include "tools/voxelctl/connection/scene_session.h"
#include "tools/voxelctl/demo/scene.h"
#include "tools/voxelctl/demo/stage.h"
#include "tools/voxelctl/shape/drawing.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

constexpr double kFramesPerSecond = 30;
constexpr sync::TimeNs kPutUpTime = 30 * sync::kSecond;
constexpr sync::TimeNs kGoneTime = 2 * sync::kSecond;
constexpr sync::TimeNs kLineTime = 200 * sync::kMillisecond;

struct Playable {
  const SceneAbout* about = nullptr;
  std::vector<std::string> files;
};

bool IsChosen(const DemoOptions& options, const SceneAbout& scene) {
  return options.scenes.empty() || absl::c_linear_search(options.scenes, scene.name);
}

absl::Status ListScenes(const DemoOptions& options, Console& console) {
  const std::vector<std::string> roots = DataRoots(options.data, ProgramPath());
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  Table table({{"SCENE"}, {"WHAT IS SEEN"}, {"FROM"}, {"DATA"}});
  for (const SceneAbout& scene : Scenes()) {
    if (!IsChosen(options, scene)) continue;
    const absl::StatusOr<std::vector<std::string>> files = FindWhatSceneNeeds(scene, roots);
    const std::string missing = files.ok() ? "" : std::string(files.status().message());
    const auto first = absl::c_find_if(
        scene.needs, [&](const SceneFile& file) { return !FindSceneFile(file, roots).ok(); });
    table.Add({scene.name, scene.seen, scene.source,
               absl::IsUnimplemented(files.status()) ? "not built"
               : first != scene.needs.end()          ? absl::StrCat("missing: ", first->brought_by)
               : scene.needs.empty()                 ? "none needed"
                                                     : "there"});
    list.push_back({{"scene", scene.name},
                    {"seen", scene.seen},
                    {"source", scene.source},
                    {"files", files.ok() ? *files : std::vector<std::string>()},
                    {"missing", missing}});
  }
  console.Data(console.json() ? absl::StrCat(list.dump(2), "\n") : table.Text());
  return absl::OkStatus();
}

// Returns whether a status of a scene is caused by the scene and not by the connection.
bool IsOfTheScene(const absl::Status& status) {
  return absl::IsInvalidArgument(status) || absl::IsFailedPrecondition(status) ||
         absl::IsResourceExhausted(status) || absl::IsNotFound(status) ||
         absl::IsPermissionDenied(status);
}

void PassOver(const SceneAbout& about, const absl::Status& why, Console& console) {
  if (console.json()) {
    const nlohmann::ordered_json line = {{"scene", about.name},
                                         {"passed_over", std::string(why.message())}};
    console.Data(absl::StrCat(line.dump(), "\n"));
  } else {
    console.Say(absl::StrCat(about.name, " is passed over: ", why.message()));
  }
}

// Skips a scene whose data are not on this machine, which is not an error.
void LeaveOut(const SceneAbout& about, const std::vector<std::string>& roots,
              const absl::Status& why, Console& console) {
  if (console.json()) return PassOver(about, why, console);
  const auto missing = absl::c_find_if(
      about.needs, [&](const SceneFile& file) { return !FindSceneFile(file, roots).ok(); });
  const std::string by = missing == about.needs.end() ? "" : missing->brought_by;
  console.Say(absl::StrCat(about.name, ": left out; ", by, by.empty() ? "" : " brings its data"));
}

class DemoPlayer {
 public:
  DemoPlayer(const DemoOptions& options, Connection& connection, Interrupt& interrupt,
             Console& console)
      : options_(options), connection_(connection), interrupt_(interrupt), console_(console) {}

  absl::Status Run(std::vector<Playable> scenes) {
    absl::Status status = Open();
    if (!status.ok()) return status;
    status = PlayAll(std::move(scenes));
    if (interrupt_.requested()) status = absl::OkStatus();
    const absl::Status gone = TakeAllDown();
    const absl::Status closed = session_->Close();
    return !status.ok() ? status : !gone.ok() ? gone : closed;
  }

 private:
  using Made = absl::StatusOr<std::unique_ptr<Scene>>;

  absl::Status Open() {
    const absl::StatusOr<Room> room = ChooseSpace(connection_, options_.display, console_);
    if (!room.ok()) return room.status();
    room_ = *room;
    const absl::StatusOr<std::vector<OwnedLayer>> before = DrawnBefore(connection_);
    if (!before.ok()) return before.status();
    client::Options open;
    open.client_name = "voxelctl demo";
    open.strict = true;
    absl::StatusOr<std::unique_ptr<SceneSession>> session =
        connection_.OpenSession(std::move(open));
    if (!session.ok()) return session.status();
    session_ = *std::move(session);
    const absl::StatusOr<TakenDown> taken = TakeDown(*before, connection_);
    if (!taken.ok()) return taken.status();
    if (!taken->stay.empty()) console_.Say(OthersStay(taken->stay));
    const absl::StatusOr<EndedPatterns> patterns = EndPatterns(connection_);
    if (!patterns.ok()) return patterns.status();
    if (!patterns->stay.empty()) console_.Say(PatternsStay(*patterns));
    return absl::OkStatus();
  }

  // The next scene is made while one is shown.
  std::future<Made> Make(const Playable& scene) const {
    SceneSettings settings{room_.space, room_.least_side, scene.files};
    return std::async(std::launch::async, scene.about->make, std::move(settings));
  }

  absl::Status PlayAll(std::vector<Playable> scenes) {
    size_t at = 0;
    std::future<Made> next = Make(scenes[0]);
    while (!interrupt_.requested()) {
      Made scene = next.get();
      absl::Status status = scene.status();
      if (status.ok()) status = PutUp(scenes[at], **scene);
      if (interrupt_.requested()) break;
      if (!status.ok()) {
        if (!IsOfTheScene(status)) return status;
        PassOver(*scenes[at].about, status, console_);
        scenes.erase(scenes.begin() + static_cast<ptrdiff_t>(at));
        if (scenes.empty()) return absl::FailedPreconditionError("no scene could be played");
        if (options_.once && at == scenes.size()) return absl::OkStatus();
        at %= scenes.size();
        next = Make(scenes[at]);
        continue;
      }
      const bool last = options_.once && at + 1 == scenes.size();
      const size_t following = (at + 1) % scenes.size();
      const bool alone = following == at && !options_.once;
      if (!last && !alone) next = Make(scenes[following]);
      status = Stay(*scenes[at].about, **scene, alone);
      if (!status.ok() || last || alone) return status;
      at = following;
    }
    return absl::OkStatus();
  }

  // Replaces the previous scene. Its objects are removed when nothing draws them.
  absl::Status PutUp(const Playable& playable, Scene& scene) {
    auto stage =
        std::make_unique<Stage>(*session_, session_->client().GetLayer(kLayer),
                                absl::StrCat("demo/", ++number_, "/", playable.about->name));
    absl::Status status = stage->layer().Set(
        {.transform = client::Affine(), .clip = std::vector<client::ClipPart>()});
    if (status.ok()) status = scene.Begin(*stage);
    if (status.ok()) status = session_->CommitAndWait(kPutUpTime);
    if (!status.ok()) return status;
    if (stage_ != nullptr) status = stage_->RemoveObjects();
    stage_ = std::move(stage);
    refused_before_ = session_->client().GetTally().refused;
    const SceneAbout& about = *playable.about;
    if (console_.json()) {
      Line({{"scene", about.name},
            {"seen", about.seen},
            {"source", about.source},
            {"files", playable.files}});
    } else {
      console_.Say(absl::StrCat(about.name, ": ", about.seen, " (", about.source, ")"));
    }
    return status;
  }

  absl::Status Stay(const SceneAbout& about, Scene& scene, bool for_good) {
    const sync::TimeNs began = clock_.Now();
    const sync::TimeNs end = for_good ? sync::kNever : began + std::llround(options_.seconds * 1e9);
    const double period_ns = 1e9 / kFramesPerSecond;
    sync::TimeNs next_line = began;
    uint64_t frames = 0;
    absl::Status status;
    for (int64_t frame = 1;;) {
      const sync::TimeNs due = began + std::llround(static_cast<double>(frame) * period_ns);
      if (due >= end) {
        interrupt_.WaitUntil(clock_, end);
        break;
      }
      if (interrupt_.WaitUntil(clock_, due)) break;
      const sync::TimeNs now = clock_.Now();
      frame =
          std::max(frame, static_cast<int64_t>(static_cast<double>(now - began) / period_ns)) + 1;
      if (!session_->client().HasRoom()) continue;
      status = scene.Move(*stage_, static_cast<double>(now - began) / 1e9);
      if (status.ok()) status = session_->Commit();
      if (status.ok()) status = Refusals();
      if (!status.ok()) break;
      ++frames;
      if (console_.live() && now >= next_line) {
        next_line = now + kLineTime;
        const double seconds = static_cast<double>(now - began) / 1e9;
        console_.Progress(absl::StrFormat("%s %.0f s, %.0f frames/s; Ctrl-C ends", about.name,
                                          seconds, static_cast<double>(frames) / seconds));
      }
    }
    const double seconds = static_cast<double>(clock_.Now() - began) / 1e9;
    if (console_.json()) {
      Line({{"scene", about.name}, {"frames", frames}, {"seconds", seconds}});
    }
    return status;
  }

  absl::Status Refusals() {
    const client::Tally tally = session_->client().GetTally();
    if (tally.refused <= refused_before_) return absl::OkStatus();
    return absl::FailedPreconditionError(
        absl::StrCat("the server refused a frame",
                     tally.issues.empty() ? "" : ": " + IssueForTerminal(tally.issues.back())));
  }

  absl::Status TakeAllDown() {
    absl::Status status = session_->client().RemoveAll();
    if (status.ok() && stage_ != nullptr) status = stage_->RemoveObjects();
    if (status.ok()) status = session_->Commit();
    return status.ok() ? session_->WaitSettled(kGoneTime) : status;
  }

  void Line(const nlohmann::ordered_json& line) { console_.Data(absl::StrCat(line.dump(), "\n")); }

  const DemoOptions& options_;
  Connection& connection_;
  Interrupt& interrupt_;
  Console& console_;
  sync::SystemClock clock_;
  Room room_;
  std::unique_ptr<SceneSession> session_;
  std::unique_ptr<Stage> stage_;  // of the current scene
  uint64_t number_ = 0;           // of scenes that were shown
  uint64_t refused_before_ = 0;   // commits that were refused, of skipped scenes
};

}  // namespace

absl::Status Demo(const DemoOptions& options, const Connector& connect, Interrupt& interrupt,
                  Console& console) {
  if (options.list) return ListScenes(options, console);
  const std::vector<std::string> roots = DataRoots(options.data, ProgramPath());
  std::vector<Playable> scenes;
  std::vector<std::string> not_built;  // scenes whose files this build cannot read
  std::string to_build;
  for (const SceneAbout& scene : Scenes()) {
    if (!IsChosen(options, scene)) continue;
    absl::StatusOr<std::vector<std::string>> files = FindWhatSceneNeeds(scene, roots);
    if (files.ok()) {
      scenes.push_back({&scene, *std::move(files)});
    } else if (absl::IsUnimplemented(files.status()) && !console.json()) {
      not_built.emplace_back(scene.name);
      to_build =
          std::string(absl::StripPrefix(files.status().message(), absl::StrCat(scene.name, ": ")));
    } else {
      LeaveOut(scene, roots, files.status(), console);
    }
  }
  if (!not_built.empty()) {
    console.Say(absl::StrCat("left out: ", absl::StrJoin(not_built, ", "), "; ", to_build));
  }
  if (scenes.empty()) return absl::NotFoundError("none of these scenes can be played");
  const absl::StatusOr<std::unique_ptr<Connection>> connection = connect();
  if (!connection.ok()) return connection.status();
  return DemoPlayer(options, **connection, interrupt, console).Run(std::move(scenes));
}

}  // namespace voxeld::voxelctl
