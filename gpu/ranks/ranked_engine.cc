#include "gpu/ranks/ranked_engine.h"

#include <algorithm>
#include <deque>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "display/sync/mutex.h"
#include "gpu/worker/await.h"
#include "gpu/worker/worker_engine.h"
#include "gpu/worker/worker_staging.h"

namespace voxeld::gpu {
namespace {

const absl::Status& StatusOf(const absl::Status& status) { return status; }
template <typename T>
const absl::Status& StatusOf(const absl::StatusOr<T>& result) {
  return result.status();
}

int64_t TimeOf(const FrameResult& frame) {
  return frame.assemble_ns + frame.slice_ns + frame.copy_ns;
}

class RankedEngine final : public Engine {
 public:
  RankedEngine(const EngineOptions& options, std::string reason)
      : options_(options), staging_(std::make_shared<WorkerStaging>(options.staging_limit_bytes)) {
    info_.kind = options.kind;
    info_.reason = std::move(reason);
  }

  // Closes all ranks first, because one rank's thread may still call another.
  ~RankedEngine() override {
    for (const std::unique_ptr<RankWorker>& rank : ranks_) rank->Close();
  }

  absl::Status Open() {
    const int count = static_cast<int>(options_.devices.size());
    std::vector<std::unique_ptr<RankWorker>> ranks;
    for (int r = 0; r < count; ++r) {
      EngineOptions own = options_;
      own.device = options_.devices[static_cast<size_t>(r)];
      own.part.rank = r;
      own.part.ranks = count;
      own.lost = [this, r](const absl::Status& status) { OnLost(r, status); };
      absl::StatusOr<std::unique_ptr<RankWorker>> rank = CreateRankWorker(
          own, staging_, [this, r](const absl::Status& status) { OnOpened(r, status); });
      if (!rank.ok()) return Named(r, rank.status());
      ranks.push_back(*std::move(rank));
    }
    absl::Status lost;
    {
      sync::MutexLock lock(state_mutex_);
      ranks_ = std::move(ranks);
      lost = lost_;
    }
    if (!lost.ok()) GiveUp(lost);
    OnOpened(-1, absl::OkStatus());
    if (!options_.wait_until_ready) return absl::OkStatus();
    sync::MutexLock lock(state_mutex_);
    while (!setup_.has_value()) settled_.Wait(state_mutex_);
    return *setup_;
  }

  const EngineInfo& info() const override { return info_; }

  void SetTarget(Target target, Done done) override {
    Ask<absl::Status>(std::move(done),
                      [target = std::move(target)](RankWorker& rank, size_t, Done answered) {
                        rank.SetTarget(target, std::move(answered));
                      });
  }

  absl::StatusOr<StagingBlock> AcquireStaging(size_t size) override {
    return staging_->Acquire(size);
  }

  void Apply(StagingBlock block, size_t size, Done done) override {
    Ask<absl::Status>(std::move(done),
                      [last = options_.devices.size() - 1, block = std::move(block), size](
                          RankWorker& rank, size_t r, Done answered) mutable {
                        // Release the block before the last answer.
                        rank.Apply(r == last ? std::move(block) : block, size, std::move(answered));
                      });
  }

  void SubmitFrame(const FrameRequest& request, FrameBuffer buffer, FrameDone done) override {
    Ask<absl::StatusOr<FrameResult>>(
        std::move(done), [request, buffer](RankWorker& rank, size_t, FrameDone answered) {
          rank.SubmitFrame(request, buffer, std::move(answered));
        });
  }

  void ReadVoxels(VoxelBox box, std::span<uint32_t> out, Done done) override {
    // Ranks that draw the same voxel draw the same value; a rank that does not draw it gives 0.
    const auto others =
        std::make_shared<std::vector<std::vector<uint32_t>>>(options_.devices.size());
    const auto joined = [others, out, done = std::move(done)](const absl::Status& status) {
      for (const std::vector<uint32_t>& other : *others) {
        for (size_t i = 0; status.ok() && i < other.size(); ++i) out[i] |= other[i];
      }
      done(status);
    };
    Ask<absl::Status>(joined, [others, box, out](RankWorker& rank, size_t r, Done answered) {
      std::span<uint32_t> into = out;
      if (r > 0) into = (*others)[r] = std::vector<uint32_t>(out.size());
      rank.ReadVoxels(box, into, std::move(answered));
    });
  }

