#include "gpu/worker/worker_staging.h"

#include <utility>

#include "gpu/worker/message.h"

namespace voxeld::gpu {

void SegmentNews::AddListener(std::weak_ptr<CallChannel> channel) {
  sync::MutexLock lock(mutex_);
  channels_.push_back(std::move(channel));
}

void SegmentNews::Tell(const SegmentPool::Item& item, bool added, bool staging) {
  sync::MutexLock lock(mutex_);
  for (const std::weak_ptr<CallChannel>& listener : channels_) {
    const std::shared_ptr<CallChannel> channel = listener.lock();
    if (channel == nullptr) continue;
    if (!added) {
      channel->Tell(MakeMessage(MessageType::kDropSegment, 0, SegmentMessage{item.id}), nullptr);
      continue;
    }
    const SegmentMessage named{item.id, staging ? 1u : 0u, item.segment->bytes().size()};
    Message message = MakeMessage(MessageType::kSegment, 0, named);
    message.fd = item.segment->fd();
    channel->Tell(std::move(message), item.segment);
  }
}

SegmentPool::Told SegmentNews::Added(std::shared_ptr<SegmentNews> news, bool staging) {
  return [news = std::move(news), staging](const SegmentPool::Item& item) {
    news->Tell(item, true, staging);
  };
}

SegmentPool::Told SegmentNews::Dropped(std::shared_ptr<SegmentNews> news) {
  return
      [news = std::move(news)](const SegmentPool::Item& item) { news->Tell(item, false, false); };
}

WorkerStaging::WorkerStaging(uint64_t limit_bytes)
    : pool_(limit_bytes, ids_, SegmentNews::Added(news_, true), SegmentNews::Dropped(news_)) {}

absl::StatusOr<StagingBlock> WorkerStaging::Acquire(size_t size) {
  absl::StatusOr<SegmentPool::Lease> lease = pool_.Acquire(size);
  if (!lease.ok()) return lease.status();
  return StagingBlock(std::make_shared<LeasedMemory>(*std::move(lease), size));
}

}  // namespace voxeld::gpu
