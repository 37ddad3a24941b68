// Bytes, packets, volumes: §5.
#include <string.h>

#include "voxlink_parts.h"

static const uint32_t kMagic = 0x4B4C5856, kNotFollowing = 0xFFFFFFFF;

static uint32_t crc32c(const uint8_t* bytes, size_t count) {
  uint32_t table[16], crc = 0xFFFFFFFF;  // §5.6, four bits at a time
  for (uint32_t i = 0; i < 16; ++i) {
    table[i] = i;
    for (int bit = 0; bit < 4; ++bit)
      table[i] = table[i] >> 1 ^ (0x82F63B78 & (0 - (table[i] & 1)));
  }
  while (count-- > 0) {
    crc ^= *bytes++;
    crc = crc >> 4 ^ table[crc & 15];
    crc = crc >> 4 ^ table[crc & 15];
  }
  return ~crc;
}

// ---- volumes: §5

// Returns the number of runs of incomplete images, joining those with `gap` or fewer others in
// between; queues them as events if `told`.
static uint32_t missing_runs(struct voxlink_device* d, uint32_t gap, bool told) {
  uint8_t body[40] = {0};
  uint32_t runs = 0, in_event = 0, first = 0, end = 0;
  for (uint32_t p = 0; p <= d->pictures; ++p) {
    const bool over = p == d->pictures;
    if (!over && (d->memory.filled[p] == kNotFollowing || d->memory.filled[p] == d->picture_bytes))
      continue;
    if (end != 0 && (over || p - end > gap)) {  // a run is complete
      ++runs;
      put(body + 16 + 8 * in_event, first, 4);
      put(body + 20 + 8 * in_event, end - first, 4);
      if (++in_event == 3 || over) {
        put(body, d->filling, 8);
        put(body + 8, in_event, 4);
        if (told) voxlink_queue(d, MISSING, over ? 1 : 0, body, 40);
        memset(body, 0, sizeof body);
        in_event = 0;
      }
      end = 0;
    }
    if (over) break;
    if (end == 0) first = p;
    end = p + 1;
  }
  return runs;
}

static void begin(struct voxlink_device* d, uint64_t volume, uint32_t length) {
  const uint8_t* payload = d->memory.payload;
  const uint8_t* bitmap = payload + 16;
  const uint64_t before = d->filling;
  uint32_t reason = MISFIT, code = 0;
  if (before != 0 && before != volume) voxlink_tell(d, ABORTED, before, SUPERSEDED);
  d->filling = 0;
  const uint64_t base = length < 16 ? 0 : get64(payload);
  if (volume <= d->last_begun && volume != before) {
    code = OUT_OF_ORDER;
  } else if (length < 16) {
    code = BAD_LENGTH;
  } else if (base != 0 && base != d->base) {
    reason = NOT_THE_BASE;
  } else if (volume == 0 || get(payload + 8, 4) != d->pictures) {
    code = BAD_BEGIN;
  } else if (length != 16 + (base == 0 ? 0 : (d->pictures + 7) / 8)) {
    code = BAD_LENGTH;
  } else if (base != 0 && d->pictures % 8 != 0 && bitmap[d->pictures / 8] >> d->pictures % 8 != 0) {
    code = BAD_BEGIN;
  } else {
    reason = 0;
  }
  if (reason != 0) {
    d->refused = volume;
    d->refused_reason = reason;
    if (code != 0) voxlink_complain(d, code, length);
    voxlink_tell(d, ABORTED, volume, reason);
    return;
  }
  for (uint32_t p = 0; p < d->pictures; ++p) {
    const bool follows = base == 0 || (bitmap[p / 8] >> p % 8 & 1) != 0;
    d->memory.filled[p] = follows ? 0 : kNotFollowing;
  }
  if (base != 0) {
    memcpy(volume_at(d, d->filling_at),
           volume_at(d, base == d->waiting ? d->waiting_at : d->shown_at),
           (size_t)d->pictures * d->picture_bytes);
  }
  d->filling = d->last_begun = volume;
}

static void slice(struct voxlink_device* d, uint64_t volume, uint32_t length) {
  const uint32_t s = get(d->header + 20, 4), sub = get(d->header + 6, 2),
                 offset = get(d->header + 24, 4);
  if (volume != 0 && (volume == d->refused || volume == d->base)) return;
  if (volume == 0 || volume != d->filling) {
    if (volume != d->complained) voxlink_complain(d, NOT_FILLING, offset);
    d->complained = volume;
    return;
  }
  if (s >= says(d, SLICES) || sub >= d->sub_frames || length == 0 || offset >= d->picture_bytes ||
      length > d->picture_bytes - offset) {
    voxlink_complain(d, OUTSIDE, offset);
    return;
  }
  const uint32_t picture = s * d->sub_frames + sub;
  uint32_t* filled = &d->memory.filled[picture];
  if (*filled == kNotFollowing) {
    voxlink_complain(d, NOT_ANNOUNCED, offset);
    return;
  }
  if (offset != 0 && offset != *filled) {
    *filled = 0;
    voxlink_complain(d, OUT_OF_ORDER, offset);
    return;
  }
  memcpy(volume_at(d, d->filling_at) + (size_t)picture * d->picture_bytes + offset,
         d->memory.payload, length);
  *filled = offset + length;
}