 private:
  // --------------------------------------------------------------------------------- beginning

  std::string NameOf(int rank) const {
    return options_.kind == EngineKind::kCuda
               ? absl::StrCat("GPU ", options_.devices[static_cast<size_t>(rank)])
               : absl::StrCat("rank ", rank);
  }
  // Returns the same status with the rank in its message, and its payloads.
  absl::Status Named(int rank, const absl::Status& status) const {
    absl::Status named(status.code(), absl::StrCat(NameOf(rank), ": ", status.message()));
    status.ForEachPayload([&](absl::string_view type, const absl::Cord& payload) {
      named.SetPayload(type, payload);
    });
    return named;
  }

  // Called once for each rank, and once by Open itself (−1) when all have been created.
  void OnOpened(int rank, const absl::Status& status) {
    absl::Status failed;
    {
      sync::MutexLock lock(state_mutex_);
      if (!status.ok() && failed_.ok()) failed_ = Named(rank, status);
      if (++opened_ <= options_.devices.size()) return;
      failed = failed_;
    }
    if (!failed.ok()) return Settle(failed);
    std::vector<std::string> devices;
    for (size_t r = 0; r < ranks_.size(); ++r) {
      devices.push_back(absl::StrCat(NameOf(static_cast<int>(r)), ": ", ranks_[r]->info().device));
    }
    info_.device = absl::StrJoin(devices, "; ");
    if (options_.kind != EngineKind::kCuda) return Settle(absl::OkStatus());
    if (options_.nccl == "off") return SettleUnlinked("NCCL is off");
    ranks_[0]->Invite(options_.nccl, [this](const absl::StatusOr<RankLink::Invitation>& invited) {
      OnInvited(invited);
    });
  }

  void OnInvited(const absl::StatusOr<RankLink::Invitation>& invited) {
    if (absl::IsDataLoss(invited.status()) || absl::IsCancelled(invited.status())) {
      return Settle(Named(0, invited.status()));
    }
    if (!invited.ok()) return SettleUnlinked(invited.status().message());
    const int count = static_cast<int>(ranks_.size());
    for (int r = 0; r < count; ++r) {
      ranks_[static_cast<size_t>(r)]->Join(
          options_.nccl, *invited, r, count, [this, r](const absl::Status& status) {
            {
              sync::MutexLock lock(state_mutex_);
              if (!status.ok() && failed_.ok()) failed_ = Named(r, status);
              if (status.ok() && ++joined_ < options_.devices.size()) return;
            }
            OnJoined();
          });
    }
  }

  // Called when all ranks have joined, or when one cannot: the others would wait for it.
  void OnJoined() {
    absl::Status failed;
    {
      sync::MutexLock lock(state_mutex_);
      if (setup_.has_value()) return;
      failed = failed_;
    }
    if (!failed.ok()) {
      return Settle(absl::Status(
          failed.code(),
          absl::StrCat(failed.message(),
                       "; with engine.nccl = \"off\" each GPU copies for itself, without NCCL")));
    }
    absl::StrAppend(&info_.reason, "; deltas go to ", NameOf(0),
                    " and from there to the others by NCCL");
    Settle(absl::OkStatus());
  }

  void SettleUnlinked(absl::string_view why) {
    absl::StrAppend(&info_.reason, "; deltas go to each GPU by itself: ", why);
    Settle(absl::OkStatus());
  }

  // From now on calls are sent, those that have waited first.
  void Settle(const absl::Status& status) {
    if (!status.ok()) GiveUp(absl::DataLossError(status.message()));
    sync::MutexLock order(order_mutex_);
    {
      sync::MutexLock lock(state_mutex_);
      if (setup_.has_value()) return;
      setup_ = status.ok() ? status : absl::FailedPreconditionError(status.message());
      settled_.NotifyAll();
    }
    for (const std::function<void()>& send : waiting_) send();
    waiting_.clear();
    sending_ = true;
  }

