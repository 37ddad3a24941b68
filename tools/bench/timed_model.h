// A device model whose CPU time is measured separately from that of the thread which runs it.
#pragma once

#include <pthread.h>

#include <atomic>
#include <cstdint>
#include <ctime>
#include <memory>
#include <utility>

#include "display/usb/device_model.h"

namespace voxeld::bench {

class TimedModel final : public display::UsbDeviceModel {
 public:
  explicit TimedModel(std::unique_ptr<display::UsbDeviceModel> inner) : inner_(std::move(inner)) {}

  // CPU time of the model, and of its carrier's thread including the model. Thread-safe.
  int64_t inside_ns() const { return inside_; }
  int64_t thread_ns() const {
    timespec time{};
    const clockid_t clock = clock_;
    if (clock != 0) clock_gettime(clock, &time);
    return Ns(time);
  }

  // The completion callback runs the carrier's code, so its time is not the model's.
  void SetComplete(Complete complete) override {
    inner_->SetComplete([this, complete = std::move(complete)](auto... arguments) {
      const int64_t begin = Own();
      complete(arguments...);
      inside_ -= Own() - begin;
    });
  }
  void Submit(const display::Urb& urb) override {
    Time([&] { inner_->Submit(urb); });
  }
  bool Unlink(uint64_t id) override {
    bool done = false;
    Time([&] { done = inner_->Unlink(id); });
    return done;
  }
  void Tick() override {
    Time([&] { inner_->Tick(); });
  }
  sync::TimeNs NextTimeout() const override { return inner_->NextTimeout(); }
  display::UsbSpeed speed() const override { return inner_->speed(); }
  void Reset() override { inner_->Reset(); }
  void SetPlugged(bool plugged) override { inner_->SetPlugged(plugged); }
  bool plugged() const override { return inner_->plugged(); }
  uint32_t plugs() const override { return inner_->plugs(); }

 private:
  static int64_t Ns(const timespec& time) {
    return int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
  }
  static int64_t Own() {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return Ns(time);
  }
  template <typename Call>
  void Time(Call call) {
    if (clock_ == 0) {
      clockid_t clock = 0;
      pthread_getcpuclockid(pthread_self(), &clock);
      clock_ = clock;
    }
    const int64_t begin = Own();
    call();
    inside_ += Own() - begin;
  }

  const std::unique_ptr<display::UsbDeviceModel> inner_;
  std::atomic<int64_t> inside_ = 0;
  std::atomic<clockid_t> clock_ = 0;
};

}  // namespace voxeld::bench
