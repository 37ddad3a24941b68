// An engine that records the contents of its deltas, checks every rule of gpu/delta.h, and "draws"
// by hashing the scene that it holds: equal scenes give equal pictures. Calls end when Run is
// called, or at once.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/hash/hash.h"
#include "absl/status/status.h"
#include "gpu/delta.h"
#include "gpu/engine.h"

namespace voxeld::daemon::testing {

// The scene that an engine holds. Checks ids, references and order as an engine would.
class SceneModel : public gpu::DeltaVisitor {
 public:
  struct Geometry {
    gpu::GeometryRecord record;
    std::vector<float> positions;
    std::vector<uint32_t> indices, colors;
  };

  absl::Status Apply(std::span<const std::byte> delta,
                     std::span<const gpu::BulkBlock> referred = {}) {
    puts_ = drops_ = 0;
    gpu::BlockSource bulk(referred);
    if (absl::Status status = gpu::ReadDelta(delta, *this, &bulk); !status.ok()) return status;
    for (const auto& [id, drawable] : drawables_) {
      if (!geometries_.contains(drawable.geometry)) {
        return absl::InvalidArgumentError("a drawable's geometry is not there");
      }
      if (!layers_.contains(drawable.layer)) {
        return absl::InvalidArgumentError("a drawable's layer is not there");
      }
    }
    return absl::OkStatus();
  }

  absl::Status OnGeometry(const gpu::GeometryView& g) override {
    ++puts_;
    Geometry kept{g.record,
                  {g.positions.begin(), g.positions.end()},
                  {g.indices.begin(), g.indices.end()},
                  {g.colors.begin(), g.colors.end()}};
    if (!geometries_.emplace(g.record.id, std::move(kept)).second) {
      return absl::InvalidArgumentError("a geometry's id is not new");
    }
    return absl::OkStatus();
  }
  absl::Status OnDrawable(const gpu::DrawableRecord& d) override {
    ++puts_;
    drawables_[d.id] = d;
    return absl::OkStatus();
  }
  absl::Status OnLayer(const gpu::LayerRecord& l) override {
    ++puts_;
    layers_[l.id] = l;
    return absl::OkStatus();
  }
  absl::Status OnDrop(gpu::Op op, uint64_t id) override {
    ++drops_;
    const size_t dropped = op == gpu::Op::kDropGeometry   ? geometries_.erase(id)
                           : op == gpu::Op::kDropDrawable ? drawables_.erase(id)
                                                          : layers_.erase(id);
    return dropped == 1 ? absl::OkStatus()
                        : absl::InvalidArgumentError("dropped what is not there");
  }
  absl::Status OnReset() override {
    geometries_.clear();
    drawables_.clear();
    layers_.clear();
    return absl::OkStatus();
  }

  // Returns what is drawn, without ids: each drawable with its geometry's content and its layer, in
  // a canonical order. With `visible_only`, the contents of hidden layers are left out.
  std::vector<std::string> Canonical(bool visible_only = false) const {
    std::vector<std::string> all;
    const auto bytes = [](const auto& values) {
      using T = typename std::decay_t<decltype(values)>::value_type;
      return std::string(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    };
    const auto raw = [](const auto& value) {
      return std::string(reinterpret_cast<const char*>(&value), sizeof(value));
    };
    for (const auto& [id, layer] : layers_) {
      if (!visible_only) all.push_back("layer" + raw(layer));
    }
    for (const auto& [id, d] : drawables_) {
      const gpu::LayerRecord& layer = layers_.at(d.layer);
      if (visible_only && layer.visible == 0) continue;
      const Geometry& g = geometries_.at(d.geometry);
      gpu::GeometryRecord record = g.record;
      record.id = 0;
      all.push_back("drawable" + raw(layer) + raw(d.priority) + raw(d.erase) + raw(d.transform) +
                    raw(record) + bytes(g.positions) + bytes(g.indices) + bytes(g.colors));
    }
    std::sort(all.begin(), all.end());
    return all;
  }

  const std::map<uint64_t, Geometry>& geometries() const { return geometries_; }
  const std::map<uint64_t, gpu::DrawableRecord>& drawables() const { return drawables_; }
  const std::map<uint64_t, gpu::LayerRecord>& layers() const { return layers_; }
  int puts() const { return puts_; }    // of the last delta
  int drops() const { return drops_; }  // of the last delta

 private:
  std::map<uint64_t, Geometry> geometries_;
  std::map<uint64_t, gpu::DrawableRecord> drawables_;
  std::map<uint64_t, gpu::LayerRecord> layers_;
  int puts_ = 0, drops_ = 0;
};

// The state of its engines that a test sets and reads; outlives them.
struct EngineScript {
  uint64_t memory_bytes = 0;         // the memory that frames report as used by the engine
  bool inline_calls = true;          // false: calls wait for Run
  std::optional<absl::Status> fail;  // the next frame ends with this error, once
  bool fail_staging = false;         // the next AcquireStaging is refused, once
  int engines = 0;                   // number made so far
  std::vector<gpu::Target> targets;  // the targets set so far
  std::vector<uint64_t> frames;      // the frames drawn so far
  std::deque<std::function<void()>> calls;
  SceneModel* scene = nullptr;                    // of the newest engine; null without engines
  std::function<void(uint64_t frame)> on_submit;  // called when a frame is requested
  // called when a frame is drawn
  std::function<void(uint64_t frame, const SceneModel& scene)> on_frame;