static void end(struct voxlink_device* d, uint64_t volume) {
  if (volume != 0 && volume == d->base) {
    voxlink_tell(d, COMPLETE, volume, 0);
    return;
  }
  if (volume == 0 || volume != d->filling) {
    voxlink_tell(d, ABORTED, volume,
                 volume == d->refused && volume != 0 ? d->refused_reason : UNKNOWN);
    return;
  }
  uint32_t gap = 0, runs = missing_runs(d, 0, false);
  if (runs != 0) {
    for (; runs > MOST_RUNS; runs = missing_runs(d, gap, false)) gap = gap * 2 + 1;
    missing_runs(d, gap, true);
    return;
  }
  if (d->waiting != 0) voxlink_tell(d, DROPPED, d->waiting, SUPERSEDED);
  const uint8_t free_place = d->waiting_at;
  d->waiting_at = d->filling_at;
  d->filling_at = free_place;
  d->waiting = d->base = volume;
  d->filling = 0;
  d->waiting_show = (d->header[5] & 1) != 0;
  d->waiting_sweep = 0;
  voxlink_tell(d, COMPLETE, volume, 0);
}

// Returns whether the packet is SHOW AHEAD, and the device supports it.
static bool is_ahead(const struct voxlink_device* d) {
  return (says(d, FEATURES) & 16) != 0 && (d->header[5] & 1) != 0;
}

static void show(struct voxlink_device* d, uint64_t volume) {
  const uint64_t sweep = get64(d->memory.payload);
  const bool ahead = is_ahead(d);
  if (volume == 0 || volume != d->waiting) {
    voxlink_tell(d, DROPPED, volume, UNKNOWN);
    return;
  }
  const bool taken =
      !ahead || (sweep >= d->sweep && sweep - d->sweep >= get(d->memory.payload + 8, 4));
  if (taken) {
    d->waiting_show = true;
    d->waiting_sweep = sweep;
  }
  if (ahead) {
    uint8_t body[16];
    put(body, volume, 8);
    put(body + 8, sweep, 8);
    voxlink_queue(d, ORDERED, taken ? 1 : 0, body, 16);
  }
}

static void packet(struct voxlink_device* d) {
  const uint64_t volume = get64(d->header + 8);
  const uint32_t length = get(d->header + 28, 4);
  const uint8_t type = d->header[4];
  const uint32_t fixed = type == SHOW ? (is_ahead(d) ? 16 : 8) : 0;
  if (crc32c(d->memory.payload, length) != get(d->header + 32, 4)) {
    voxlink_complain(d, BAD_PAYLOAD, length);
  } else if (type < BEGIN || type > KEEPALIVE) {
    voxlink_complain(d, BAD_TYPE, type);
  } else if (type >= END && length != fixed) {
    voxlink_complain(d, BAD_LENGTH, length);
  } else if (type == BEGIN) {
    begin(d, volume, length);
  } else if (type == SLICE) {
    slice(d, volume, length);
  } else if (type == END) {
    end(d, volume);
  } else if (type == ABORT) {
    if (volume != 0 && volume == d->base) return;
    if (volume == d->filling) d->filling = 0;
    voxlink_tell(d, ABORTED, volume, BY_HOST);
  } else if (type == SHOW) {
    show(d, volume);
  } else if (type == DROP) {
    const bool waits = volume != 0 && volume == d->waiting;
    if (waits) d->waiting = d->base = 0;
    voxlink_tell(d, DROPPED, volume, waits ? BY_HOST : UNKNOWN);
  }
}

// ---- the stream of packets: §5.1

static void tell_skipped(struct voxlink_device* d) {
  if (d->skipped != 0) voxlink_complain(d, BAD_HEADER, d->skipped);
  d->skipped = 0;
}

static void header_found(struct voxlink_device* d, uint64_t now_ns) {
  const uint32_t sequence = get(d->header + 16, 4);
  tell_skipped(d);
  d->heard_ns = now_ns;
  if (d->watchdog_dark) {
    d->watchdog_dark = false;
    voxlink_tell_light(d, 3);
  }
  if (sequence != d->next_packet) voxlink_complain(d, GAP, sequence - d->next_packet);
  d->next_packet = sequence + 1;
}

void voxlink_bulk(struct voxlink_device* d, uint64_t now_ns, const uint8_t* bytes, size_t count) {
  if (!d->running) return;
  d->received += count;
  if (d->received > d->announced)
    voxlink_complain(d, BEYOND_CREDIT, (uint32_t)(d->received - d->announced));
  while (count > 0) {
    if (d->header_have < HEADER_BYTES) {
      d->header[d->header_have++] = *bytes++;
      --count;
      if (d->header_have < HEADER_BYTES) continue;
      if (get(d->header, 4) != kMagic || get(d->header + 28, 4) > says(d, PAYLOAD) ||
          crc32c(d->header, 36) != get(d->header + 36, 4)) {
        uint32_t skip = 1;  // skip to where the magic could begin
        while (skip < HEADER_BYTES && d->header[skip] != (kMagic & 0xFF)) ++skip;
        memmove(d->header, d->header + skip, HEADER_BYTES - skip);
        d->header_have -= skip;
        d->skipped += skip;
        continue;
      }
      d->payload_have = 0;
      header_found(d, now_ns);
    }
    const uint32_t length = get(d->header + 28, 4), need = length - d->payload_have;
    const uint32_t take = count < need ? (uint32_t)count : need;
    memcpy(d->memory.payload + d->payload_have, bytes, take);
    d->payload_have += take;
    bytes += take;
    count -= take;
    if (d->payload_have < length) break;
    packet(d);
    d->header_have = 0;
  }
  tell_skipped(d);
}
