// Shared by voxlink_device.c and voxlink_packets.c; not for use by the firmware.
#pragma once

#include "voxlink_device.h"

// Events, reasons, errors and packets: §6, §5.1.
enum { READY = 1, CREDIT, SWEEP, COMPLETE, MISSING, ABORTED, SHOWN, DROPPED };
enum { UNDERRUN = 9, HEALTH, ERROR, LIGHT, ORDERED };
enum { BY_HOST = 1, SUPERSEDED, NOT_THE_BASE, UNKNOWN, MISFIT };
enum { BAD_HEADER = 1, BAD_PAYLOAD, GAP, NOT_FILLING, NOT_ANNOUNCED, OUTSIDE, OUT_OF_ORDER };
enum { BAD_LENGTH = 8, BAD_TYPE, BAD_BEGIN, BEYOND_CREDIT };
enum { BEGIN = 1, SLICE, END, ABORT, SHOW, DROP, KEEPALIVE };
enum { HEADER_BYTES = 40, MOST_RUNS = 48, PAGE = 4096 };

// ---- little-endian numbers, and the CRC

static inline uint32_t get(const uint8_t* at, int bytes) {
  uint32_t value = 0;
  while (bytes-- > 0) value = value << 8 | at[bytes];
  return value;
}
static inline uint64_t get64(const uint8_t* at) {
  return (uint64_t)get(at + 4, 4) << 32 | get(at, 4);
}
static inline void put(uint8_t* at, uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i, value >>= 8) at[i] = (uint8_t)value;
}

// Fields of the capabilities, by their offset (§4.1).
enum { FORMATS = 6, SUB_FRAMES = 7, FEATURES = 8, BUFFER = 12, PAYLOAD = 16, SLICES = 20 };
enum { WIDTH = 24, HEIGHT = 28, MIN_RATE = 36, MAX_RATE = 40, NOMINAL_RATE = 44, WATCHDOG_MS = 54 };
static inline uint32_t says(const struct voxlink_device* d, int field) {
  return get(d->memory.capabilities + field, field == WATCHDOG_MS ? 2 : field < FEATURES ? 1 : 4);
}

static inline uint64_t credit_limit(const struct voxlink_device* d) {
  return d->received + says(d, BUFFER);
}

static inline uint8_t* volume_at(const struct voxlink_device* d, uint8_t place) {
  return d->memory.volumes + place * d->memory.volume_bytes;
}

// Queue an event; one for COMPLETE, ABORTED or DROPPED; ERROR; LIGHT.
void voxlink_queue(struct voxlink_device* d, uint8_t type, uint8_t flags, const uint8_t* body,
                   uint8_t length);
void voxlink_tell(struct voxlink_device* d, uint8_t type, uint64_t volume, uint32_t reason);
void voxlink_complain(struct voxlink_device* d, uint32_t code, uint32_t detail);
void voxlink_tell_light(struct voxlink_device* d, uint32_t cause);
