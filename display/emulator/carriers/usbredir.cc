#include "display/emulator/carriers/usbredir.h"

#include <usbredirparser.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "display/emulator/carriers/limits.h"
#include "display/emulator/carriers/model_facts.h"

namespace voxeld::display::emulator {
namespace {

constexpr size_t kBytesPerTurn = 4u << 20;

int Status(TransferStatus status) {
  switch (status) {
    case TransferStatus::kOk:
    case TransferStatus::kShort:
      return usb_redir_success;
    case TransferStatus::kStall:
      return usb_redir_stall;
    case TransferStatus::kOverflow:
      return usb_redir_babble;
    case TransferStatus::kCancelled:
      return usb_redir_cancelled;
    case TransferStatus::kTimedOut:
      return usb_redir_timeout;
    case TransferStatus::kError:
    case TransferStatus::kDisconnected:
      break;
  }
  return usb_redir_ioerror;
}

int Speed(UsbSpeed speed) {
  return speed == UsbSpeed::kFull   ? usb_redir_speed_full
         : speed == UsbSpeed::kHigh ? usb_redir_speed_high
                                    : usb_redir_speed_super;
}

// Returns the index of an endpoint in ep_info's tables.
size_t Place(uint8_t address) { return (address & 0x0Fu) | ((address & 0x80u) >> 3); }

}  // namespace

struct UsbredirSession::Callbacks {
  static UsbredirSession& Of(void* session) { return *static_cast<UsbredirSession*>(session); }

  static void Log(void*, int, const char*) {}
  static int Read(void* session, uint8_t* data, int count) {
    UsbredirSession& self = Of(session);
    ByteStream& stream = self.stream_;
    const size_t most = std::min(static_cast<size_t>(count), self.budget_);
    if (most == 0) return 0;
    const size_t got = stream.Receive({reinterpret_cast<std::byte*>(data), most});
    self.budget_ -= got;
    return got == 0 && !stream.open() ? -1 : static_cast<int>(got);
  }
  static int Write(void* session, uint8_t* data, int count) {
    ByteStream& stream = Of(session).stream_;
    stream.Send({reinterpret_cast<const std::byte*>(data), static_cast<size_t>(count)});
    return stream.open() ? count : -1;
  }
  static void Hello(void* session, usb_redir_hello_header*) {
    UsbredirSession& self = Of(session);
    self.greeted_ = true;
    if (self.model_.plugged()) self.Connect();
  }
  static void Reset(void* session) {
    Of(session).model_.Reset();
    Of(session).ReadHaltedAgain();
  }

