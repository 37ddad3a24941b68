// Requests, events, sweeps: §4, §6, §8.
#include <string.h>

#include "voxlink_parts.h"

static const uint64_t kHealthPeriodNs = 1000000000;

// ---- events: §6

void voxlink_queue(struct voxlink_device* d, uint8_t type, uint8_t flags, const uint8_t* body,
                   uint8_t length) {
  if (d->events_count == VOXLINK_EVENTS) {  // drop the oldest; its number stays unused
    d->events_first = (d->events_first + 1) % VOXLINK_EVENTS;
    --d->events_count;
    ++d->next_event;
  }
  struct voxlink_waiting_event* event =
      &d->events[(d->events_first + d->events_count++) % VOXLINK_EVENTS];
  event->type = type;
  event->flags = flags;
  event->length = length;
  memcpy(event->body, body, length);
}

// Queues COMPLETE, ABORTED or DROPPED.
void voxlink_tell(struct voxlink_device* d, uint8_t type, uint64_t volume, uint32_t reason) {
  uint8_t body[16] = {0};
  put(body, volume, 8);
  put(body + 8, reason, 4);
  voxlink_queue(d, type, 0, body, type == COMPLETE ? 8 : 16);
}

void voxlink_complain(struct voxlink_device* d, uint32_t code, uint32_t detail) {
  uint8_t body[24] = {0};
  put(body, code, 4);
  if (code != BAD_HEADER && code != BEYOND_CREDIT) {
    put(body + 4, get(d->header + 16, 4), 4);
    memcpy(body + 8, d->header + 8, 8);
    put(body + 16, get(d->header + 20, 4) * d->sub_frames + get(d->header + 6, 2), 4);
  }
  put(body + 20, detail, 4);
  voxlink_queue(d, ERROR, 0, body, 24);
}

void voxlink_tell_light(struct voxlink_device* d, uint32_t cause) {
  uint8_t body[8] = {0};
  body[0] = !d->blanked && !d->watchdog_dark;
  put(body + 4, cause, 4);
  if (d->running) voxlink_queue(d, LIGHT, 0, body, 8);
}

size_t voxlink_event(struct voxlink_device* d, uint64_t now_ns, uint8_t out[64]) {
  struct voxlink_waiting_event event = {0};
  if (!d->running) return 0;
  if (d->events_count > 0) {
    event = d->events[d->events_first];
    d->events_first = (d->events_first + 1) % VOXLINK_EVENTS;
    --d->events_count;
  } else if (d->sweep_due) {  // only the newest
    d->sweep_due = false;
    event.type = SWEEP;
    event.length = 32;
    put(event.body, d->sweep, 8);
    put(event.body + 8, d->sweep_ns, 8);
    put(event.body + 16, d->shown, 8);
    put(event.body + 24, 1000000000000u / d->rate_mhz, 4);
    put(event.body + 28, d->underruns, 4);
  } else if (d->health_due) {
    d->health_due = false;
    event.type = HEALTH;
    event.length = 8;
    put(event.body, (uint16_t)d->temperature, 2);
    put(event.body + 4, d->power_mw, 4);
  } else if (credit_limit(d) - d->announced >= says(d, BUFFER) / 4) {
    event.type = CREDIT;
  } else {
    return 0;
  }
  d->announced = credit_limit(d);
  out[0] = event.type;
  out[1] = event.flags;
  put(out + 2, 24u + event.length, 2);
  put(out + 4, d->next_event++, 4);
  put(out + 8, now_ns, 8);
  put(out + 16, d->announced, 8);
  memcpy(out + 24, event.body, event.length);
  return 24u + event.length;
}

// ---- sweeps and light: §8, §11

