#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"
#include "display/sync/clock.h"
#include "tools/voxelctl/commands/choose_space.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/commands/end_patterns.h"
#include "tools/voxelctl/commands/not_showing.h"
#include "tools/voxelctl/commands/own_layer.h"
#include "tools/voxelctl/commands/play_files.h"
#include "tools/voxelctl/commands/play_summary.h"
#include "tools/voxelctl/connection/scene_session.h"
#include "tools/voxelctl/import/frames.h"
#include "tools/voxelctl/scene/color_by.h"
#include "tools/voxelctl/scene/look.h"
#include "tools/voxelctl/scene/pack.h"
#include "tools/voxelctl/scene/placement.h"
#include "tools/voxelctl/shape/drawing.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

constexpr double kSecondsPerTurn = 8;
constexpr sync::TimeNs kAnswerTime = 30 * sync::kSecond;   // for the scene to be accepted
constexpr sync::TimeNs kOutcomeTime = 10 * sync::kSecond;  // for a static scene to be shown
constexpr sync::TimeNs kLastOutcomeTime = 2 * sync::kSecond;
constexpr sync::TimeNs kLiveLineTime = 200 * sync::kMillisecond;
constexpr uint64_t kStagedBytes = 8 << 20;
constexpr uint64_t kDefinitionBytes = 256;  // approximate size of a definition without its vertices
constexpr size_t kLabelBytes = 200;
constexpr size_t kSwatches = 32;         // in a legend
constexpr int64_t kMeasuredFrames = 16;  // of a sequence, to determine its placement

// Returns the file's readable name, of at most kLabelBytes, cut between code points.
std::string Label(const std::string& path) {
  std::string label = EscapeForTerminal(std::filesystem::path(path).filename().string());
  if (label.size() <= kLabelBytes) return label;
  size_t end = kLabelBytes;
  while (end > 0 && (label[end] & 0xc0) == 0x80) --end;
  return label.substr(0, end);
}

class Player {
 public:
  Player(const PlayOptions& options, const DisplaySpace& space, Connection& connection,
         Interrupt& interrupt, Console& console)
      : options_(options),
        space_(space),
        connection_(connection),
        interrupt_(interrupt),
        console_(console) {}

  absl::Status Run(std::vector<Model> models) {
    if (absl::Status status = Color(models); !status.ok()) return status;
    PlaceModels(models, space_, {.up = options_.up, .spin = options_.spin, .each = options_.each});
    ApplyLook(models, {.fill = options_.fill, .flat = options_.flat});
    if (absl::Status status = Open(); !status.ok()) return status;
    absl::Status status = PutUp(std::move(models));
    // Removes the old scene after the new one was added: for a moment both may be visible, but
    // never neither.
    if (status.ok()) status = TakeBeforeDown();
    if (!status.ok()) return status;
    Announce();
    return Finish(Stay());
  }

  // Shows frames one after another at their times; late ones are skipped.
  absl::Status Run(FrameSource& source) {
    FramePlacement placement(options_.up);
    const int64_t last = source.count() - 1;
    const int64_t measured = std::min(last, kMeasuredFrames - 1);
    for (int64_t i = 0; i <= measured; ++i) {
      if (interrupt_.requested()) return absl::CancelledError("interrupted");
      console_.ProgressBar("measuring", static_cast<double>(i) / static_cast<double>(measured + 1),
                           "");
      const absl::StatusOr<Model> model = source.Read(measured == 0 ? 0 : last * i / measured);
      if (!model.ok()) return model.status();
      placement.Measure(*model);
    }
    placement.Fit(space_, options_.spin);
    FrameAhead ahead(source);
    ahead.Ask(0);
    if (absl::Status status = Open(); !status.ok()) return status;
    const absl::Status status = ShowFrames(ahead, placement, source.count());
    return status.ok() ? Finish(status) : status;
  }

 private:
  // Colours by an attribute if requested. The range of the first models is used for all later ones.
  absl::Status Color(std::span<Model> models) {
    if (options_.color_by.empty()) return absl::OkStatus();
    ColorBy wanted{.attribute = options_.color_by,
                   .colormap = options_.volume.colormap,
                   .range = options_.range};
    const std::optional<Legend>& known = summary_.legend;
    if (known && known->low < known->high) wanted.range = {known->low, known->high};
    const absl::StatusOr<Legend> legend = ApplyColorBy(wanted, models);
    if (!legend.ok()) return legend.status();
    if (!summary_.legend) summary_.legend = *legend;
    return absl::OkStatus();
  }

