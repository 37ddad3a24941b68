#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "display/sync/clock.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/commands/end_patterns.h"
#include "tools/voxelctl/commands/own_layer.h"
#include "tools/voxelctl/commands/play_summary.h"
#include "tools/voxelctl/connection/scene_session.h"
#include "tools/voxelctl/import/importer.h"
#include "tools/voxelctl/scene/look.h"
#include "tools/voxelctl/scene/pack.h"
#include "tools/voxelctl/scene/placement.h"
#include "tools/voxelctl/shape/drawing.h"
#include "tools/voxelctl/text/escape.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

constexpr double kSecondsPerTurn = 8;
constexpr sync::TimeNs kAnswerTime = 30 * sync::kSecond;   // for the scene to be taken in
constexpr sync::TimeNs kOutcomeTime = 10 * sync::kSecond;  // for a still scene to be shown
constexpr sync::TimeNs kLastOutcomeTime = 2 * sync::kSecond;
constexpr sync::TimeNs kLiveLineTime = 200 * sync::kMillisecond;
constexpr uint64_t kStagedBytes = 8 << 20;
constexpr uint64_t kDefinitionBytes = 256;  // of a definition, beside its vertices, about
constexpr size_t kLabelBytes = 200;

absl::StatusOr<std::vector<Model>> ReadFiles(const PlayOptions& options, Interrupt& interrupt,
                                             Console& console) {
  std::vector<Model> models;
  std::vector<std::string> errors;
  for (size_t i = 0; i < options.files.size(); ++i) {
    if (interrupt.requested()) return absl::CancelledError("interrupted");
    console.ProgressBar("reading",
                        static_cast<double>(i) / static_cast<double>(options.files.size()),
                        EscapeForTerminal(options.files[i]));
    absl::StatusOr<Model> model = ImportFile(options.files[i], {.globe = options.globe});
    if (model.ok()) {
      if (!model->note.empty()) console.Say(EscapeForTerminal(model->note));
      models.push_back(*std::move(model));
    } else {
      errors.emplace_back(model.status().message());
    }
  }
  if (!errors.empty()) {
    if (options.files.size() > errors.size())
      errors.emplace_back("nothing is put up unless all files can be");
    return absl::InvalidArgumentError(absl::StrJoin(errors, "\n"));
  }
  const auto is_globe = [](const Model& model) { return model.globe; };
  if (options.globe && std::none_of(models.begin(), models.end(), is_globe)) {
    return absl::InvalidArgumentError(
        "--globe is for maps (GeoJSON, TopoJSON), and none of the files is one");
  }
  return models;
}

// What all of `displays` show; the first one's, if they show nothing in common.
absl::StatusOr<DisplaySpace> CommonSpace(std::span<const v1::DisplayDescription* const> displays) {
  std::optional<DisplaySpace> common;
  for (const v1::DisplayDescription* display : displays) {
    if (display->scene_to_voxel().m_size() != 12) continue;
    gpu::Affine view;
    std::copy(display->scene_to_voxel().m().begin(), display->scene_to_voxel().m().end(), view.m);
    const v1::VoxelGrid& grid = display->geometry().grid();
    absl::StatusOr<DisplaySpace> space =
        VisibleSpace(grid.nx(), grid.ny(), grid.nz(), view,
                     display->geometry().has_rotor() || display->geometry().has_helix());
    if (!space.ok()) return space.status();
    common = common ? Intersection(*common, *space) : *space;
  }
  return common.value_or(DisplaySpace());
}

absl::StatusOr<DisplaySpace> ChooseSpace(Connection& connection, const std::string& name,
                                         Console& console) {
  const absl::StatusOr<v1::ListDisplaysResponse> all = connection.ListDisplays();
  if (!all.ok()) return all.status();
  std::vector<const v1::DisplayDescription*> displays;
  std::vector<std::string> names;
  for (const v1::DisplayDescription& display : all->displays()) {
    names.push_back(EscapeForTerminal(display.name()));
    if (name.empty() || display.name() == name) displays.push_back(&display);
  }
  if (!name.empty() && displays.empty()) {
    return absl::NotFoundError(absl::StrCat("there is no display \"", EscapeForTerminal(name),
                                            "\"; there are ", absl::StrJoin(names, ", ")));
  }
  if (displays.empty()) console.Say("the server has no display: the scene is put up unseen");
  return CommonSpace(displays);
}