  // ------------------------------------------------------------------------------------- calls

  template <typename Result>
  struct Joint {
    explicit Joint(size_t count) : results(count), left(count) {}
    sync::Mutex mutex;
    std::vector<std::optional<Result>> results VOXELD_GUARDED_BY(mutex);
    size_t left VOXELD_GUARDED_BY(mutex);
  };

  // Calls `each(rank, its number, answered)` for every rank, in the same order of calls on all of
  // them, and `done` with the joined answers: on the thread of the rank that answers last, or in
  // this one if calls are inline.
  template <typename Result, typename Each>
  void Ask(std::function<void(Result)> done, Each each) {
    if (!options_.inline_execution) return Send<Result>(std::move(done), std::move(each));
    done(Await<Result>([&](std::function<void(Result)> answer) {
      Send<Result>(std::move(answer), std::move(each));
    }));
  }

  template <typename Result, typename Each>
  void Send(std::function<void(Result)> done, Each each) {
    const auto joint = std::make_shared<Joint<Result>>(options_.devices.size());
    auto send = [this, joint, done = std::move(done), each = std::move(each)]() mutable {
      for (size_t r = 0; r < ranks_.size(); ++r) {
        each(*ranks_[r], r, std::function<void(Result)>([this, joint, done, r](Result result) {
          std::vector<Result> all;
          {
            sync::MutexLock lock(joint->mutex);
            joint->results[r] = std::move(result);
            if (--joint->left > 0) return;
            for (std::optional<Result>& one : joint->results) all.push_back(*std::move(one));
          }
          Result joined = Join(all);
          all.clear();  // `done` gets the only copy of an error
          done(std::move(joined));
        }));
      }
    };
    sync::MutexLock order(order_mutex_);
    if (sending_) return send();
    waiting_.push_back(std::move(send));
  }

  template <typename Result>
  absl::Status Judge(const std::vector<Result>& all) {
    size_t failed = 0;
    int odd = -1;
    for (size_t r = 0; r < all.size(); ++r) {
      const absl::Status& status = StatusOf(all[r]);
      if (absl::IsCancelled(status)) return status;
      if (absl::IsDataLoss(status)) return Lost(Named(static_cast<int>(r), status));
      if (status.ok()) continue;
      ++failed;
      if (odd < 0) odd = static_cast<int>(r);
    }
    if (failed == 0) return absl::OkStatus();
    const absl::Status& first = StatusOf(all[static_cast<size_t>(odd)]);
    const bool same = std::all_of(all.begin(), all.end(), [&](const Result& result) {
      return StatusOf(result).code() == first.code();
    });
    if (same) return first;
    absl::Status apart = absl::DataLossError(absl::StrCat(
        "the ranks of the display do not agree any more: ", Named(odd, first).message()));
    const bool full = std::all_of(all.begin(), all.end(), [](const Result& result) {
      return StatusOf(result).ok() || absl::IsResourceExhausted(StatusOf(result));
    });
    if (full) apart.SetPayload(kOutOfMemoryPayload, absl::Cord());
    const absl::Status lost = Lost(apart);
    GiveUp(lost);
    return lost;
  }

  absl::Status Join(const std::vector<absl::Status>& all) { return Judge(all); }

  absl::StatusOr<FrameResult> Join(const std::vector<absl::StatusOr<FrameResult>>& all) {
    if (absl::Status status = Judge(all); !status.ok()) return status;
    FrameResult sum = **all.begin();
    for (size_t r = 1; r < all.size(); ++r) {
      const FrameResult& one = *all[r];
      sum.changed |= one.changed;
      sum.lit_voxels += one.lit_voxels;
      sum.tiles_drawn += one.tiles_drawn;
      sum.pictures_drawn += one.pictures_drawn;
      // Every rank has the whole scene.
      sum.singular_drawables = std::max(sum.singular_drawables, one.singular_drawables);
      // Use the times of the slowest rank, so that they all belong to the same frame.
      if (TimeOf(one) > TimeOf(sum)) {
        sum.assemble_ns = one.assemble_ns;
        sum.slice_ns = one.slice_ns;
        sum.copy_ns = one.copy_ns;
      }
      sum.packed_as_drawn = sum.packed_as_drawn && one.packed_as_drawn;
      sum.memory_bytes += one.memory_bytes;
    }
    return sum;
  }