  // Waits for the displays and prints which of them show the files, the legend, and the parts that
  // are not shown.
  void Announce() {
    const bool moving = options_.spin || summary_.frames > 0;
    const absl::Status settled = session_->WaitSettled(moving ? kLastOutcomeTime : kOutcomeTime);
    up_since_ = clock_.Now();
    std::vector<std::string> displays;
    for (const auto& [name, counts] : session_->client().GetTally().displays) {
      if (counts.presented + counts.unchanged > 0 && counts.lost == 0 && counts.not_shown == 0)
        displays.push_back(EscapeForTerminal(name));
    }
    const std::vector<PlayedFile>& files = summary_.files;
    const std::string label = files.empty() ? "it" : Label(files[0].path);
    const bool many = files.size() > 1;
    const std::string subject = many ? absl::StrCat(label, " and ", files.size() - 1, " more are")
                                     : absl::StrCat(label, " is");
    console_.Say(displays.empty()
                     ? absl::StrCat(subject, " accepted, but no display has shown ",
                                    many ? "them" : "it", " yet", settled.ok() ? "" : ": ",
                                    settled.message())
                     : absl::StrCat(subject, " up on ", absl::StrJoin(displays, " and ")));
    if (summary_.legend) {
      console_.Say(LegendText(*summary_.legend));
      console_.Swatches(LegendColors(*summary_.legend, kSwatches));
    }
    for (const PlayedFile& file : files) {
      if (!file.note.empty()) console_.Say(EscapeForTerminal(file.note));
    }
    for (const std::string& sentence : later_) console_.Say(sentence);
    if (moving) return;  // an answer would concern a later frame
    std::vector<std::string> ids;
    for (size_t i = 0; i < files.size(); ++i) ids.push_back(Id(i));
    for (const std::string& sentence : Unseen(summary_.owner, kLayer, ids, connection_))
      console_.Say(sentence);
  }

  // Counts left-out content of each kind as its maximum over all frames.
  void CountLeftOut(const Model& model) {
    std::vector<LeftOut>& known = summary_.files[0].left_out;
    for (const LeftOut& one : model.left_out) {
      const auto same = std::find_if(known.begin(), known.end(),
                                     [&](const LeftOut& other) { return other.kind == one.kind; });
      if (same == known.end()) {
        known.push_back(one);
        console_.Say(absl::StrCat(EscapeForTerminal(model.path), ": left out: ",
                                  EscapeForTerminal(one.kind), " (", one.count, ")"));
      } else {
        same->count = std::max(same->count, one.count);
      }
    }
  }

  // Resets the layer's style. A frame replaces the contents of the layer completely, but not the
  // style that an earlier command of the same owner set.
  absl::Status LookPlain() {
    if (!had_layer_) return absl::OkStatus();
    return layer_->Set({.clip = std::vector<client::ClipPart>(), .mask = ""});
  }

  absl::Status TakeBeforeDown() {
    const uint64_t own = session_->server().owner;
    // The layer was replaced completely; masks never belong to this command.
    std::erase_if(before_, [own](const OwnedLayer& layer) {
      return layer.owner == own && layer.layer == kLayer;
    });
    const absl::StatusOr<TakenDown> taken = TakeDown(before_, connection_);
    if (!taken.ok()) return taken.status();
    if (!taken->stay.empty()) later_.push_back(OthersStay(taken->stay));
    return absl::OkStatus();
  }

  absl::Status Finish(absl::Status status) {
    if (status.ok() && options_.clear) status = ClearMine();
    const bool moving = options_.spin || summary_.frames > 0;
    const absl::Status settled = session_->WaitSettled(moving ? kLastOutcomeTime : kOutcomeTime);
    const absl::Status closed = session_->Close();
    summary_.duration_ns = clock_.Now() - start_;
    summary_.still_up = status.ok() && !options_.clear && !taken_down_;
    summary_.tally = session_->client().GetTally();
    summary_.latencies_ns = session_->client().latencies_ns();
    Report(std::move(summary_), console_);
    if (!settled.ok() && status.ok()) console_.Say(settled.message());
    return status.ok() ? closed : status;
  }