  static std::vector<std::byte> TakeData(UsbredirSession& self, uint8_t* data, int size) {
    std::vector<std::byte> bytes;
    if (data == nullptr) return bytes;
    const auto* const first = reinterpret_cast<const std::byte*>(data);
    bytes.assign(first, first + size);
    usbredirparser_free_packet_data(self.parser_.get(), data);
    return bytes;
  }
  static void Control(void* session, uint64_t id, usb_redir_control_packet_header* header,
                      uint8_t* data, int size) {
    UsbredirSession& self = Of(session);
    Submitted submitted{.kind = Submitted::Kind::kControl, .id = id};
    submitted.setup = {.request_type = header->requesttype,
                       .request = header->request,
                       .value = header->value,
                       .index = header->index,
                       .length = header->length};
    submitted.out = TakeData(self, data, size);
    self.Submit(std::move(submitted), header->length);
  }
  static void Bulk(void* session, uint64_t id, usb_redir_bulk_packet_header* header, uint8_t* data,
                   int size) {
    UsbredirSession& self = Of(session);
    Submitted submitted{
        .kind = Submitted::Kind::kBulk, .endpoint = header->endpoint, .setup = {}, .id = id};
    submitted.out = TakeData(self, data, size);
    self.Submit(std::move(submitted), header->length | static_cast<uint32_t>(header->length_high)
                                                           << 16);
  }
  static void Interrupt(void* session, uint64_t id, usb_redir_interrupt_packet_header* header,
                        uint8_t* data, int size) {
    UsbredirSession& self = Of(session);
    Submitted submitted{.kind = Submitted::Kind::kInterruptOut,
                        .endpoint = header->endpoint,
                        .setup = {},
                        .id = id};
    submitted.out = TakeData(self, data, size);
    self.Submit(std::move(submitted), 0);
  }
  static void Cancel(void* session, uint64_t id) {
    UsbredirSession& self = Of(session);
    const auto it =
        std::find_if(self.submitted_.begin(), self.submitted_.end(), [id](const auto& item) {
          return item.second.id == id && item.second.kind != Submitted::Kind::kInterruptIn &&
                 item.second.kind != Submitted::Kind::kInternal;
        });
    if (it == self.submitted_.end()) return;
    const uint64_t ours = it->first;
    if (self.model_.Unlink(ours)) self.OnComplete(ours, TransferStatus::kCancelled, 0, {});
  }
  static void SetConfiguration(void* session, uint64_t id,
                               usb_redir_set_configuration_header* header) {
    UsbredirSession& self = Of(session);
    self.Request({.request_type = 0, .request = 9, .value = header->configuration});
    usb_redir_configuration_status_header status{};
    status.configuration = header->configuration;
    usbredirparser_send_configuration_status(self.parser_.get(), id, &status);
  }
  static void GetConfiguration(void* session, uint64_t id) {
    usb_redir_configuration_status_header status{};
    status.configuration = 1;
    usbredirparser_send_configuration_status(Of(session).parser_.get(), id, &status);
  }
  static void SetAlternate(void* session, uint64_t id, usb_redir_set_alt_setting_header* header) {
    UsbredirSession& self = Of(session);
    self.Request(
        {.request_type = 1, .request = 11, .value = header->alt, .index = header->interface});
    usb_redir_alt_setting_status_header status{};
    status.interface = header->interface;
    status.alt = header->alt;
    usbredirparser_send_alt_setting_status(self.parser_.get(), id, &status);
  }
  static void GetAlternate(void* session, uint64_t id, usb_redir_get_alt_setting_header* header) {
    usb_redir_alt_setting_status_header status{};
    status.interface = header->interface;
    usbredirparser_send_alt_setting_status(Of(session).parser_.get(), id, &status);
  }
  static void StartInterrupts(void* session, uint64_t id,
                              usb_redir_start_interrupt_receiving_header* header) {
    UsbredirSession& self = Of(session);
    usb_redir_interrupt_receiving_status_header status{};
    status.endpoint = header->endpoint;
    usbredirparser_send_interrupt_receiving_status(self.parser_.get(), id, &status);
    const bool idle = self.reading_.insert(header->endpoint).second;
    if (self.halted_.erase(header->endpoint) > 0 || idle) {
      self.to_read_.push_back(header->endpoint);
    }
  }
  static void StopInterrupts(void* session, uint64_t id,
                             usb_redir_stop_interrupt_receiving_header* header) {
    UsbredirSession& self = Of(session);
    self.reading_.erase(header->endpoint);
    self.halted_.erase(header->endpoint);
    std::erase(self.to_read_, header->endpoint);
    std::erase_if(self.submitted_, [&](const auto& item) {
      const Submitted& read = item.second;
      if (read.kind != Submitted::Kind::kInterruptIn || read.endpoint != header->endpoint ||
          !self.model_.Unlink(item.first)) {
        return false;
      }
      self.pending_bytes_ -= read.length;
      return true;
    });
    usb_redir_interrupt_receiving_status_header status{};
    status.endpoint = header->endpoint;
    usbredirparser_send_interrupt_receiving_status(self.parser_.get(), id, &status);
  }
  // Isochronous streams; no device model has such endpoints.
  static void StartStream(void* session, uint64_t id, usb_redir_start_iso_stream_header* header) {
    RefuseStream(session, id, header->endpoint);
  }
  static void StopStream(void* session, uint64_t id, usb_redir_stop_iso_stream_header* header) {
    RefuseStream(session, id, header->endpoint);
  }
  static void RefuseStream(void* session, uint64_t id, uint8_t endpoint) {
    usb_redir_iso_stream_status_header status{};
    status.status = usb_redir_inval;
    status.endpoint = endpoint;
    usbredirparser_send_iso_stream_status(Of(session).parser_.get(), id, &status);
  }
  static void StreamPacket(void* session, uint64_t, usb_redir_iso_packet_header*, uint8_t* data,
                           int size) {
    TakeData(Of(session), data, size);
  }
  static void DisconnectAck(void*) {}
  static void FilterReject(void*) {}
  static void Filter(void*, usbredirfilter_rule* rules, int) { std::free(rules); }
};

UsbredirSession::UsbredirSession(int fd, UsbDeviceModel& model)
    : stream_(fd), model_(model), parser_(usbredirparser_create(), &usbredirparser_destroy) {
  usbredirparser& parser = *parser_;
  parser.priv = this;
  parser.log_func = &Callbacks::Log;
  parser.read_func = &Callbacks::Read;
  parser.write_func = &Callbacks::Write;
  parser.hello_func = &Callbacks::Hello;
  parser.reset_func = &Callbacks::Reset;
  parser.control_packet_func = &Callbacks::Control;
  parser.bulk_packet_func = &Callbacks::Bulk;
  parser.interrupt_packet_func = &Callbacks::Interrupt;
  parser.cancel_data_packet_func = &Callbacks::Cancel;
  parser.set_configuration_func = &Callbacks::SetConfiguration;
  parser.get_configuration_func = &Callbacks::GetConfiguration;
  parser.set_alt_setting_func = &Callbacks::SetAlternate;
  parser.get_alt_setting_func = &Callbacks::GetAlternate;
  parser.start_interrupt_receiving_func = &Callbacks::StartInterrupts;
  parser.stop_interrupt_receiving_func = &Callbacks::StopInterrupts;
  parser.start_iso_stream_func = &Callbacks::StartStream;
  parser.stop_iso_stream_func = &Callbacks::StopStream;
  parser.iso_packet_func = &Callbacks::StreamPacket;
  parser.device_disconnect_ack_func = &Callbacks::DisconnectAck;
  parser.filter_reject_func = &Callbacks::FilterReject;
  parser.filter_filter_func = &Callbacks::Filter;
  uint32_t capabilities[USB_REDIR_CAPS_SIZE] = {};
  for (const int capability :
       {usb_redir_cap_connect_device_version, usb_redir_cap_ep_info_max_packet_size,
        usb_redir_cap_64bits_ids, usb_redir_cap_32bits_bulk_length,
        usb_redir_cap_device_disconnect_ack}) {
    usbredirparser_caps_set_cap(capabilities, capability);
  }
  usbredirparser_init(&parser, "voxeld-emulator", capabilities, USB_REDIR_CAPS_SIZE,
                      usbredirparser_fl_usb_host);
  usbredirparser_do_write(&parser);
}

UsbredirSession::~UsbredirSession() {
  for (const auto& [id, submitted] : submitted_) model_.Unlink(id);
  model_.SetComplete([](uint64_t, TransferStatus, uint32_t, std::span<const std::byte>) {});
}

void UsbredirSession::Connect() {
  connected_ = true;
  packets_.clear();
  const ModelFacts facts = ReadFacts(model_);
  model_.SetComplete([this](uint64_t id, TransferStatus status, uint32_t actual,
                            std::span<const std::byte> in) { OnComplete(id, status, actual, in); });
  usb_redir_interface_info_header interfaces{};
  constexpr size_t kMostInterfaces = std::size(decltype(interfaces.interface){});
  const size_t count = std::min(facts.interfaces.size(), kMostInterfaces);
  interfaces.interface_count = static_cast<uint32_t>(count);
  for (size_t i = 0; i < count; ++i) {
    interfaces.interface[i] = static_cast<uint8_t>(i);
    interfaces.interface_class[i] = facts.interfaces[i][0];
    interfaces.interface_subclass[i] = facts.interfaces[i][1];
    interfaces.interface_protocol[i] = facts.interfaces[i][2];
  }
  usbredirparser_send_interface_info(parser_.get(), &interfaces);
  usb_redir_ep_info_header endpoints{};
  std::fill(std::begin(endpoints.type), std::end(endpoints.type), usb_redir_type_invalid);
  for (const size_t control : {Place(0x00), Place(0x80)}) {
    endpoints.type[control] = usb_redir_type_control;
    endpoints.max_packet_size[control] = 64;
  }
  for (const ModelFacts::Endpoint& endpoint : facts.endpoints) {
    const size_t place = Place(endpoint.address);
    endpoints.type[place] = endpoint.attributes & 3;
    endpoints.interval[place] = endpoint.interval;
    endpoints.max_packet_size[place] = endpoint.packet;
    packets_[endpoint.address] = endpoint.packet;
  }
  usbredirparser_send_ep_info(parser_.get(), &endpoints);
  usb_redir_device_connect_header device{};
  device.speed = static_cast<uint8_t>(Speed(model_.speed()));
  device.vendor_id = facts.vendor_id;
  device.product_id = facts.product_id;
  device.device_version_bcd = facts.bcd_device;
  usbredirparser_send_device_connect(parser_.get(), &device);
  usbredirparser_do_write(parser_.get());
}

void UsbredirSession::SetPlugged(bool plugged) {
  // Before the hello the peer cannot be notified; Hello then checks the state.
  if (!greeted_ || plugged == connected_) return;
  if (plugged) return Connect();
  connected_ = false;
  submitted_.clear();
  pending_bytes_ = 0;
  reading_.clear();
  halted_.clear();
  to_read_.clear();
  usbredirparser_send_device_disconnect(parser_.get());
  usbredirparser_do_write(parser_.get());
}

absl::Status UsbredirSession::Receive() {
  budget_ = kBytesPerTurn;
  const int result = usbredirparser_do_read(parser_.get());
  ReadOn();
  if (usbredirparser_has_data_to_write(parser_.get()) > 0) usbredirparser_do_write(parser_.get());
  if (overrun_) {
    return absl::ResourceExhaustedError(
        absl::StrCat(submitted_.size(), " usbredir transfers wait, of ", pending_bytes_, " bytes"));
  }
  if (stream_.waiting() > kMostWaiting) {
    return absl::ResourceExhaustedError("the other side does not take its answers");
  }
  if (result != 0 && stream_.open()) {
    return absl::InvalidArgumentError("what came is not usbredir");
  }
  if (!stream_.open()) return absl::UnavailableError("the other side has gone");
  return absl::OkStatus();
}

void UsbredirSession::Submit(Submitted submitted, uint32_t length) {
  // Requests to a device that, as far as the peer knows, is absent are ignored.
  if (!connected_) return;
  if (submitted_.size() >= kMostPending || pending_bytes_ + length > kMostPendingBytes) {
    overrun_ = true;
    return;
  }
  const uint64_t id = next_++;
  submitted.length = length;
  pending_bytes_ += length;
  const Submitted& kept = submitted_[id] = std::move(submitted);
  Urb urb;
  urb.id = id;
  urb.endpoint = kept.endpoint;
  urb.setup = kept.setup;
  urb.out = kept.out;
  const bool in = kept.kind == Submitted::Kind::kControl ? (kept.setup.request_type & 0x80) != 0
                                                         : (kept.endpoint & 0x80) != 0;
  urb.length = in ? length : 0;
  model_.Submit(urb);
}

void UsbredirSession::Request(UsbSetup setup) {
  Submit({.kind = Submitted::Kind::kInternal, .endpoint = 0, .setup = setup}, 0);
}

void UsbredirSession::ReadHaltedAgain() {
  to_read_.insert(to_read_.end(), halted_.begin(), halted_.end());
  halted_.clear();
}

void UsbredirSession::ReadOn() {
  while (!to_read_.empty()) {
    for (const uint8_t endpoint : std::exchange(to_read_, {})) {
      Submit({.kind = Submitted::Kind::kInterruptIn, .endpoint = endpoint, .setup = {}, .out = {}},
             packets_[endpoint]);
    }
  }
}

void UsbredirSession::OnComplete(uint64_t id, TransferStatus status, uint32_t actual,
                                 std::span<const std::byte> in) {
  auto node = submitted_.extract(id);
  if (node.empty()) return;
  const Submitted& submitted = node.mapped();
  pending_bytes_ -= submitted.length;
  if (status == TransferStatus::kDisconnected) return;
  const bool clears_halt = submitted.setup.request_type == 0x02 && submitted.setup.request == 1;
  const auto halt = halted_.find(static_cast<uint8_t>(submitted.setup.index));
  if (clears_halt && status == TransferStatus::kOk && halt != halted_.end()) {
    to_read_.push_back(*halt);
    halted_.erase(halt);
  }
  auto* const data = reinterpret_cast<uint8_t*>(const_cast<std::byte*>(in.data()));
  const auto size = static_cast<int>(in.size());
  switch (submitted.kind) {
    case Submitted::Kind::kControl: {
      usb_redir_control_packet_header header{};
      header.requesttype = submitted.setup.request_type;
      header.request = submitted.setup.request;
      header.value = submitted.setup.value;
      header.index = submitted.setup.index;
      header.status = static_cast<uint8_t>(Status(status));
      header.endpoint = submitted.setup.request_type & 0x80;
      const bool reads = header.endpoint != 0;
      header.length = static_cast<uint16_t>(reads ? in.size() : actual);
      usbredirparser_send_control_packet(parser_.get(), submitted.id, &header,
                                         reads ? data : nullptr, reads ? size : 0);
      break;
    }
    case Submitted::Kind::kBulk: {
      usb_redir_bulk_packet_header header{};
      header.endpoint = submitted.endpoint;
      header.status = static_cast<uint8_t>(Status(status));
      const bool reads = (submitted.endpoint & 0x80) != 0;
      const uint32_t length = reads ? static_cast<uint32_t>(in.size()) : actual;
      header.length = static_cast<uint16_t>(length);
      header.length_high = static_cast<uint16_t>(length >> 16);
      usbredirparser_send_bulk_packet(parser_.get(), submitted.id, &header, reads ? data : nullptr,
                                      reads ? size : 0);
      break;
    }
    case Submitted::Kind::kInterruptOut:
    case Submitted::Kind::kInterruptIn:
      AnswerInterrupt(submitted, status, actual, in);
      break;
    case Submitted::Kind::kInternal:
      ReadHaltedAgain();
      return;
  }
  usbredirparser_do_write(parser_.get());
}

void UsbredirSession::AnswerInterrupt(const Submitted& submitted, TransferStatus status,
                                      uint32_t actual, std::span<const std::byte> in) {
  const bool reads = submitted.kind == Submitted::Kind::kInterruptIn;
  if (reads && reading_.contains(submitted.endpoint)) {
    // A halted endpoint stalls at once, every time it is read. QEMU would not notice a receiving
    // status until something else wakes it: so send the stall as a packet.
    if (status == TransferStatus::kStall) {
      halted_.insert(submitted.endpoint);
    } else {
      to_read_.push_back(submitted.endpoint);
    }
  }
  if (reads && status == TransferStatus::kCancelled) return;
  usb_redir_interrupt_packet_header header{};
  header.endpoint = submitted.endpoint;
  header.status = static_cast<uint8_t>(Status(status));
  header.length = static_cast<uint16_t>(reads ? in.size() : actual);
  usbredirparser_send_interrupt_packet(
      parser_.get(), submitted.id, &header,
      in.empty() ? nullptr : reinterpret_cast<uint8_t*>(const_cast<std::byte*>(in.data())),
      static_cast<int>(in.size()));
}

}  // namespace voxeld::display::emulator