void voxlink_sweep(struct voxlink_device* d, uint64_t start_ns) {
  uint8_t body[24] = {0};
  if (!d->running) return;
  ++d->sweep;
  d->sweep_ns = start_ns;
  d->sweep_due = true;
  if (d->waiting != 0 && d->waiting_show && d->waiting_sweep <= d->sweep) {
    const uint8_t free_place = d->shown_at;
    d->shown_at = d->waiting_at;
    d->waiting_at = free_place;
    d->shown = d->waiting;
    d->waiting = 0;
    d->shown_sweep = d->sweep;
    d->shown_ns = start_ns;
    put(body, d->shown, 8);
    put(body + 8, d->sweep, 8);
    put(body + 16, start_ns, 8);
    voxlink_queue(d, SHOWN, d->blanked || d->watchdog_dark ? 1 : 0, body, 24);
  } else if (d->shown != 0 && d->filling != 0) {
    put(body, d->sweep, 8);
    put(body + 8, ++d->underruns, 4);
    voxlink_queue(d, UNDERRUN, 0, body, 16);
  }
}

void voxlink_tick(struct voxlink_device* d, uint64_t now_ns) {
  const uint64_t watchdog_ns = (uint64_t)says(d, WATCHDOG_MS) * 1000000;
  if (!d->running) return;
  if (watchdog_ns != 0 && !d->watchdog_dark && now_ns - d->heard_ns >= watchdog_ns) {
    d->watchdog_dark = true;
    voxlink_tell_light(d, 1);
  }
  if (now_ns - d->health_ns >= kHealthPeriodNs) {
    d->health_ns = now_ns;
    d->health_due = true;
  }
}

const uint8_t* voxlink_light(const struct voxlink_device* d) {
  return d->running && d->shown != 0 && !d->blanked && !d->watchdog_dark ? volume_at(d, d->shown_at)
                                                                         : NULL;
}

// ---- requests: §4

// Returns the bytes of a slice image; 0: no such format.
static uint32_t size_of(uint8_t format, uint8_t bits, uint32_t width, uint32_t height) {
  const uint32_t planes = bits == 0 ? 1 : bits;
  if (format == 0) return 3 * width * height;
  if (format == 1) return bits == 0 || bits == 3 ? width * height : 0;
  if (format == 2) return 3 * planes * ((width + 7) / 8) * height;
  if (format == 3) return height % 2 == 0 ? planes * width * (height / 2) : 0;
  return bits <= 1 ? 3 * width * height : 0;
}

static bool set_mode(struct voxlink_device* d, const uint8_t* mode) {
  const uint8_t format = mode[0], sub_frames = mode[1], bits = mode[2];
  const uint32_t asked = get(mode + 4, 4), rate = asked == 0 ? says(d, NOMINAL_RATE) : asked;
  if (d->running || format > 4 || (says(d, FORMATS) >> format & 1) == 0 || bits > 8) return false;
  if (sub_frames < 1 || sub_frames > says(d, SUB_FRAMES)) return false;
  if (rate < says(d, MIN_RATE) || rate > says(d, MAX_RATE)) return false;
  const uint32_t bytes = size_of(format, bits, says(d, WIDTH), says(d, HEIGHT));
  const uint32_t pictures = says(d, SLICES) * sub_frames;
  if (bytes == 0 || pictures > d->memory.most_pictures) return false;
  if ((uint64_t)pictures * bytes > d->memory.volume_bytes) return false;
  d->format = format;
  d->sub_frames = sub_frames;
  d->bits = bits;
  d->rate_mhz = rate;
  d->picture_bytes = bytes;
  d->pictures = pictures;
  return true;
}

void voxlink_stop(struct voxlink_device* d) {
  d->running = d->watchdog_dark = d->waiting_show = d->sweep_due = d->health_due = false;
  d->received = d->announced = 0;
  d->next_packet = d->next_event = d->header_have = d->payload_have = d->skipped = d->underruns = 0;
  d->last_begun = d->filling = d->refused = d->complained = d->base = d->waiting = d->shown = 0;
  d->shown_sweep = d->shown_ns = d->sweep = d->sweep_ns = 0;
  d->events_first = d->events_count = 0;
}