  absl::Status Open() {
    absl::StatusOr<std::vector<OwnedLayer>> before = DrawnBefore(connection_);
    if (!before.ok()) return before.status();
    before_ = *std::move(before);
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
    had_layer_ = std::any_of(before_.begin(), before_.end(),
                             [&](const OwnedLayer& one) { return one.owner == summary_.owner; });
    return absl::OkStatus();
  }

  absl::Status CommitAndWait() {
    staged_bytes_ = staged_operations_ = 0;
    return session_->CommitAndWait(kAnswerTime);
  }

  // Definitions draw nothing, so they may be committed in as many steps as the limits require.
  absl::Status Stage(const std::string& object, std::vector<client::Part> parts, uint64_t bytes) {
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
    return session_->client().DefineObject(object, std::move(parts));
  }

  absl::Status SendDefinition(const std::string& object, std::vector<client::Part> parts,
                              uint64_t bytes, uint64_t total) {
    sent_bytes_ += bytes + kDefinitionBytes;
    console_.ProgressBar(
        "sending", std::min(1.0, static_cast<double>(sent_bytes_) / static_cast<double>(total)),
        absl::StrCat(Bytes(sent_bytes_), " of about ", Bytes(total)));
    return Stage(object, std::move(parts), bytes);
  }

  absl::Status PutUp(std::vector<Model> models) {
    uint64_t total = 1;
    for (const Model& model : models) {
      for (const Part& part : model.parts)
        total += part.positions.size() * 15 + part.indices.size() * 2;
      for (const SampledVolume& volume : model.volumes) total += volume.samples.size();
    }
    for (size_t i = 0; i < models.size(); ++i) {
      const absl::StatusOr<PackedSizes> packed = PackObject(
          models[i], Object(i), session_->server().limits,
          [&](const std::string& object, std::vector<client::Part> parts, uint64_t bytes) {
            return SendDefinition(object, std::move(parts), bytes, total);
          },
          options_.volume, [&](absl::string_view bytes) { return Upload(models[i].path, bytes); });
      if (!packed.ok()) return About(models[i], packed.status());
      Describe(models[i], *packed);
      paths_.push_back(models[i].path);
      models[i] = {};  // the server has it now
    }
    if (staged_operations_ > 0) {
      absl::Status status = CommitAndWait();
      if (!status.ok()) return status;
    }
    absl::Status status = TakePatternsDown();
    if (!status.ok()) return status;
    if (absl::Status plain = LookPlain(); !plain.ok()) return plain;
    client::Frame frame = layer_->BeginFrame();
    for (size_t i = 0; i < paths_.size(); ++i) DrawObject(i, Object(i), 0, paths_[i], &frame);
    status = frame.End();
    return status.ok() ? CommitAndWait() : status;
  }

  // Uploads samples that do not fit into a message.
  absl::StatusOr<client::Asset> Upload(const std::string& path, absl::string_view bytes) {
    return connection_.UploadAsset(bytes, [&](uint64_t stored, uint64_t size) {
      console_.ProgressBar(EscapeForTerminal(path),
                           static_cast<double>(stored) / static_cast<double>(size),
                           absl::StrCat(Bytes(stored), " of ", Bytes(size)));
      return !interrupt_.requested();
    });
  }

  // Adds the model to an error that is caused by the model and not by the connection.
  static absl::Status About(const Model& model, const absl::Status& status) {
    if (!absl::IsInvalidArgument(status)) return status;
    return absl::InvalidArgumentError(absl::StrCat(model.path, ": ", status.message()));
  }

  void Describe(const Model& model, const PackedSizes& sizes) {
    std::string note = NoteOf(model);
    if (!sizes.note.empty()) {
      note = note.empty() ? absl::StrCat(model.path, ": ", sizes.note)
                          : absl::StrCat(note, "; ", sizes.note);
    }
    summary_.files.push_back({model.path, model.format, std::move(note), model.left_out, 1,
                              sizes.vertices, sizes.indices, sizes.samples, sizes.objects,
                              sizes.bytes});
  }