// At most kLabelBytes of what a person calls the file; no code point is cut.
std::string Label(const std::string& path) {
  std::string label = EscapeForTerminal(std::filesystem::path(path).filename().string());
  if (label.size() <= kLabelBytes) return label;
  size_t end = kLabelBytes;
  while (end > 0 && (label[end] & 0xc0) == 0x80) --end;
  return label.substr(0, end);
}

class Player {
 public:
  Player(const PlayOptions& options, Connection& connection, Interrupt& interrupt, Console& console)
      : options_(options), connection_(connection), interrupt_(interrupt), console_(console) {}

  absl::Status Run(std::vector<Model> models) {
    absl::StatusOr<DisplaySpace> space = ChooseSpace(connection_, options_.display, console_);
    if (!space.ok()) return space.status();
    space_ = *space;
    PlaceModels(models, space_, {.up = options_.up, .spin = options_.spin, .each = options_.each});
    ApplyLook(models, {.fill = options_.fill, .flat = options_.flat});

    absl::StatusOr<std::vector<OwnedLayer>> before = DrawnBefore(connection_);
    if (!before.ok()) return before.status();
    absl::Status status = Open();
    had_layer_ = status.ok() && std::any_of(before->begin(), before->end(), [&](const auto& one) {
                   return one.owner == session_->server().owner;
                 });
    if (status.ok()) status = PutUp(std::move(models));
    // After the new scene is in: for a moment both may be up, but never neither.
    if (status.ok()) status = TakeOthersDown(*std::move(before));
    if (!status.ok()) return status;
    status = Stay();
    if (status.ok() && options_.clear) status = ClearMine();
    const absl::Status settled =
        session_->WaitSettled(options_.spin ? kLastOutcomeTime : kOutcomeTime);
    const absl::Status closed = session_->Close();
    summary_.duration_ns = clock_.Now() - start_;
    summary_.still_up = status.ok() && !options_.clear && !taken_down_;
    summary_.tally = session_->client().GetTally();
    summary_.latencies_ns = session_->client().latencies_ns();
    Report(std::move(summary_), console_);
    if (!settled.ok() && status.ok()) console_.Say(settled.message());
    return status.ok() ? closed : status;
  }

 private:
  absl::Status Open() {
    client::Options open;
    open.client_name = "voxelctl play";
    open.on_disconnect =
        options_.clear ? client::OnDisconnect::kClear : client::OnDisconnect::kKeep;
    open.strict = true;
    absl::StatusOr<std::unique_ptr<SceneSession>> session =
        connection_.OpenSession(std::move(open));
    if (!session.ok()) return session.status();
    session_ = *std::move(session);
    layer_ = session_->client().GetLayer(kLayer);
    start_ = clock_.Now();
    summary_.layer = kLayer;
    summary_.owner = session_->server().owner;
    return absl::OkStatus();
  }

  absl::Status CommitAndWait() {
    staged_bytes_ = staged_operations_ = 0;
    return session_->CommitAndWait(kAnswerTime);
  }