static void start(struct voxlink_device* d, uint64_t now_ns) {
  uint8_t body[8] = {0};
  voxlink_stop(d);
  d->running = true;
  d->heard_ns = d->health_ns = now_ns;
  memcpy(body, d->memory.capabilities + 4, 2);
  put(body + 4, says(d, BUFFER), 4);
  voxlink_queue(d, READY, 0, body, 8);
}

static bool lowest_mode(struct voxlink_device* d) {
  uint8_t mode[16] = {0, 1};
  while (mode[0] < 4 && (says(d, FORMATS) >> mode[0] & 1) == 0) ++mode[0];
  return set_mode(d, mode);
}

void voxlink_reset(struct voxlink_device* d) {
  voxlink_stop(d);
  d->brightness = 65535;
  d->power_limit_mw = 0;
  d->blanked = false;
  (void)lowest_mode(d);
}

bool voxlink_init(struct voxlink_device* d, const struct voxlink_memory* memory) {
  memset(d, 0, sizeof *d);
  d->memory = *memory;
  d->temperature = INT16_MIN;
  d->waiting_at = 1;
  d->shown_at = 2;
  voxlink_reset(d);
  return d->pictures != 0;
}

static void set_blank(struct voxlink_device* d, bool blank) {
  if (blank == d->blanked) return;
  d->blanked = blank;
  voxlink_tell_light(d, blank ? 2 : 4);
}

static int32_t status(struct voxlink_device* d, uint64_t now_ns) {
  uint8_t* out = d->answer;
  if (d->running) d->announced = credit_limit(d);  // as an event would
  memset(out, 0, sizeof d->answer);
  out[0] = d->running;
  out[1] = (uint8_t)(d->blanked | d->watchdog_dark << 1);
  put(out + 4, d->next_event, 4);
  put(out + 8, now_ns, 8);
  put(out + 16, d->received, 8);
  put(out + 24, d->announced, 8);
  put(out + 32, d->filling, 8);
  put(out + 40, d->base, 8);
  put(out + 48, d->shown, 8);
  put(out + 56, d->shown_sweep, 8);
  put(out + 64, d->shown_ns, 8);
  put(out + 72, d->underruns, 4);
  put(out + 76, (uint16_t)d->temperature, 2);
  return 80;
}

int32_t voxlink_request(struct voxlink_device* d, uint64_t now_ns, uint8_t type, uint8_t request,
                        uint16_t value, uint16_t index, const uint8_t* data, uint16_t length,
                        const uint8_t** answer) {
  const uint32_t total = get(d->memory.capabilities, 4), begins = (uint32_t)value * PAGE;
  *answer = d->answer;
  if (index != 0 || (type != 0xC1 && type != 0x41)) return -1;
  if (type == 0xC1) {
    if (request == 0x01 && begins < total) {
      *answer = d->memory.capabilities + begins;
      return (int32_t)(total - begins < PAGE ? total - begins : PAGE);
    }
    if (request == 0x02 && value == 0) return status(d, now_ns);
    if (request != 0x04 || value != 0) return -1;
    memset(d->answer, 0, 16);
    d->answer[0] = d->format;
    d->answer[1] = d->sub_frames;
    d->answer[2] = d->bits;
    put(d->answer + 4, d->rate_mhz, 4);
    return 16;
  }
  if (length != (request == 0x03 ? 16 : request == 0x08 ? 4 : 0)) return -1;
  if (request != 0x07 && value > (request == 0x09 ? 1 : 0)) return -1;
  if (request == 0x03) return set_mode(d, data) ? 0 : -1;
  if (request < 0x05 || request > 0x09) return -1;
  if (request == 0x05) start(d, now_ns);
  if (request == 0x06) voxlink_stop(d);
  if (request == 0x07) d->brightness = value;
  if (request == 0x08) d->power_limit_mw = get(data, 4);
  if (request == 0x09) set_blank(d, value == 1);
  return 0;
}