  absl::Status ShowFrames(FrameAhead& ahead, const FramePlacement& placement, int64_t count) {
    sync::TimeNs began = 0, next_line = 0, end = sync::kNever;
    const double period_ns = 1e9 / options_.fps;
    const auto due = [&](int64_t frame) -> sync::TimeNs {
      return began + std::llround(static_cast<double>(frame) * period_ns);
    };
    for (int64_t frame = 0; frame >= 0;) {
      absl::StatusOr<Model> model = ahead.Take();
      if (!model.ok() && interrupt_.requested() && frame > 0) return absl::OkStatus();
      if (!model.ok()) return model.status();
      if (frame == 0) began = clock_.Now();
      if (frame > 0 && due(frame) >= end) break;
      const auto now = static_cast<int64_t>(static_cast<double>(clock_.Now() - began) / period_ns);
      int64_t next = std::max(frame + 1, now);
      // The last frame is never skipped.
      if (!options_.loop) next = frame == count - 1 ? -1 : std::min(next, count - 1);
      if (next > frame) {
        summary_.frames_skipped += static_cast<uint64_t>(next - frame - 1);
        ahead.Ask(next % count);
      }
      if (interrupt_.WaitUntil(clock_, due(frame))) return absl::OkStatus();
      if (frame == 0 || next < 0 || session_->client().HasRoom()) {
        const double turns =
            options_.spin ? static_cast<double>(clock_.Now() - began) / 1e9 / kSecondsPerTurn : 0;
        absl::Status status = PutFrame(*std::move(model), placement, turns);
        if (!status.ok()) return status;
        if (frame == 0) {  // all displays have answered
          began = clock_.Now();
          if (options_.duration_s) end = began + std::llround(*options_.duration_s * 1e9);
        }
        ++summary_.frames;
      } else {
        ++summary_.frames_skipped;
      }
      if (session_->client().GetTally().refused > 0) {
        return absl::FailedPreconditionError("the server refused a frame; the one before stays up");
      }
      if (console_.live() && clock_.Now() >= next_line) {
        next_line = clock_.Now() + kLiveLineTime;
        ShowLine("playing", static_cast<double>(clock_.Now() - began) / 1e9);
      }
      if (next < 0) interrupt_.WaitUntil(clock_, std::min<sync::TimeNs>(due(frame + 1), end));
      frame = next;
    }
    if (end != sync::kNever) interrupt_.WaitUntil(clock_, end);
    return absl::OkStatus();
  }

  // Frames alternate between two objects: one is redefined while the other is shown.
  absl::Status PutFrame(Model model, const FramePlacement& placement, double turns) {
    const bool first = summary_.frames == 0;
    if (first) {
      if (absl::Status status = CheckOptions(options_, {&model, 1}); !status.ok()) return status;
    }
    if (absl::Status status = Color({&model, 1}); !status.ok()) return status;
    placement.Place(&model);
    ApplyLook({&model, 1}, {.fill = options_.fill, .flat = options_.flat});
    // The first frame's window is used for all frames; otherwise they would flicker.
    if (first) frame_look_ = options_.volume;
    if (first && !model.volumes.empty() && !frame_look_.window)
      frame_look_.window = WindowOf(model.volumes[0]);
    if (absl::Status plain = first ? LookPlain() : absl::OkStatus(); !plain.ok()) return plain;
    const size_t half = summary_.frames % 2;
    const std::string object = absl::StrCat("voxelctl/frame", half);
    const absl::StatusOr<PackedSizes> packed = PackObject(
        model, object, session_->server().limits,
        [&](const std::string& name, std::vector<client::Part> parts, uint64_t bytes) {
          return Stage(name, std::move(parts), bytes);
        },
        frame_look_);
    if (!packed.ok()) return About(model, packed.status());
    const absl::Status less = RemoveRest(object, halves_[half], packed->objects);
    if (!less.ok()) return less;
    halves_[half] = packed->objects;
    client::Frame frame = layer_->BeginFrame();
    DrawObject(0, object, turns, model.path, &frame);
    if (absl::Status status = frame.End(); !status.ok()) return status;
    if (!first) {
      CountLeftOut(model);
      staged_bytes_ = staged_operations_ = 0;
      return session_->Commit();
    }
    Describe(model, *packed);
    if (absl::Status status = TakePatternsDown(); !status.ok()) return status;
    if (absl::Status status = CommitAndWait(); !status.ok()) return status;
    const absl::Status status = TakeBeforeDown();
    if (status.ok()) Announce();
    return status;
  }