  // Definitions draw nothing, so they may be committed in as many steps as the limits want.
  absl::Status SendDefinition(const std::string& object, std::vector<client::Part> parts,
                              uint64_t bytes, uint64_t total) {
    const client::Limits& limits = session_->server().limits;
    uint64_t most_bytes = kStagedBytes;
    if (limits.max_uncommitted_bytes > 0)
      most_bytes = std::min(most_bytes, limits.max_uncommitted_bytes);
    uint64_t most_operations = limits.max_operations_per_commit;
    if (most_operations == 0) most_operations = UINT64_MAX;
    bytes += kDefinitionBytes;
    if (staged_operations_ > 0 &&
        (staged_bytes_ + bytes > most_bytes || staged_operations_ + 1 > most_operations)) {
      absl::Status status = CommitAndWait();
      if (!status.ok()) return status;
    }
    staged_bytes_ += bytes;
    ++staged_operations_;
    sent_bytes_ += bytes;
    console_.ProgressBar("sending", static_cast<double>(sent_bytes_) / static_cast<double>(total),
                         absl::StrCat(Bytes(sent_bytes_), " of about ", Bytes(total)));
    return session_->client().DefineObject(object, std::move(parts));
  }

  absl::Status PutUp(std::vector<Model> models) {
    uint64_t total = 1;
    for (const Model& model : models) {
      for (const Part& part : model.parts)
        total += part.positions.size() * 15 + part.indices.size() * 2;
    }
    for (size_t i = 0; i < models.size(); ++i) {
      const absl::StatusOr<PackedSizes> sizes = PackObject(
          models[i], Object(i), session_->server().limits,
          [&](const std::string& object, std::vector<client::Part> parts, uint64_t bytes) {
            return SendDefinition(object, std::move(parts), bytes, total);
          });
      if (!sizes.ok()) return sizes.status();
      summary_.files.push_back({models[i].path, models[i].format, models[i].note, sizes->vertices,
                                sizes->indices, sizes->objects, sizes->bytes});
      models[i].parts = {};  // sent; the memory is not needed any more
    }
    if (staged_operations_ > 0) {
      absl::Status status = CommitAndWait();
      if (!status.ok()) return status;
    }
    absl::Status status = TakePatternsDown();
    if (!status.ok()) return status;
    // One frame replaces the layer whole, should this owner have had it before.
    if (had_layer_) {
      const client::LayerLook plain{.clip = std::vector<client::ClipPart>(), .mask = ""};
      if (absl::Status set = layer_->Set(plain); !set.ok()) return set;
    }
    client::Frame frame = layer_->BeginFrame();
    for (size_t i = 0; i < models.size(); ++i) {
      frame.Draw(
          Id(i), client::Instance{Object(i)},
          {.transform = ToClient(InstanceTransform(space_, 0)), .label = Label(models[i].path)});
    }
    status = frame.End();
    return status.ok() ? CommitAndWait() : status;
  }

  absl::Status TakeOthersDown(std::vector<OwnedLayer> before) {
    const uint64_t own = session_->server().owner;
    // The layer was replaced whole; masks are never this command's.
    std::erase_if(before, [own](const OwnedLayer& layer) {
      return layer.owner == own && layer.layer == kLayer;
    });
    const absl::StatusOr<TakenDown> taken = TakeDown(before, connection_);
    if (!taken.ok()) return taken.status();
    if (!taken->stay.empty()) console_.Say(OthersStay(taken->stay));
    return absl::OkStatus();
  }

  // A pattern would hide the scene. When it has gone the scene's commit is not "hidden" any more.
  absl::Status TakePatternsDown() {
    const absl::StatusOr<EndedPatterns> patterns = EndPatterns(connection_);
    if (!patterns.ok()) return patterns.status();
    for (const std::string& display : patterns->ended) {
      console_.Say(absl::StrCat("ended the test pattern on ", EscapeForTerminal(display)));
    }
    if (!patterns->stay.empty()) console_.Say(PatternsStay(*patterns));
    return absl::OkStatus();
  }

  static std::string Id(size_t file) { return absl::StrCat(file + 1); }
  static std::string Object(size_t file) { return absl::StrCat("voxelctl/", file + 1); }

  static client::Affine ToClient(const gpu::Affine& transform) {
    client::Affine out;
    std::copy(std::begin(transform.m), std::end(transform.m), out.m.begin());
    return out;
  }

  sync::TimeNs End() const {
    if (options_.duration_s) return start_ + std::llround(*options_.duration_s * 1e9);
    // What is taken down at the end must have been up for someone.
    return options_.spin || options_.clear ? sync::kNever : start_;
  }