  // -------------------------------------------------------------------------------------- loss

  // Returns why this engine was lost: the first reason that was reported.
  absl::Status Lost(const absl::Status& why) {
    sync::MutexLock lock(state_mutex_);
    if (lost_.ok()) lost_ = why;
    return lost_;
  }

  void GiveUp(const absl::Status& why) {
    const absl::Status lost = Lost(why);
    {
      sync::MutexLock lock(state_mutex_);
      if (ranks_.empty()) return;  // Open does it, when all have been created
    }
    for (const std::unique_ptr<RankWorker>& rank : ranks_) rank->GiveUp(lost);
  }

  // Called on the thread of that rank, once for each rank: ends the other ranks, so that none waits
  // for it.
  void OnLost(int rank, const absl::Status& status) {
    const absl::Status why = Lost(Named(rank, status));
    bool last = false, told = false;
    {
      sync::MutexLock lock(state_mutex_);
      last = ++gone_ == options_.devices.size();
      // A caller that waits for the start gets the error as its answer.
      told = !options_.wait_until_ready || (setup_.has_value() && setup_->ok());
    }
    GiveUp(why);
    if (last && told && options_.lost) options_.lost(why);
  }

  const EngineOptions options_;
  EngineInfo info_;
  const std::shared_ptr<WorkerStaging> staging_;

  // Locked before state_mutex_: all ranks get their calls in one order.
  sync::Mutex order_mutex_;
  bool sending_ VOXELD_GUARDED_BY(order_mutex_) = false;
  std::deque<std::function<void()>> waiting_ VOXELD_GUARDED_BY(order_mutex_);

  sync::Mutex state_mutex_;
  sync::CondVar settled_;
  std::optional<absl::Status> setup_ VOXELD_GUARDED_BY(state_mutex_);  // the result of the start
  absl::Status failed_ VOXELD_GUARDED_BY(state_mutex_);                // its first error
  absl::Status lost_ VOXELD_GUARDED_BY(state_mutex_);
  size_t opened_ VOXELD_GUARDED_BY(state_mutex_) = 0;
  size_t joined_ VOXELD_GUARDED_BY(state_mutex_) = 0;
  size_t gone_ VOXELD_GUARDED_BY(state_mutex_) = 0;
  // Set once, before anyone else reads it. Last, because the ranks' threads use the other members.
  std::vector<std::unique_ptr<RankWorker>> ranks_;
};

absl::Status CheckDevices(const EngineOptions& options) {
  std::vector<int> sorted = options.devices;
  std::sort(sorted.begin(), sorted.end());
  const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
  if (options.kind == EngineKind::kCuda && twice != sorted.end()) {
    return absl::InvalidArgumentError(
        absl::StrCat("GPU ", *twice, " is there twice; the ranks of a display need a GPU each"));
  }
  constexpr size_t kLongestPath = 2048;  // it must fit in a message
  if (options.nccl.size() > kLongestPath) {
    return absl::InvalidArgumentError(absl::StrCat("the path of NCCL's library has ",
                                                   options.nccl.size(), " bytes; give one of ",
                                                   kLongestPath, " at most"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::unique_ptr<Engine>> CreateRankedEngine(const EngineOptions& options,
                                                           std::string reason) {
  if (absl::Status status = CheckDevices(options); !status.ok()) return status;
  auto engine = std::make_unique<RankedEngine>(options, std::move(reason));
  if (absl::Status status = engine->Open(); !status.ok()) return status;
  return engine;
}

bool IsOutOfMemory(const absl::Status& status) {
  return status.GetPayload(kOutOfMemoryPayload).has_value();
}

}  // namespace voxeld::gpu
