#include "tests/gpu/worker/faults.h"

#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <set>
#include <utility>

#include "gpu/delta.h"

namespace voxeld::gpu {
namespace {

// Keeps track of the geometries that have a colour.
class ColorWatch final : public DeltaVisitor {
 public:
  explicit ColorWatch(uint32_t color) : color_(color) {}
  bool seen() const { return !ids_.empty(); }

 private:
  absl::Status OnGeometry(const GeometryView& g) override {
    const GeometryRecord& r = g.record;
    if (r.color_mode == ColorMode::kUniform && (r.color & 0xFFFFFF) == color_ &&
        r.drawn_by == DrawnBy::kEngine) {
      ids_.insert(r.id);
    }
    return absl::OkStatus();
  }
  absl::Status OnDrawable(const DrawableRecord& d) override { return absl::OkStatus(); }
  absl::Status OnLayer(const LayerRecord& l) override { return absl::OkStatus(); }
  absl::Status OnDrop(Op op, uint64_t id) override {
    if (op == Op::kDropGeometry) ids_.erase(id);
    return absl::OkStatus();
  }
  absl::Status OnReset() override {
    ids_.clear();
    return absl::OkStatus();
  }

  uint32_t color_;
  std::set<uint64_t> ids_;
};

class FaultyLink final : public RankLink {
 public:
  explicit FaultyLink(std::string fault) : fault_(std::move(fault)) {}
  absl::StatusOr<Invitation> Invite(const std::string& library) override {
    if (fault_ == "invite") {
      return absl::FailedPreconditionError("no library \"" + library + "\", as was asked for");
    }
    Invitation invitation;
    invitation.fill(std::byte{0x5C});
    return invitation;
  }
  absl::Status Join(const std::string&, const Invitation& invitation, int rank,
                    int ranks) override {
    if (fault_ == "join" && rank == 1) {
      return absl::FailedPreconditionError("it does not come, as was asked for");
    }
    const bool mine = invitation.front() == std::byte{0x5C} && invitation == *Invite("");
    return mine && rank >= 0 && rank < ranks ? absl::OkStatus()
                                             : absl::DataLossError("another invitation");
  }

 private:
  const std::string fault_;
};

class FaultyEngine final : public Engine {
 public:
  FaultyEngine(std::unique_ptr<Engine> engine, EngineInfo info, const FaultTrigger& trigger,
               std::function<absl::Status(const std::string&)> fault,
               std::unique_ptr<RankLink> link)
      : engine_(std::move(engine)),
        info_(std::move(info)),
        trigger_(trigger),
        fault_(std::move(fault)),
        link_(std::move(link)) {
    if (trigger.color) watch_.emplace(*trigger.color);
  }

  const EngineInfo& info() const override { return info_; }
  void SetTarget(Target target, Done done) override {
    engine_->SetTarget(std::move(target), std::move(done));
  }
  absl::StatusOr<StagingBlock> AcquireStaging(size_t size) override {
    return engine_->AcquireStaging(size);
  }
  void Apply(StagingBlock block, size_t size, Done done) override {
    std::optional<ColorWatch> next = watch_;
    // The engine itself refuses malformed deltas.
    if (next && size <= block.bytes().size()) {
      BlockSource referred(block.referred());
      (void)ReadDelta(block.bytes().first(size), *next,
                      block.bulk() != nullptr ? block.bulk() : &referred);
    }
    engine_->Apply(std::move(block), size, [&](const absl::Status& status) {
      if (status.ok()) watch_ = std::move(next);
      done(status);
    });
  }
  void SubmitFrame(const FrameRequest& request, FrameBuffer buffer, FrameDone done) override {
    ++frames_;
    std::string kind = trigger_.kind;
    if (frames_ == trigger_.frame || (watch_ && watch_->seen()) || TakeFile(kind)) {
      if (absl::Status status = fault_(kind); !status.ok()) return done(status);
    }
    engine_->SubmitFrame(request, buffer, std::move(done));
  }
  void ReadVoxels(VoxelBox box, std::span<uint32_t> out, Done done) override {
    engine_->ReadVoxels(box, out, std::move(done));
  }
  RankLink* link() override { return link_ != nullptr ? link_.get() : engine_->link(); }

 private:
  // Returns whether the file existed, for this engine.
  bool TakeFile(std::string& kind) const {
    if (trigger_.file.empty()) return false;
    std::ifstream in(trigger_.file);
    if (!in || std::remove(trigger_.file.c_str()) != 0) return false;
    std::getline(in, kind);
    return true;
  }

  const std::unique_ptr<Engine> engine_;
  const EngineInfo info_;
  const FaultTrigger trigger_;
  const std::function<absl::Status(const std::string&)> fault_;
  const std::unique_ptr<RankLink> link_;
  uint64_t frames_ = 0;
  std::optional<ColorWatch> watch_;
};

}  // namespace

FaultTrigger FaultTrigger::FromEnvironment() {
  FaultTrigger trigger;
  if (const char* frame = std::getenv("VOXELD_FAULT_FRAME"); frame != nullptr) {
    trigger.frame = std::strtoull(frame, nullptr, 10);
  }
  if (const char* color = std::getenv("VOXELD_FAULT_COLOR"); color != nullptr && *color != '\0') {
    trigger.color = static_cast<uint32_t>(std::strtoul(color, nullptr, 16)) & 0xFFFFFF;
  }
  if (const char* file = std::getenv("VOXELD_FAULT_FILE"); file != nullptr) trigger.file = file;
  if (const char* kind = std::getenv("VOXELD_FAULT_KIND"); kind != nullptr) trigger.kind = kind;
  return trigger;
}

std::unique_ptr<RankLink> MakeFaultyLink() {
  const char* const fault = std::getenv("VOXELD_FAULT_LINK");
  return std::make_unique<FaultyLink>(fault != nullptr ? fault : "");
}

absl::Status Fail(const std::string& kind) {
  if (kind == "dataloss") return absl::DataLossError("a fault that was asked for");
  if (kind == "exhausted") return absl::ResourceExhaustedError("no room, as was asked for");
  if (kind == "exit") _exit(0);
  if (kind == "hang") {
    for (;;) pause();
  }
  std::raise(SIGSEGV);
  return absl::OkStatus();
}

std::unique_ptr<Engine> MakeFaulty(std::unique_ptr<Engine> engine, EngineInfo info,
                                   const FaultTrigger& trigger,
                                   std::function<absl::Status(const std::string&)> fault,
                                   std::unique_ptr<RankLink> link) {
  return std::make_unique<FaultyEngine>(std::move(engine), std::move(info), trigger,
                                        std::move(fault), std::move(link));
}

}  // namespace voxeld::gpu
