#include "tests/display/emulator/bench.h"

#include <algorithm>
#include <utility>

namespace voxeld::display::emulator {

using voxlink::EventType;

VoxlinkDeviceConfig Bench::SmallConfig() {
  PlanarStack planar;
  planar.width_px = 3;
  planar.height_px = 2;
  planar.positions_mm = {0, 1, 2, 3};
  VoxlinkDeviceConfig config;
  config.geometry.shape = planar;
  config.volumes_per_second = 10;
  config.receive_buffer = 8192;
  config.max_payload = 1024;
  return config;
}

Bench::Bench(VoxlinkDeviceConfig config, FaultPlan plan) {
  auto device = std::make_unique<VoxlinkDevice>(std::move(config), clock_);
  device_ = device.get();
  injector_ = std::make_unique<FaultInjector>(std::move(device), std::move(plan), clock_);
  injector_->SetComplete(
      [this](uint64_t id, TransferStatus status, uint32_t actual, std::span<const std::byte> in) {
        const bool read = std::erase(reads_, id) > 0;
        if (read && (status == TransferStatus::kOk || status == TransferStatus::kShort)) {
          events_.push_back({voxlink::Load<voxlink::EventHeader>(in),
                             {in.begin() + sizeof(voxlink::EventHeader), in.end()}});
        }
        done_[id] = {status, actual, {in.begin(), in.end()}};
      });
}

void Bench::Submit(Urb urb) {
  injector_->Submit(urb);
  PostReads();
}

void Bench::PostReads() {
  while (listening_ && injector_->plugged() && reads_.size() < 4) {
    const uint64_t id = next_id_++;
    reads_.push_back(id);
    Urb urb;
    urb.id = id;
    urb.endpoint = voxlink::kInterruptIn;
    urb.length = voxlink::kEventSize;
    injector_->Submit(urb);
  }
}

std::optional<Completed> Bench::Control(const UsbSetup& setup, std::span<const std::byte> out) {
  const uint64_t id = next_id_++;
  out_[id].assign(out.begin(), out.end());
  Urb urb;
  urb.id = id;
  urb.setup = setup;
  urb.out = out_[id];
  if ((setup.request_type & 0x80) != 0) urb.length = setup.length;
  Submit(urb);
  return Result(id);
}

std::optional<Completed> Bench::In(voxlink::Request request, uint16_t value, uint16_t length) {
  return Control({.request_type = voxlink::kRequestIn,
                  .request = static_cast<uint8_t>(request),
                  .value = value,
                  .index = 0,
                  .length = length});
}

std::optional<Completed> Bench::Out(voxlink::Request request, uint16_t value,
                                    std::span<const std::byte> data) {
  return Control({.request_type = voxlink::kRequestOut,
                  .request = static_cast<uint8_t>(request),
                  .value = value,
                  .index = 0,
                  .length = static_cast<uint16_t>(data.size())},
                 data);
}

uint64_t Bench::Bulk(std::vector<std::byte> bytes) {
  const uint64_t id = next_id_++;
  out_[id] = std::move(bytes);
  Urb urb;
  urb.id = id;
  urb.endpoint = voxlink::kBulkOut;
  urb.out = out_[id];
  Submit(urb);
  return id;
}

std::optional<Completed> Bench::Result(uint64_t id) const {
  const auto it = done_.find(id);
  return it == done_.end() ? std::nullopt : std::optional(it->second);
}

void Bench::StartSession() {
  listening_ = true;
  writer_.Restart();
  Out(voxlink::Request::kStart);
  PostReads();
}

void Bench::Pass(sync::TimeNs duration) {
  const sync::TimeNs end = clock_.Now() + duration;
  while (true) {
    injector_->Tick();
    PostReads();
    const sync::TimeNs next = injector_->NextTimeout();
    if (next > end) break;
    clock_.AdvanceTo(std::max(next, clock_.Now()));
  }
  clock_.AdvanceTo(end);
  injector_->Tick();
  PostReads();
}

std::vector<SeenEvent> Bench::Events(bool all) {
  std::vector<SeenEvent> events = std::exchange(events_, {});
  if (!all) {
    std::erase_if(events, [](const SeenEvent& event) {
      return event.type() == EventType::kSweep || event.type() == EventType::kHealth ||
             event.type() == EventType::kCredit;
    });
  }
  return events;
}

std::vector<std::byte> Bench::Begin(uint64_t volume, uint64_t base, std::optional<uint8_t> bits) {
  std::vector<std::byte> out, bitmap;
  if (bits) bitmap.push_back(std::byte{*bits});
  writer_.Begin(out, volume, base, static_cast<uint32_t>(device_->layout().pictures()), bitmap);
  return out;
}

std::vector<std::byte> Bench::Slice(uint64_t volume, uint32_t slice, uint8_t value) {
  std::vector<std::byte> out;
  const std::vector<std::byte> pixels(device_->layout().bytes_per_slice(), std::byte{value});
  writer_.Slice(out, volume, slice, 0, 0, pixels);
  return out;
}

std::vector<std::byte> Bench::End(uint64_t volume, bool show) {
  std::vector<std::byte> out;
  writer_.End(out, volume, show);
  return out;
}

void Bench::SendWhole(uint64_t volume, uint8_t value, bool show) {
  Bulk(Begin(volume, 0));
  for (uint32_t slice = 0; slice < 4; ++slice) Bulk(Slice(volume, slice, value));
  Bulk(End(volume, show));
}

int Bench::Seen(size_t slice) const {
  const std::optional<DecodedVolume> seen = device_->Seen();
  if (!seen) return -1;
  return seen->Rgb(static_cast<int32_t>(slice), 1)[0];
}

}  // namespace voxeld::display::emulator
