// The device's side of voxlink 1.0 (docs/protocols/voxlink.md) for a microcontroller: requests,
// packets, events, credit, and the choice of the volume to light. C99; no allocation, no operating
// system, no recursion; 2.5 KiB of state besides the buffers in voxlink_memory.
//
// The firmware provides the USB stack with the descriptors of §3, a clock, the start of each sweep,
// and the transfer of voxlink_light's images to the lamps.
//
//   start     voxlink_init
//   the loop  while the bulk endpoint has bytes: voxlink_bulk; voxlink_tick
//             while the interrupt endpoint is free and voxlink_event returns an event: send it
//             a sweep begins: voxlink_sweep, then show voxlink_light
//   USB       a vendor request: all bytes received before it to voxlink_bulk, then voxlink_request;
//             a bus reset: voxlink_reset; SET_CONFIGURATION: voxlink_stop; halts are the USB stack's
//
// Use one thread at a time. `now_ns` is a monotonic clock, in nanoseconds from any moment.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define VOXLINK_EVENTS 48  // queued events; 16 of them may be one list of missing images

// The firmware owns all of it, and must keep it valid while the device is in use.
struct voxlink_memory {
  const uint8_t*
      // the block of §4.1 and §4.2 as it is sent; it describes all of the following
      capabilities;
  uint8_t* volumes;     // three volumes, one after another
  size_t volume_bytes;  // of one, in the largest mode; SET_MODE stalls beyond
  uint32_t* filled;     // one for each image of the largest mode
  uint32_t most_pictures;
  uint8_t* payload;  // max_payload bytes of the capabilities
};

struct voxlink_waiting_event {
  uint8_t type, flags, length;
  uint8_t body[40];
};

struct voxlink_device {
  struct voxlink_memory memory;

  // The firmware may read these at any time, and must obey them.
  uint16_t brightness;      // 65535: full
  uint32_t power_limit_mw;  // 0: the device's own
  uint8_t format, sub_frames, bits;
  uint32_t rate_mhz;  // sweeps in 1,000 s
  // The firmware sets these, if known: 0.1 °C, INT16_MIN: unknown; milliwatts, 0: unknown.
  int16_t temperature;
  uint32_t power_mw;

  // The rest is private to voxlink_device.c.
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

// Returns false if the memory is too small for the lowest format with one sub-frame.
bool voxlink_init(struct voxlink_device* device, const struct voxlink_memory* memory);
void voxlink_reset(struct voxlink_device* device);
void voxlink_stop(struct voxlink_device* device);

// Handles a vendor request to the interface (bmRequestType 0x41 or 0xC1). `data` are the `length`
// bytes of an OUT request. Returns the number of bytes at *answer, to be cut to wLength and valid
// until the next call; 0 for an OUT request; -1: stall.
int32_t voxlink_request(struct voxlink_device* device, uint64_t now_ns, uint8_t type,
                        uint8_t request, uint16_t value, uint16_t index, const uint8_t* data,
                        uint16_t length, const uint8_t** answer);

// Takes bytes of endpoint 0x01, any number, split anywhere. They are consumed when it returns.
void voxlink_bulk(struct voxlink_device* device, uint64_t now_ns, const uint8_t* bytes,
                  size_t count);

// Writes the next event for endpoint 0x82; returns its length, or 0 if none is due. The event
// counts as sent.
size_t voxlink_event(struct voxlink_device* device, uint64_t now_ns, uint8_t out[64]);

// Handles what is due by time: the watchdog, HEALTH. Call it every few milliseconds.
void voxlink_tick(struct voxlink_device* device, uint64_t now_ns);

// Call when a sweep begins: at the mark on the axle, or every 10^12 / rate_mhz ns if nothing turns,
// the first that long after START.
void voxlink_sweep(struct voxlink_device* device, uint64_t start_ns);

// Returns the images to light, picture_bytes each, in the order slice * sub_frames + sub_frame;
// NULL: dark. They stay unchanged until the next voxlink_sweep; call it again after voxlink_tick
// and requests, which may darken the display.
const uint8_t* voxlink_light(const struct voxlink_device* device);

#ifdef __cplusplus
}
#endif
