#include "tests/display/emulator/carriers/usbredir_host.h"

#include <sys/socket.h>

#include <cerrno>

namespace voxeld::display::emulator {

struct UsbredirHost::Callbacks {
  static UsbredirHost& Of(void* host) { return *static_cast<UsbredirHost*>(host); }
  static Bytes Take(void* host, uint8_t* data, int size) {
    Bytes bytes;
    if (data == nullptr) return bytes;
    const auto* const first = reinterpret_cast<const std::byte*>(data);
    bytes.assign(first, first + size);
    usbredirparser_free_packet_data(Of(host).parser(), data);
    return bytes;
  }

  static void Log(void*, int, const char*) {}
  static int Read(void* host, uint8_t* data, int count) {
    const ssize_t n = recv(Of(host).peer_.fd(), data, static_cast<size_t>(count), MSG_DONTWAIT);
    if (n < 0 && errno == EAGAIN) return 0;
    return n > 0 ? static_cast<int>(n) : -1;
  }
  static int Write(void* host, uint8_t* data, int count) {
    return static_cast<int>(Of(host).peer_.Send(
        {reinterpret_cast<const std::byte*>(data), static_cast<size_t>(count)}));
  }
  static void Connect(void* host, usb_redir_device_connect_header* header) {
    Of(host).device = *header;
    ++Of(host).connects;
  }
  static void Disconnect(void* host) {
    Of(host).device.reset();
    ++Of(host).disconnects;
  }
  static void Interfaces(void* host, usb_redir_interface_info_header* header) {
    Of(host).interfaces = *header;
  }
  static void Endpoints(void* host, usb_redir_ep_info_header* header) {
    Of(host).endpoints = *header;
  }
  static void Configuration(void* host, uint64_t, usb_redir_configuration_status_header* header) {
    Of(host).configurations.push_back(header->configuration);
  }
  static void Alternate(void* host, uint64_t, usb_redir_alt_setting_status_header* header) {
    Of(host).alternates.push_back(header->alt);
  }
  static void Receiving(void* host, uint64_t id,
                        usb_redir_interrupt_receiving_status_header* header) {
    Of(host).receiving.push_back({id, header->endpoint, header->status, 0, {}});
  }
  static void Stream(void* host, uint64_t id, usb_redir_iso_stream_status_header* header) {
    Of(host).streams.push_back({id, header->endpoint, header->status, 0, {}});
  }
  static void Control(void* host, uint64_t id, usb_redir_control_packet_header* header,
                      uint8_t* data, int size) {
    Of(host).controls.push_back(
        {id, header->endpoint, header->status, header->length, Take(host, data, size)});
  }
  static void Bulk(void* host, uint64_t id, usb_redir_bulk_packet_header* header, uint8_t* data,
                   int size) {
    Of(host).bulks.push_back({id, header->endpoint, header->status,
                              header->length | static_cast<uint32_t>(header->length_high) << 16,
                              Take(host, data, size)});
  }
  static void Interrupt(void* host, uint64_t id, usb_redir_interrupt_packet_header* header,
                        uint8_t* data, int size) {
    Of(host).interrupts.push_back(
        {id, header->endpoint, header->status, header->length, Take(host, data, size)});
  }
};

UsbredirHost::UsbredirHost(Peer& peer)
    : peer_(peer), parser_(usbredirparser_create(), &usbredirparser_destroy) {
  usbredirparser& parser = *parser_;
  parser.priv = this;
  parser.log_func = &Callbacks::Log;
  parser.read_func = &Callbacks::Read;
  parser.write_func = &Callbacks::Write;
  parser.device_connect_func = &Callbacks::Connect;
  parser.device_disconnect_func = &Callbacks::Disconnect;
  parser.interface_info_func = &Callbacks::Interfaces;
  parser.ep_info_func = &Callbacks::Endpoints;
  parser.configuration_status_func = &Callbacks::Configuration;
  parser.alt_setting_status_func = &Callbacks::Alternate;
  parser.interrupt_receiving_status_func = &Callbacks::Receiving;
  parser.iso_stream_status_func = &Callbacks::Stream;
  parser.control_packet_func = &Callbacks::Control;
  parser.bulk_packet_func = &Callbacks::Bulk;
  parser.interrupt_packet_func = &Callbacks::Interrupt;
  // The capabilities that QEMU has.
  uint32_t capabilities[USB_REDIR_CAPS_SIZE] = {};
  for (const int capability : {usb_redir_cap_connect_device_version, usb_redir_cap_filter,
                               usb_redir_cap_ep_info_max_packet_size, usb_redir_cap_64bits_ids,
                               usb_redir_cap_32bits_bulk_length, usb_redir_cap_bulk_receiving,
                               usb_redir_cap_bulk_streams}) {
    usbredirparser_caps_set_cap(capabilities, capability);
  }
  usbredirparser_init(&parser, "a test", capabilities, USB_REDIR_CAPS_SIZE, 0);
}

void UsbredirHost::Control(uint64_t id, uint8_t type, uint8_t request, uint16_t value,
                           uint16_t length, Bytes data, uint16_t index) {
  usb_redir_control_packet_header header{};
  header.endpoint = type & 0x80;
  header.requesttype = type;
  header.request = request;
  header.value = value;
  header.index = index;
  header.length = length;
  usbredirparser_send_control_packet(parser(), id, &header, reinterpret_cast<uint8_t*>(data.data()),
                                     static_cast<int>(data.size()));
  Write();
}

void UsbredirHost::BulkOut(uint64_t id, uint8_t endpoint, Bytes data) {
  usb_redir_bulk_packet_header header{};
  header.endpoint = endpoint;
  header.length = static_cast<uint16_t>(data.size());
  header.length_high = static_cast<uint16_t>(data.size() >> 16);
  usbredirparser_send_bulk_packet(parser(), id, &header, reinterpret_cast<uint8_t*>(data.data()),
                                  static_cast<int>(data.size()));
  Write();
}

void UsbredirHost::StartInterrupts(uint64_t id, uint8_t endpoint) {
  usb_redir_start_interrupt_receiving_header header{};
  header.endpoint = endpoint;
  usbredirparser_send_start_interrupt_receiving(parser(), id, &header);
  Write();
}

void UsbredirHost::StopInterrupts(uint64_t id, uint8_t endpoint) {
  usb_redir_stop_interrupt_receiving_header header{};
  header.endpoint = endpoint;
  usbredirparser_send_stop_interrupt_receiving(parser(), id, &header);
  Write();
}

}  // namespace voxeld::display::emulator