  // Removes pieces that the object no longer has: `before` and `now` count the object and its
  // pieces in the frame before the previous one and in this one.
  absl::Status RemoveRest(const std::string& object, uint64_t before, uint64_t now) {
    absl::Status status;
    for (uint64_t piece = now - 1; status.ok() && piece + 1 < before; ++piece)
      status = session_->client().RemoveObject(absl::StrCat(object, "/", piece));
    return status;
  }

  void DrawObject(size_t file, const std::string& object, double turns, const std::string& path,
                  client::Frame* frame) const {
    frame->Draw(Id(file), client::Instance{object},
                {.transform = ToClient(InstanceTransform(space_, turns)), .label = Label(path)});
  }

  // A pattern would hide the scene. Once it has ended, the scene's commit is not "hidden" any
  // longer.
  absl::Status TakePatternsDown() {
    const absl::StatusOr<EndedPatterns> patterns = EndPatterns(connection_);
    if (!patterns.ok()) return patterns.status();
    for (const std::string& display : patterns->ended) {
      later_.push_back(absl::StrCat("ended the test pattern on ", EscapeForTerminal(display)));
    }
    if (!patterns->stay.empty()) later_.push_back(PatternsStay(*patterns));
    return absl::OkStatus();
  }

  // "play 1", in the same way as draw's "draw 1".
  static std::string Id(size_t file) { return absl::StrCat("play ", file + 1); }
  static std::string Object(size_t file) { return absl::StrCat("voxelctl/", file + 1); }

  static client::Affine ToClient(const gpu::Affine& transform) {
    client::Affine out;
    std::copy(std::begin(transform.m), std::end(transform.m), out.m.begin());
    return out;
  }

  sync::TimeNs End() const {
    if (options_.duration_s) return up_since_ + std::llround(*options_.duration_s * 1e9);
    // Contents that are removed at the end must have been visible to someone.
    return options_.spin || options_.clear ? sync::kNever : up_since_;
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
      // Frames whose time has passed are skipped.
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
        ShowLine("spinning", static_cast<double>(now - began) / 1e9);
      }
    }
  }

  absl::Status Turn(double turns) {
    for (size_t i = 0; i < paths_.size(); ++i) {
      const absl::Status status =
          layer_->SetTransform(Id(i), ToClient(InstanceTransform(space_, turns)));
      if (!status.ok()) return status;
    }
    return session_->Commit();
  }

  void ShowLine(absl::string_view doing, double seconds) {
    std::string line =
        absl::StrFormat("%s %.0f s, %s", doing, seconds, Counted(summary_.frames, "frame"));
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
  const DisplaySpace space_;
  Connection& connection_;
  Interrupt& interrupt_;
  Console& console_;
  sync::SystemClock clock_;
  std::unique_ptr<SceneSession> session_;
  std::optional<client::Layer> layer_;
  sync::TimeNs start_ = 0;
  sync::TimeNs up_since_ = 0;  // when all displays had answered
  uint64_t staged_bytes_ = 0, staged_operations_ = 0, sent_bytes_ = 0;
  std::vector<OwnedLayer> before_;       // layers that an earlier command left
  std::vector<std::string> paths_;       // of the files that are shown
  std::array<uint64_t, 2> halves_ = {};  // number of defined objects of each alternating frame
  VolumeLook frame_look_;
  std::vector<std::string> later_;  // sentences after the first line
  bool taken_down_ = false;
  bool had_layer_ = false;  // an earlier command of the same owner made it: a token has one owner
  PlaySummary summary_;
};

}  // namespace

absl::Status Play(const PlayOptions& options, const Connector& connect, Interrupt& interrupt,
                  Console& console) {
  const absl::StatusOr<std::unique_ptr<Connection>> connection = connect();
  if (!connection.ok()) return connection.status();
  const absl::StatusOr<Room> room = ChooseSpace(**connection, options.display, console);
  if (!room.ok()) return room.status();
  const absl::StatusOr<std::unique_ptr<FrameSource>> frames =
      OpenFrameSource(options, *room, interrupt);
  if (!frames.ok()) return frames.status();
  Player player(options, room->space, **connection, interrupt, console);
  if (*frames != nullptr) return player.Run(**frames);
  absl::StatusOr<std::vector<Model>> models = ReadFiles(options, *room, interrupt, console);
  if (!models.ok()) return models.status();
  return player.Run(*std::move(models));
}

}  // namespace voxeld::voxelctl
