// The device's side of voxlink 1.0 (docs/protocols/voxlink.md) for a microcontroller: requests, packets, events, credit, and
// which volume is lit. C99; no allocation, no operating system, no recursion; 2.5 KiB of state beside what voxlink_memory names.
//
// What is left to the firmware: the USB stack with the descriptors of §3, a clock, the start of each sweep, and putting the
// pictures of voxlink_light to the lamps.
//
//   start     voxlink_init
//   the loop  while the bulk endpoint has bytes: voxlink_bulk; voxlink_tick
//             while the interrupt endpoint is free and voxlink_event gives something: send it
//             a sweep begins: voxlink_sweep, then show voxlink_light
//   USB       a vendor request: all bytes that came before it to voxlink_bulk, then voxlink_request;
//             a bus reset: voxlink_reset; SET_CONFIGURATION: voxlink_stop; halts are the USB stack's
//
// One thread at a time. `now_ns` is a clock that never goes back, in nanoseconds from any moment.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define VOXLINK_EVENTS 48  // that wait to be read; 16 of them may be one list of what is missing

// All of it stays the firmware's, and must outlive the device.
struct voxlink_memory {
  const uint8_t*
      capabilities;     // the block of §4.1 and §4.2 as it goes out; it says all of the below
  uint8_t* volumes;     // three volumes, one behind the other
  size_t volume_bytes;  // of one, in the largest mode; SET_MODE stalls beyond
  uint32_t* filled;     // for each picture of the largest mode
  uint32_t most_pictures;
  uint8_t* payload;  // max_payload bytes of the capabilities
};

struct voxlink_waiting_event {
  uint8_t type, flags, length;
  uint8_t body[40];
};

struct voxlink_device {
  struct voxlink_memory memory;

  // What the firmware may read at any time, and obeys.
  uint16_t brightness;      // 65535: full
  uint32_t power_limit_mw;  // 0: the device's own
  uint8_t format, sub_frames, bits;
  uint32_t rate_mhz;  // sweeps in 1,000 s
  // What it sets, if it knows: 0.1 °C, INT16_MIN: not known; milliwatts, 0: not known.
  int16_t temperature;
  uint32_t power_mw;

  // The rest is voxlink_device.c's.
  uint32_t picture_bytes, pictures;
  bool running, blanked, watchdog_dark;
  uint64_t heard_ns, health_ns;
  uint64_t received, announced;
  uint32_t next_packet, next_event;
  uint8_t header[40];
  uint32_t header_have, payload_have, skipped;
  uint64_t last_begun, filling, refused, complained;
  uint32_t refused_reason;
  uint64_t base, waiting, shown;  // volumes; 0: none
  uint8_t filling_at, waiting_at, shown_at;
  bool waiting_show;
  uint64_t waiting_sweep, shown_sweep, shown_ns, sweep, sweep_ns;
  uint32_t underruns;
  bool sweep_due, health_due;
  struct voxlink_waiting_event events[VOXLINK_EVENTS];
  uint32_t events_first, events_count;
  uint8_t answer[80];
};

// False: the memory is too small for the lowest format with one sub-frame.
bool voxlink_init(struct voxlink_device* device, const struct voxlink_memory* memory);
void voxlink_reset(struct voxlink_device* device);
void voxlink_stop(struct voxlink_device* device);

// A vendor request to the interface (bmRequestType 0x41 or 0xC1). `data` are the `length` bytes of an OUT request. The number
// of bytes at *answer, to be cut to wLength, which are good until the next call; 0 of an OUT request; -1: stall.
int32_t voxlink_request(struct voxlink_device* device, uint64_t now_ns, uint8_t type,
                        uint8_t request, uint16_t value, uint16_t index, const uint8_t* data,
                        uint16_t length, const uint8_t** answer);

// Bytes of endpoint 0x01, however many, cut anywhere. They are consumed when it returns.
void voxlink_bulk(struct voxlink_device* device, uint64_t now_ns, const uint8_t* bytes,
                  size_t count);

// The next event for endpoint 0x82: its length, 0 if there is none now. What it gives counts as sent.
size_t voxlink_event(struct voxlink_device* device, uint64_t now_ns, uint8_t out[64]);

// What time brings: the watchdog, HEALTH. Every few milliseconds.
void voxlink_tick(struct voxlink_device* device, uint64_t now_ns);

// A sweep begins: by the mark on the axle, or every 10^12 / rate_mhz ns where nothing turns, the first that long after START.
void voxlink_sweep(struct voxlink_device* device, uint64_t start_ns);

// The pictures to be lit, picture_bytes each, number slice * sub_frames + sub_frame; NULL: dark. They stay as they are until the
// next voxlink_sweep; ask again after voxlink_tick and requests, which may darken it.
const uint8_t* voxlink_light(const struct voxlink_device* device);

#ifdef __cplusplus
}
#endif