  std::string UntilWhen() const {
    return absl::StrCat(options_.spin ? "it is up and spins " : "it is up ",
                        options_.duration_s ? absl::StrFormat("for %g s; Ctrl-C ends it before",
                                                              *options_.duration_s)
                                            : "until Ctrl-C");
  }

  absl::Status Stay() {
    if (End() > clock_.Now()) console_.Say(UntilWhen());
    if (options_.spin) return Spin();
    if (End() > clock_.Now()) {
      interrupt_.WaitUntil(clock_, End());
    }
    return absl::OkStatus();
  }

  absl::Status Spin() {
    const sync::TimeNs began = clock_.Now();
    const double period_ns = 1e9 / options_.fps;
    sync::TimeNs next_line = began;
    for (int64_t frame = 1;;) {
      const sync::TimeNs due = began + std::llround(static_cast<double>(frame) * period_ns);
      if (due >= End()) {
        interrupt_.WaitUntil(clock_, End());
        return absl::OkStatus();
      }
      if (interrupt_.WaitUntil(clock_, due)) return absl::OkStatus();
      const sync::TimeNs now = clock_.Now();
      // Frames whose time has passed are not made up for.
      frame =
          std::max(frame, static_cast<int64_t>(static_cast<double>(now - began) / period_ns)) + 1;
      if (!session_->client().HasRoom()) {
        ++summary_.frames_skipped;
        continue;
      }
      absl::Status status = Turn(static_cast<double>(now - began) / 1e9 / kSecondsPerTurn);
      if (!status.ok()) return status;
      ++summary_.frames;
      if (session_->client().GetTally().not_found > 0) {
        console_.Say("the scene was taken down by another client");
        taken_down_ = true;
        return absl::OkStatus();
      }
      if (console_.live() && now >= next_line) {
        next_line = now + kLiveLineTime;
        ShowLine(static_cast<double>(now - began) / 1e9);
      }
    }
  }

  absl::Status Turn(double turns) {
    for (size_t i = 0; i < summary_.files.size(); ++i) {
      const absl::Status status =
          layer_->SetTransform(Id(i), ToClient(InstanceTransform(space_, turns)));
      if (!status.ok()) return status;
    }
    return session_->Commit();
  }

  void ShowLine(double seconds) {
    std::string line =
        absl::StrFormat("spinning %.0f s, %s", seconds, Counted(summary_.frames, "frame"));
    for (const auto& [name, counts] : session_->client().GetTally().displays) {
      absl::StrAppend(&line, ", ", EscapeForTerminal(name), " ", Grouped(counts.presented),
                      " presented ", Grouped(counts.lost), " lost");
    }
    console_.Progress(absl::StrCat(line, "; Ctrl-C ends"));
  }

  absl::Status ClearMine() {
    const absl::Status status = session_->client().RemoveAll();
    return status.ok() ? session_->Commit() : status;
  }

  const PlayOptions& options_;
  Connection& connection_;
  Interrupt& interrupt_;
  Console& console_;
  sync::SystemClock clock_;
  DisplaySpace space_;
  std::unique_ptr<SceneSession> session_;
  std::optional<client::Layer> layer_;
  sync::TimeNs start_ = 0;
  uint64_t staged_bytes_ = 0, staged_operations_ = 0, sent_bytes_ = 0;
  bool taken_down_ = false;
  bool had_layer_ = false;  // of a command before, of the same owner: who has a token has one owner
  PlaySummary summary_;
};

}  // namespace

absl::Status Play(const PlayOptions& options, const Connector& connect, Interrupt& interrupt,
                  Console& console) {
  absl::StatusOr<std::vector<Model>> models = ReadFiles(options, interrupt, console);
  if (!models.ok()) return models.status();
  const absl::StatusOr<std::unique_ptr<Connection>> connection = connect();
  if (!connection.ok()) return connection.status();
  return Player(options, **connection, interrupt, console).Run(*std::move(models));
}

}  // namespace voxeld::voxelctl
