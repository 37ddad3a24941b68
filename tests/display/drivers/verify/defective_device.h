// A device model with a defect: the input and output of a correct one are changed on their way.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "display/usb/device_model.h"

namespace voxeld::display::conformance {

using Bytes = std::vector<std::byte>;

struct Defect {
  // For a control transfer: changes its status and the data that is read.
  std::function<void(const UsbSetup& setup, TransferStatus& status, Bytes& data)> answer;
  // Returns true if the request is answered without reaching the device.
  std::function<bool(const UsbSetup& setup)> swallow;
  // Returns false if the event is never sent.
  std::function<bool(Bytes& event)> event;
  // Changes the bytes of a transfer that the device gets.
  std::function<void(Bytes& bytes)> bulk;
  // Changes how a bulk transfer ends.
  std::function<void(size_t size, TransferStatus& status)> bulk_end;
  bool reset_does_nothing = false;
};

class DefectiveDevice final : public UsbDeviceModel {
 public:
  DefectiveDevice(std::unique_ptr<UsbDeviceModel> device, Defect defect)
      : device_(std::move(device)), defect_(std::move(defect)) {
    device_->SetComplete(
        [this](uint64_t id, TransferStatus status, uint32_t actual, std::span<const std::byte> in) {
          OnComplete(id, status, actual, in);
        });
  }

  void SetComplete(Complete complete) override { complete_ = std::move(complete); }

  void Submit(const Urb& urb) override {
    if (urb.endpoint == 0 && defect_.swallow && defect_.swallow(urb.setup)) {
      return complete_(urb.id, TransferStatus::kOk, urb.setup.length, {});
    }
    Inside& inside = inside_[urb.id];
    inside.urb = urb;
    Urb passed = urb;
    if ((urb.endpoint & 0x80) == 0 && urb.endpoint != 0) {
      inside.bytes.assign(urb.out.begin(), urb.out.end());
      if (defect_.bulk) defect_.bulk(inside.bytes);
      passed.out = inside.bytes;
    }
    device_->Submit(passed);
    SubmitAgain();
  }

  bool Unlink(uint64_t id) override {
    std::erase_if(again_, [id](const Urb& urb) { return urb.id == id; });
    inside_.erase(id);
    return device_->Unlink(id);
  }
  void Tick() override {
    device_->Tick();
    SubmitAgain();
  }
  sync::TimeNs NextTimeout() const override { return device_->NextTimeout(); }
  UsbSpeed speed() const override { return device_->speed(); }
  void Reset() override {
    if (!defect_.reset_does_nothing) device_->Reset();
  }
  void SetPlugged(bool plugged) override { device_->SetPlugged(plugged); }
  bool plugged() const override { return device_->plugged(); }
  uint32_t plugs() const override { return device_->plugs(); }

 private:
  struct Inside {
    Urb urb;
    Bytes bytes;
  };

  void OnComplete(uint64_t id, TransferStatus status, uint32_t actual,
                  std::span<const std::byte> in) {
    const auto it = inside_.find(id);
    if (it == inside_.end()) return;
    const Inside inside = std::move(it->second);
    inside_.erase(it);
    Bytes data(in.begin(), in.end());
    const bool whole = status == TransferStatus::kOk || status == TransferStatus::kShort;
    if (inside.urb.endpoint == 0) {
      if (defect_.answer) defect_.answer(inside.urb.setup, status, data);
      const bool reads = (inside.urb.setup.request_type & 0x80) != 0;
      if (reads && data.size() > inside.urb.length) data.resize(inside.urb.length);
      if (reads) actual = static_cast<uint32_t>(data.size());
    } else if ((inside.urb.endpoint & 0x80) != 0) {
      if (whole && defect_.event && !defect_.event(data)) {
        again_.push_back(inside.urb);
        return;
      }
      if (whole) actual = static_cast<uint32_t>(data.size());
    } else {
      if (whole) actual = static_cast<uint32_t>(inside.urb.out.size());
      if (defect_.bulk_end) defect_.bulk_end(inside.urb.out.size(), status);
    }
    complete_(id, status, actual, data);
  }

  // Reads whose event was held back continue to wait.
  void SubmitAgain() {
    while (!again_.empty()) {
      const std::vector<Urb> urbs = std::exchange(again_, {});
      for (const Urb& urb : urbs) {
        inside_[urb.id].urb = urb;
        device_->Submit(urb);
      }
    }
  }

  const std::unique_ptr<UsbDeviceModel> device_;
  Defect defect_;
  Complete complete_;
  std::map<uint64_t, Inside> inside_;
  std::vector<Urb> again_;
};

}  // namespace voxeld::display::conformance
