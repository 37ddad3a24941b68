// A link that records what is sent.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "display/drivers/network/link.h"

namespace voxeld::display::network {

// The state of the link that a test reads and sets. Outlives the link.
struct FakeWire {
  std::vector<std::vector<std::byte>> packets;
  size_t room = SIZE_MAX;  // bytes that it still accepts
  absl::Status broken;     // the error of every call from now on
  absl::Status refuses;    // the error on opening
  int opened = 0, closed = 0;
  std::function<void()> wake;
};

class FakeLink final : public Link {
 public:
  explicit FakeLink(FakeWire& wire) : wire_(wire) {}

  absl::Status Open() override {
    if (!wire_.refuses.ok()) return wire_.refuses;
    ++wire_.opened;
    open_ = true;
    return absl::OkStatus();
  }
  void Close() override {
    if (std::exchange(open_, false)) ++wire_.closed;
  }
  absl::StatusOr<State> Poll() override {
    if (!wire_.broken.ok()) return wire_.broken;
    return open_ ? State::kOpen : State::kClosed;
  }
  absl::StatusOr<size_t> Send(std::span<const std::byte> bytes) override {
    if (!wire_.broken.ok()) return wire_.broken;
    if (wire_.room < bytes.size()) return 0;
    wire_.room -= bytes.size();
    wire_.packets.emplace_back(bytes.begin(), bytes.end());
    return bytes.size();
  }
  void SetWake(std::function<void()> wake) override { wire_.wake = std::move(wake); }

 private:
  FakeWire& wire_;
  bool open_ = false;
};

}  // namespace voxeld::display::network
