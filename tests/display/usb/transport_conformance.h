// Tests the contract of every UsbTransport. To test one, write a Carrier and a line that
// instantiates the suite. The far end of each is an emulated voxlink device of 4x4x2 pixels at 100
// volumes a second.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "display/drivers/voxlink/protocol.h"
#include "display/emulator/fault_injector.h"
#include "display/usb/usb_transport.h"
#include "gtest/gtest.h"

namespace voxeld::display {

// A transport, its device and its time.
class Carrier {
 public:
  // The behaviour of the device that a carrier cannot reproduce.
  struct Limits {
    size_t max_bytes_in_flight = 0;   // 0: the system's
    bool errors_are_retried = false;  // a few protocol errors in a row may be hidden by retries
  };

  virtual ~Carrier() = default;
  virtual Limits limits() const = 0;
  virtual UsbTransport& transport() = 0;
  virtual void AddFault(const emulator::Fault& fault) = 0;
  virtual void SetPlugged(bool plugged) = 0;
  // Runs everything until `done`; returns false if that did not happen within a generous limit.
  virtual bool RunUntil(const std::function<bool()>& done) = 0;
};

struct CarrierCase {
  std::string name;
  std::function<std::unique_ptr<Carrier>()> make;
};
inline std::ostream& operator<<(std::ostream& out, const CarrierCase& c) { return out << c.name; }

class TransportConformance : public testing::TestWithParam<CarrierCase> {
 protected:
  void SetUp() override { carrier_ = GetParam().make(); }
  UsbTransport& usb() { return carrier_->transport(); }
  void Open() {
    const absl::Status status = usb().Open();
    ASSERT_TRUE(status.ok()) << status;
  }

  TransferId Must(absl::StatusOr<TransferId> id) {
    EXPECT_TRUE(id.ok()) << id.status();
    return id.ok() ? *id : 0;
  }
  TransferId SubmitIn(UsbSetup setup) {
    Transfer transfer;
    transfer.type = TransferType::kControl;
    transfer.setup = setup;
    transfer.length = setup.length;
    return Must(usb().Submit(std::move(transfer)));
  }
  TransferId SubmitRequest(voxlink::Request request) {
    Transfer transfer;
    transfer.type = TransferType::kControl;
    transfer.setup = {.request_type = voxlink::kRequestOut,
                      .request = static_cast<uint8_t>(request)};
    return Must(usb().Submit(std::move(transfer)));
  }
  TransferId SubmitBulk(TransferBytes data, sync::TimeNs timeout = 0) {
    Transfer transfer;
    transfer.endpoint = voxlink::kBulkOut;
    transfer.data = std::move(data);
    transfer.timeout = timeout;
    return Must(usb().Submit(std::move(transfer)));
  }
  TransferId SubmitEvent() {
    Transfer transfer;
    transfer.type = TransferType::kInterrupt;
    transfer.endpoint = voxlink::kInterruptIn;
    transfer.length = voxlink::kEventSize;
    return Must(usb().Submit(std::move(transfer)));
  }
  // Returns the completion of one transfer; those of others are kept in order.
  TransferCompletion Wait(TransferId id) {
    const TransferCompletion* found = nullptr;
    carrier_->RunUntil([&] {
      std::vector<TransferCompletion> drained;
      usb().Drain(drained);
      for (TransferCompletion& completion : drained) {
        order_.push_back(completion.id);
        done_[completion.id] = std::move(completion);
      }
      const auto it = done_.find(id);
      found = it == done_.end() ? nullptr : &it->second;
      return found != nullptr;
    });
    EXPECT_NE(found, nullptr) << "transfer " << id << " did not complete";
    return found == nullptr ? TransferCompletion{} : *found;
  }

  std::unique_ptr<Carrier> carrier_;
  std::map<TransferId, TransferCompletion> done_;
  std::vector<TransferId> order_;
};

inline constexpr UsbSetup kDeviceDescriptor{
    .request_type = 0x80, .request = 6, .value = 0x0100, .index = 0, .length = 18};

}  // namespace voxeld::display