  // Carries out waiting calls. Returns false if there were none.
  bool Run() {
    if (calls.empty()) return false;
    while (!calls.empty()) {
      const std::function<void()> call = std::move(calls.front());
      calls.pop_front();
      call();
    }
    return true;
  }
};

class RecordingEngine final : public gpu::Engine {
 public:
  explicit RecordingEngine(std::shared_ptr<EngineScript> script) : script_(std::move(script)) {
    ++script_->engines;
    script_->scene = &scene_;
    info_.device = "recording";
    info_.reason = "a test";
  }
  ~RecordingEngine() override {
    script_->Run();
    if (script_->scene == &scene_) script_->scene = nullptr;
  }

  const gpu::EngineInfo& info() const override { return info_; }

  void SetTarget(gpu::Target target, Done done) override {
    Call([this, target = std::move(target), done = std::move(done)] {
      if (gone_) return done(absl::DataLossError("gone"));
      script_->targets.push_back(target);
      done(absl::OkStatus());
    });
  }

  absl::StatusOr<gpu::StagingBlock> AcquireStaging(size_t size) override {
    if (std::exchange(script_->fail_staging, false)) {
      return absl::ResourceExhaustedError("no staging memory");
    }
    struct Memory final : gpu::StagingBlock::Memory {
      explicit Memory(size_t size) : words((size + 15) / 16 * 2), size(size) {}
      std::span<std::byte> bytes() override {
        return std::as_writable_bytes(std::span(words)).first(size);
      }
      std::vector<uint64_t> words;
      size_t size;
    };
    return gpu::StagingBlock(std::make_shared<Memory>(size));
  }

  void Apply(gpu::StagingBlock block, size_t size, Done done) override {
    Call([this, block = std::move(block), size, done = std::move(done)] {
      done(gone_ ? absl::DataLossError("gone")
                 : scene_.Apply(block.bytes().first(size), block.referred()));
    });
  }

  void SubmitFrame(const gpu::FrameRequest& request, gpu::FrameBuffer buffer,
                   FrameDone done) override {
    if (script_->on_submit) script_->on_submit(request.frame);
    Call([this, request, buffer, done = std::move(done)] {
      if (script_->fail.has_value()) {
        const absl::Status status = *std::exchange(script_->fail, std::nullopt);
        gone_ = gone_ || absl::IsDataLoss(status);
        return done(status);
      }
      if (gone_) return done(absl::DataLossError("gone"));
      script_->frames.push_back(request.frame);
      if (script_->on_frame) script_->on_frame(request.frame, scene_);
      gpu::FrameResult result;
      result.frame = request.frame;
      std::vector<std::string> content = scene_.Canonical(/*visible_only=*/true);
      result.changed = !last_.has_value() || content != *last_;
      if (result.changed) changed_in_ = request.frame;
      last_ = std::move(content);
      result.lit_voxels = last_->size();
      result.memory_bytes = script_->memory_bytes;
      result.assemble_ns = 1000;
      result.slice_ns = 2000;
      const size_t hash = absl::Hash<std::vector<std::string>>()(*last_);
      for (size_t i = 0; i < buffer.bytes.size(); ++i) {
        buffer.bytes[i] = std::byte(hash >> (i % sizeof(hash) * 8));
      }
      for (uint64_t& changed : buffer.changed_in) changed = changed_in_;
      done(result);
    });
  }

  void ReadVoxels(gpu::VoxelBox, std::span<uint32_t>, Done done) override {
    done(absl::UnimplementedError("a recording engine has no voxels"));
  }

 private:
  void Call(std::function<void()> call) {
    if (script_->inline_calls) {
      call();
    } else {
      script_->calls.push_back(std::move(call));
    }
  }

  const std::shared_ptr<EngineScript> script_;
  gpu::EngineInfo info_;
  SceneModel scene_;
  bool gone_ = false;
  std::optional<std::vector<std::string>> last_;
  uint64_t changed_in_ = 0;
};

}  // namespace voxeld::daemon::testing
