-- voxlink 1.0 for Wireshark and tshark: packets, events and requests of docs/protocols/voxlink.md,
-- by whose sections the fields below are grouped.
--
--   tshark -X lua_script:voxlink.lua -r FILE -V -Y voxlink
--
-- or copied to Wireshark's folder of personal Lua plugins. Devices of class 0xFF are looked at; what
-- does not look like voxlink is left to others. A capture that begins after the device was
-- configured does not have its class: "Decode As…", USB device, voxlink says it.
--
-- Packets are put together over as many transfers as they take, and shown where they end.

local voxlink = Proto("voxlink", "voxlink")

-- ---- words

local PACKETS = {
  [1] = "VOLUME_BEGIN", [2] = "SLICE", [3] = "VOLUME_END", [4] = "ABORT", [5] = "SHOW",
  [6] = "DROP", [7] = "KEEPALIVE",
}
local EVENTS = {
  [1] = "READY", [2] = "CREDIT", [3] = "SWEEP", [4] = "COMPLETE", [5] = "MISSING",
  [6] = "ABORTED", [7] = "SHOWN", [8] = "DROPPED", [9] = "UNDERRUN", [10] = "HEALTH",
  [11] = "ERROR", [12] = "LIGHT", [13] = "ORDERED",
}
local REQUESTS = {
  [1] = "GET_CAPABILITIES", [2] = "GET_STATUS", [3] = "SET_MODE", [4] = "GET_MODE",
  [5] = "START", [6] = "STOP", [7] = "SET_BRIGHTNESS", [8] = "SET_POWER_LIMIT",
  [9] = "SET_BLANK",
}
local FORMATS = { [0] = "RGB888", [1] = "RGB332", [2] = "bit planes", [3] = "HUB75",
  [4] = "24 planes" }
local SHAPES = { [1] = "planar stack", [2] = "rotor", [3] = "helix", [4] = "lattice" }
local REASONS = {
  [1] = "by the host", [2] = "superseded", [3] = "base not held", [4] = "volume unknown",
  [5] = "does not fit the mode",
}
local ERRORS = {
  [1] = "bad header", [2] = "bad payload CRC", [3] = "packets missing",
  [4] = "volume not being filled", [5] = "picture not announced", [6] = "picture outside the mode",
  [7] = "out of order", [8] = "payload of the wrong length", [9] = "unknown packet type",
  [10] = "BEGIN does not fit", [11] = "credit exceeded",
}
local LIGHTS = {
  [1] = "host silent", [2] = "blanked", [3] = "host back", [4] = "unblanked",
}
local SUMS = { [0] = "wrong", [1] = "right", [2] = "not checked" }

-- ---- layouts: fields that lie at fixed places

local fields, by_name = {}, {}
local function field(make, name, label, ...)
  if by_name[name] == nil then
    by_name[name] = make("voxlink." .. name, label, ...)
    fields[#fields + 1] = by_name[name]
  end
  return by_name[name]
end

local P = ProtoField
local KINDS = {  -- what makes the field, how it is shown, how many bytes it has
  u8 = { P.uint8, base.DEC, 1 }, u16 = { P.uint16, base.DEC, 2 }, u32 = { P.uint32, base.DEC, 4 },
  x8 = { P.uint8, base.HEX, 1 }, x16 = { P.uint16, base.HEX, 2 }, x32 = { P.uint32, base.HEX, 4 },
  u64 = { P.uint64, base.DEC, 8 }, i16 = { P.int16, base.DEC, 2 }, f32 = { P.float, nil, 4 }, f64 = { P.double, nil, 8 },
}

-- Of { offset, kind, name, label, words for values, bits = { { mask, name, label }… } }….
local function layout(entries)
  local made = { size = 0 }
  for _, entry in ipairs(entries) do
    local offset, name, label, words = entry[1], entry[3], entry[4], entry[5]
    local make, shown, size = table.unpack(KINDS[entry[2]])
    local one = { offset = offset, size = size, bits = {} }
    one.field = shown and field(make, name, label, shown, words) or field(make, name, label)
    for _, bit_of in ipairs(entry.bits or {}) do
      one.bits[#one.bits + 1] = field(P.bool, bit_of[2], bit_of[3], 8 * size, nil, bit_of[1])
    end
    made[#made + 1] = one
    made.size = math.max(made.size, offset + size)
  end
  return made
end

local function add(tree, how, bytes, at)
  for _, one in ipairs(how) do
    local range = bytes((at or 0) + one.offset, one.size)
    local item = tree:add_le(one.field, range)
    for _, flag in ipairs(one.bits) do item:add_le(flag, range) end
  end
end

local function first_u64(bytes) return tostring(bytes(0, 8):le_uint64()) end

-- §5.1
local PACKET = layout({
  { 0, "x32", "magic", "Magic" },
  { 4, "u8", "type", "Type", PACKETS },
  { 5, "x8", "flags", "Flags", bits = {
    { 0x01, "flags.show", "VOLUME_END: show it from the next sweep on; SHOW: only if it comes ahead" },
  } },
  { 6, "u16", "sub_frame", "Sub-frame" },
  { 8, "u64", "volume", "Volume" },
  { 16, "u32", "sequence", "Sequence" },
  { 20, "u32", "slice", "Slice" },
  { 24, "u32", "offset", "Offset in the picture" },
  { 28, "u32", "length", "Length of the payload" },
})
-- §5.2, §5.5
local BEGIN = layout({
  { 0, "u64", "begin.base", "Base" },
  { 8, "u32", "begin.pictures", "Pictures" },
})
local SHOW = layout({ { 0, "u64", "show.sweep", "From sweep" } })
local SHOW_AHEAD = layout({
  { 0, "u64", "show.sweep", "From sweep" },
  { 8, "u32", "show.ahead", "Sweeps ahead at least" },
})

-- §6
local EVENT = layout({
  { 0, "u8", "event.type", "Type", EVENTS },
  { 1, "x8", "event.flags", "Flags", bits = {
    { 0x01, "event.flags.bit0", "MISSING: the list ends here; SHOWN: the device was dark; ORDERED: taken" },
  } },
  { 2, "u16", "event.length", "Length" },
  { 4, "u32", "event.sequence", "Sequence" },
  { 8, "u64", "event.time_ns", "Device's time (ns)" },
  { 16, "u64", "event.credit_limit", "Credit limit (bytes)" },
})
local VOLUME = { 0, "u64", "event.volume", "Volume" }
local REFUSED = layout({ VOLUME, { 8, "u32", "event.reason", "Reason", REASONS } })
local BODIES = {
  [1] = layout({
    { 0, "x16", "version", "Version" },
    { 4, "u32", "receive_buffer", "Receive buffer (bytes)" },
  }),
  [3] = layout({
    { 0, "u64", "event.sweep", "Sweep" },
    { 8, "u64", "event.start_ns", "Start of the sweep (ns)" },
    { 16, "u64", "event.shown", "Volume shown" },
    { 24, "u32", "event.period_ns", "Period (ns)" },
    { 28, "u32", "event.underruns", "Underruns" },
  }),
  [4] = layout({ VOLUME }),
  [5] = layout({ VOLUME, { 8, "u32", "event.runs", "Runs" } }),
  [6] = REFUSED,
  [7] = layout({
    VOLUME,
    { 8, "u64", "event.sweep", "Sweep" },
    { 16, "u64", "event.start_ns", "Start of the sweep (ns)" },
  }),
  [8] = REFUSED,
  [9] = layout({
    { 0, "u64", "event.sweep", "Sweep" },
    { 8, "u32", "event.underruns", "Underruns" },
  }),
  [10] = layout({
    { 0, "i16", "temperature", "Temperature (0.1 °C)" },
    { 4, "u32", "event.power_mw", "Power (mW)" },
  }),
  [11] = layout({
    { 0, "u32", "event.error", "Error", ERRORS },
    { 4, "u32", "event.error.sequence", "Sequence of the packet" },
    { 8, "u64", "event.volume", "Volume" },
    { 16, "u32", "event.error.picture", "Picture" },
    { 20, "u32", "event.error.detail", "Detail" },
  }),
  [12] = layout({
    { 0, "u32", "event.lit", "Lit" },
    { 4, "u32", "event.light_cause", "Cause", LIGHTS },
  }),
  [13] = layout({
    { 0, "u64", "event.volume", "Volume" },
    { 8, "u64", "event.sweep", "Sweep" },
  }),
}
local RUN = layout({
  { 0, "u32", "event.run.first", "First picture" },
  { 4, "u32", "event.run.count", "Pictures" },
})
-- By type: what else to say of an event in a line.
local SAYS = {
  [3] = first_u64, [4] = first_u64, [5] = first_u64, [7] = first_u64,
  [13] = first_u64,
  [11] = function(body) return ERRORS[body(0, 4):le_uint()] or "?" end,
  [12] = function(body) return LIGHTS[body(4, 4):le_uint()] or "?" end,
}
SAYS[6] = function(body)
  return first_u64(body) .. ", " .. (REASONS[body(8, 4):le_uint()] or "?")
end
SAYS[8] = SAYS[6]

-- §4; a request's value has a name of its own where it means something
local VALUES = {
  [1] = layout({ { 1, "u16", "request.page", "Page" } }),
  [7] = layout({ { 1, "u16", "request.brightness", "Brightness (65535: full)" } }),
  [9] = layout({ { 1, "u16", "request.blank", "Blank", { [0] = "light", [1] = "dark" } } }),
}
local VALUE = layout({ { 1, "u16", "request.value", "Value" } })
local REQUEST = layout({
  { 0, "u8", "request", "Request", REQUESTS },
  { 3, "u16", "request.index", "Index" },
  { 5, "u16", "request.length", "Length" },
})
local POWER_LIMIT = layout({ { 0, "u32", "request.power_limit_mw", "Power limit (mW)" } })

-- §4.1
local CAPABILITIES = layout({
  { 0, "u32", "capabilities.total_length", "Length of the block" },
  { 4, "x16", "version", "Version" },
  { 6, "x8", "capabilities.formats", "Pixel formats" },
  { 7, "u8", "capabilities.max_sub_frames", "Most sub-frames" },
  { 8, "x32", "capabilities.features", "Features", bits = {
    { 0x1, "capabilities.features.watchdog", "Watchdog" },
    { 0x2, "capabilities.features.brightness", "Brightness" },
    { 0x4, "capabilities.features.power_limit", "Power limit" },
    { 0x8, "capabilities.features.temperature", "Temperature" },
  } },
  { 12, "u32", "receive_buffer", "Receive buffer (bytes)" },
  { 16, "u32", "capabilities.max_payload", "Largest payload" },
  { 20, "u32", "capabilities.slices", "Slices" },
  { 24, "u32", "capabilities.width", "Width" },
  { 28, "u32", "capabilities.height", "Height" },
  { 32, "u32", "capabilities.volume_buffers", "Volume buffers" },
  { 36, "u32", "capabilities.min_rate", "Least sweeps in 1,000 s" },
  { 40, "u32", "capabilities.max_rate", "Most sweeps in 1,000 s" },
  { 44, "u32", "capabilities.nominal_rate", "Nominal sweeps in 1,000 s" },
  { 48, "u32", "capabilities.max_power_mw", "Most power (mW)" },
  { 52, "u16", "capabilities.keepalive_ms", "Keepalive (ms)" },
  { 54, "u16", "capabilities.watchdog_ms", "Watchdog (ms)" },
})
local SHAPE_OFFSET = 64

-- §4.2
local MIRROR_BITS = {
  { 0x01, "shape.mirror.rows", "Along rows" }, { 0x02, "shape.mirror.columns", "Along columns" },
}
local KIND = layout({ { 0, "u8", "shape.kind", "Shape", SHAPES } })
local PLANAR = layout({
  { 1, "u8", "shape.normal", "Normal", { [0] = "slices lie flat", [1] = "slices stand" } },
  { 2, "x8", "shape.mirror", "Mirrored", bits = MIRROR_BITS },
  { 3, "u8", "shape.strokes", "Strokes" },
  { 4, "u32", "shape.positions", "Positions" },
  { 8, "f64", "shape.pitch_u_mm", "Pitch along rows (mm)" },
  { 16, "f64", "shape.pitch_v_mm", "Pitch along columns (mm)" },
  { 24, "f64", "shape.thickness_mm", "Thickness of the only slice (mm)" },
})
local POSITION = layout({ { 0, "f64", "shape.position_mm", "Position (mm)" } })
local ROTOR = layout({
  { 1, "u8", "shape.clockwise", "Clockwise" },
  { 2, "u8", "shape.panels", "Panels" },
  { 4, "u32", "shape.slices_per_turn", "Slices a turn" },
})
local PANEL = layout({
  { 0, "f64", "shape.pitch_u_mm", "Pitch along rows (mm)" },
  { 8, "f64", "shape.pitch_v_mm", "Pitch along columns (mm)" },
  { 16, "f64", "shape.eccentricity_mm", "Eccentricity (mm)" },
  { 24, "f64", "shape.shift_u_mm", "Shift along rows (mm)" },
  { 32, "f64", "shape.shift_v_mm", "Shift along Z (mm)" },
  { 40, "f64", "shape.phase_turns", "Phase (turns)" },
  { 48, "x8", "shape.mirror", "Mirrored", bits = MIRROR_BITS },
  { 52, "f32", "shape.tilt_deg", "Tilt (degrees)" },
})
local PANEL_SIZE = 56
local LATTICE = layout({
  { 4, "u32", "shape.lights", "Lights" },
  { 8, "f64", "shape.cell_x_mm", "Cell along x (mm)" },
  { 16, "f64", "shape.cell_y_mm", "Cell along y (mm)" },
  { 24, "f64", "shape.cell_z_mm", "Cell along z (mm)" },
})
local HELIX = layout({
  { 1, "x8", "shape.helix_flags", "Flags", bits = {
    { 0x01, "shape.helix_flags.clockwise", "Clockwise" }, { 0x02, "shape.helix_flags.left_handed", "Left-handed" },
  } },
  { 2, "x8", "shape.mirror", "Mirrored", bits = MIRROR_BITS },
  { 3, "u8", "shape.blades", "Blades" },
  { 4, "u32", "shape.slices_per_turn", "Slices a turn" },
  { 8, "f64", "shape.pitch_u_mm", "Pitch along rows (mm)" },
  { 16, "f64", "shape.pitch_v_mm", "Pitch along columns (mm)" },
  { 24, "f64", "shape.span_turns", "Span of a blade (turns)" },
  { 32, "f64", "shape.height_mm", "Height (mm)" },
  { 40, "f64", "shape.hub_mm", "Hub (mm)" },
  { 48, "f64", "shape.radius_mm", "Radius (mm)" },
  { 56, "f64", "shape.phase_turns", "Phase (turns)" },
})

-- §4.3, §4.4
local MODE = layout({
  { 0, "u8", "mode.format", "Pixel format", FORMATS },
  { 1, "u8", "mode.sub_frames", "Sub-frames" },
  { 2, "u8", "mode.bits", "Bits a channel" },
  { 4, "u32", "mode.rate", "Sweeps in 1,000 s" },
})
local STATUS = layout({
  { 0, "u8", "status.running", "In a session" },
  { 1, "x8", "status.flags", "Flags", bits = {
    { 0x01, "status.flags.blanked", "Blanked" },
    { 0x02, "status.flags.watchdog", "Dark by the watchdog" },
  } },
  { 4, "u32", "status.event_sequence", "Number of the next event" },
  { 8, "u64", "status.time_ns", "Device's time (ns)" },
  { 16, "u64", "status.bytes_received", "Bytes received" },
  { 24, "u64", "status.credit_limit", "Credit limit (bytes)" },
  { 32, "u64", "status.filling", "Volume being filled" },
  { 40, "u64", "status.last_complete", "Last complete volume" },
  { 48, "u64", "status.shown", "Volume shown" },
  { 56, "u64", "status.shown_sweep", "First shown with sweep" },
  { 64, "u64", "status.shown_start_ns", "which began at (ns)" },
  { 72, "u32", "status.underruns", "Underruns" },
  { 76, "i16", "temperature", "Temperature (0.1 °C)" },
})

-- What has no fixed place.
local f = {
  payload_crc = field(P.uint32, "payload_crc", "CRC-32C of the payload", base.HEX),
  payload_crc_status = field(P.uint8, "payload_crc.status", "CRC of the payload", base.DEC, SUMS),
  header_crc = field(P.uint32, "header_crc", "CRC-32C of the header", base.HEX),
  header_crc_status = field(P.uint8, "header_crc.status", "CRC of the header", base.DEC, SUMS),
  payload = field(P.bytes, "payload", "Payload"),
  skipped = field(P.bytes, "skipped", "Bytes that belong to no packet"),
  fragment = field(P.bytes, "fragment", "Part of a packet"),
  begun_in = field(P.framenum, "begun_in", "Packet begins in frame"),
  bitmap = field(P.bytes, "begin.bitmap", "Bitmap"),
  announced = field(P.uint32, "begin.announced", "Pictures that follow", base.DEC),
  event_body = field(P.bytes, "event.body", "Body"),
  request = by_name["request"],
  caps_more = field(P.bytes, "capabilities.more", "Bytes of the block"),
}
voxlink.fields = fields

local e = {
  sum = ProtoExpert.new("voxlink.bad_crc", "The CRC is wrong", expert.group.CHECKSUM,
                        expert.severity.ERROR),
  skipped = ProtoExpert.new("voxlink.noise", "Bytes that belong to no packet",
                            expert.group.MALFORMED, expert.severity.WARN),
  cut = ProtoExpert.new("voxlink.cut", "A packet was never finished", expert.group.SEQUENCE,
                        expert.severity.WARN),
  short = ProtoExpert.new("voxlink.short", "Too few bytes", expert.group.MALFORMED,
                          expert.severity.ERROR),
}
voxlink.experts = { e.sum, e.skipped, e.cut, e.short }

voxlink.prefs.check_payload = Pref.bool("Check the CRCs of payloads", true,
                                        "Takes time in large captures")

-- ---- sums, §5.6

local bxor, band, rshift = bit.bxor, bit.band, bit.rshift
local crc_table = {}
for i = 0, 255 do
  local v = i
  for _ = 1, 8 do
    v = band(v, 1) == 1 and bxor(rshift(v, 1), 0x82F63B78) or rshift(v, 1)
  end
  crc_table[i] = v
end

local function crc32c(bytes)
  local v = -1
  for i = 1, #bytes do
    v = bxor(rshift(v, 8), crc_table[band(bxor(v, bytes:byte(i)), 0xFF)])
  end
  return bxor(v, -1) % 2 ^ 32
end

-- ---- state over frames: filled on the first pass, in order, and only read after it

local HEADER = 40
local MAGIC = "VXLK"
local MOST_PAYLOAD = 2 ^ 24

local streams    -- device → { parts, have, need, begun } of the packet that is not yet whole
local bulk_of    -- frame → { before: bytes of earlier frames, begun, waits, cut }
local requests   -- device → the request that has no answer yet
local request_of -- frame → the request

function voxlink.init()
  streams, bulk_of, requests, request_of = {}, {}, {}, {}
end

-- The device, its endpoint, and whether the host sends. From the addresses: on a first pass there may
-- be no tree to find fields in.
local function where(pinfo)
  local source, destination = tostring(pinfo.src), tostring(pinfo.dst)
  local sends = source == "host"
  local device, endpoint = (sends and destination or source):match("^(.*)%.(%d+)$")
  return device, tonumber(endpoint), sends
end

-- A u32 in `bytes` at `at` (from 1).
local function word(bytes, at)
  local a, b, c, d = bytes:byte(at, at + 3)
  return a + b * 2 ^ 8 + c * 2 ^ 16 + d * 2 ^ 24
end

-- Whether `bytes` has a sound header at `at` (from 1); then its payload's length.
local function sound_header(bytes, at)
  if #bytes - at + 1 < HEADER or bytes:sub(at, at + 3) ~= MAGIC then return nil end
  if crc32c(bytes:sub(at, at + 35)) ~= word(bytes, at + 36) then return nil end
  local length = word(bytes, at + 28)
  return length <= MOST_PAYLOAD and length or nil
end

-- Where the next packet may begin, from `at` on: a sound header, or a beginning of one at the end.
local function next_packet(bytes, at)
  while at <= #bytes do
    local found = bytes:find(MAGIC, at, true)
    if found == nil then
      for tail = math.max(at, #bytes - 2), #bytes do
        if bytes:sub(tail) == MAGIC:sub(1, #bytes - tail + 1) then return tail end
      end
      return #bytes + 1
    end
    if #bytes - found + 1 < HEADER or sound_header(bytes, found) then return found end
    at = found + 1
  end
  return at
end

-- ---- packets

local function add_begin(tree, payload)
  if payload:len() < 16 then
    tree:add_proto_expert_info(e.short)
    return
  end
  add(tree, BEGIN, payload)
  if payload:len() == 16 then return end
  local bitmap = payload(16)
  tree:add(f.bitmap, bitmap)
  local count = 0
  for i = 0, bitmap:len() - 1 do
    local v = bitmap(i, 1):uint()
    while v > 0 do
      count = count + v % 2
      v = math.floor(v / 2)
    end
  end
  tree:add(f.announced, bitmap, count):set_generated()
end

local function add_sum(tree, name, range, right)
  local item = tree:add_le(f[name], range)
  local told = tree:add(f[name .. "_status"], range, right)
  told:set_generated()
  if right == 0 then item:add_proto_expert_info(e.sum) end
end

-- A whole packet; what to say of it in a line.
local function add_packet(buffer, tree)
  local kind = buffer(4, 1):uint()
  local length = buffer(28, 4):le_uint()
  local name = PACKETS[kind] or ("type " .. kind)
  local says = name
  if kind ~= 7 then says = says .. " " .. first_u64(buffer(8)) end
  if kind == 2 then
    says = says .. "/" .. buffer(20, 4):le_uint() .. "." .. buffer(6, 2):le_uint()
  elseif kind == 3 then
    says = says .. (buffer(5, 1):uint() % 2 == 1 and " show" or " hold")
  end
  local packet = tree:add(voxlink, buffer, "voxlink packet: " .. says)
  add(packet, PACKET, buffer)
  local right = 2
  if length == 0 then
    right = buffer(32, 4):le_uint() == 0 and 1 or 0
  elseif voxlink.prefs.check_payload then
    right = crc32c(buffer(HEADER, length):raw()) == buffer(32, 4):le_uint() and 1 or 0
  end
  add_sum(packet, "payload_crc", buffer(32, 4), right)
  add_sum(packet, "header_crc", buffer(36, 4), 1)
  if length > 0 then
    local payload = buffer(HEADER, length)
    local item = packet:add(f.payload, payload)
    if kind == 1 then
      add_begin(packet, payload)
    elseif kind == 5 and length >= 8 then
      add(packet, buffer(5, 1):uint() % 2 == 1 and SHOW_AHEAD or SHOW, payload)
    elseif kind ~= 2 then
      item:add_proto_expert_info(e.short)
    end
  end
  return right == 0 and says .. " (bad CRC)" or says
end

-- The packets of a stream's bytes; what was found, and where one begins that is not whole (from 0).
local function add_packets(buffer, tree)
  local bytes = buffer:raw()
  local found, at = {}, 1
  while at <= #bytes do
    local begins = next_packet(bytes, at)
    if begins > at then
      tree:add(f.skipped, buffer(at - 1, begins - at)):add_proto_expert_info(e.skipped)
      found[#found + 1] = (begins - at) .. " stray bytes"
      at = begins
    end
    local length = sound_header(bytes, at)
    if length == nil or #bytes - at + 1 < HEADER + length then break end
    found[#found + 1] = add_packet(buffer(at - 1, HEADER + length), tree)
    at = at + HEADER + length
  end
  return found, at - 1
end

-- On the first pass: what earlier frames left for this one, or that it only carries on.
local function continue_stream(stream, bytes)
  local state = {}
  if stream.have == 0 then return state end
  if sound_header(bytes, 1) then
    state.cut = true  -- a host that lost a transfer begins anew
    stream.parts, stream.have = {}, 0
    return state
  end
  state.begun = stream.begun
  stream.parts[#stream.parts + 1] = bytes
  stream.have = stream.have + #bytes
  if stream.have < stream.need then
    state.waits = true
    return state
  end
  stream.parts[#stream.parts] = nil
  state.before = table.concat(stream.parts)
  stream.parts, stream.have = {}, 0
  return state
end

local function keep(stream, bytes, from, frame, begun)
  if from >= #bytes then return end
  local rest = bytes:sub(from + 1)
  local length = sound_header(rest, 1)
  stream.parts, stream.have = { rest }, #rest
  stream.need = HEADER + (length or 0)
  stream.begun = (from == 0 and begun) or frame
end

local function dissect_bulk(buffer, pinfo, root, device)
  local stream = streams[device]
  local bytes = buffer:raw()
  if bulk_of[pinfo.number] == nil and not pinfo.visited then
    if stream == nil then
      if bytes:sub(1, 4) ~= MAGIC then return 0 end
      stream = { parts = {}, have = 0, need = HEADER }
      streams[device] = stream
    end
    bulk_of[pinfo.number] = continue_stream(stream, bytes)
  else
    stream = nil  -- nothing more to learn
  end
  local state = bulk_of[pinfo.number]
  if state == nil then return 0 end

  pinfo.cols.protocol = "voxlink"
  local tree = root:add(voxlink, buffer(), "voxlink")
  if state.cut then tree:add_proto_expert_info(e.cut) end
  if state.begun then tree:add(f.begun_in, state.begun):set_generated() end
  if state.waits then
    tree:add(f.fragment, buffer())
    pinfo.cols.info = "carries on a packet"
    return buffer:len()
  end
  local whole = buffer
  if state.before then
    whole = ByteArray.new(state.before .. bytes, true):tvb("voxlink stream")
  end
  local found, from = add_packets(whole, tree)
  if from < whole:len() then
    tree:add(f.fragment, whole(from))
    local goes_on = from == 0 and state.begun
    found[#found + 1] = goes_on and "carries on a packet" or "beginning of a packet"
  end
  if stream then keep(stream, whole:raw(), from, pinfo.number, state.begun) end
  pinfo.cols.info = table.concat(found, ", ")
  return buffer:len()
end

-- ---- events, §6

local EVENT_HEADER = 24

local function add_body(tree, kind, body)
  local how = BODIES[kind]
  if how == nil or body:len() < how.size then
    local item = tree:add(f.event_body, body)
    if how then item:add_proto_expert_info(e.short) end
    return nil
  end
  add(tree, how, body)
  if kind == 5 then
    for at = 16, 8 + 8 * math.min(body(8, 4):le_uint(), 3), 8 do
      if at + 8 <= body:len() then add(tree, RUN, body, at) end
    end
  end
  return SAYS[kind] and SAYS[kind](body)
end

local function dissect_event(buffer, pinfo, root)
  if buffer:len() < EVENT_HEADER or buffer(2, 2):le_uint() ~= buffer:len() then return 0 end
  local kind = buffer(0, 1):uint()
  local name = EVENTS[kind] or ("event " .. kind)
  local tree = root:add(voxlink, buffer(), "voxlink event: " .. name)
  add(tree, EVENT, buffer)
  local says = buffer:len() > EVENT_HEADER and add_body(tree, kind, buffer(EVENT_HEADER))
  pinfo.cols.protocol = "voxlink"
  pinfo.cols.info = says and name .. " " .. says or name
  return buffer:len()
end

-- ---- requests, §4

local function add_shape(tree, bytes)
  local kind = bytes(0, 1):uint()
  add(tree, KIND, bytes)
  if kind == 1 and bytes:len() >= PLANAR.size then
    add(tree, PLANAR, bytes)
    for at = PLANAR.size, bytes:len() - 8, 8 do add(tree, POSITION, bytes, at) end
  elseif kind == 2 and bytes:len() >= ROTOR.size then
    add(tree, ROTOR, bytes)
    for at = ROTOR.size, bytes:len() - PANEL_SIZE, PANEL_SIZE do
      add(tree:add(voxlink, bytes(at, PANEL_SIZE), "Panel"), PANEL, bytes, at)
    end
  elseif kind == 3 and bytes:len() >= HELIX.size then
    add(tree, HELIX, bytes)
  elseif kind == 4 and bytes:len() >= LATTICE.size then
    add(tree, LATTICE, bytes)
  end
end

local function add_capabilities(tree, bytes, page)
  if page > 0 or bytes:len() < SHAPE_OFFSET then
    tree:add(f.caps_more, bytes)
    return
  end
  add(tree, CAPABILITIES, bytes)
  if bytes:len() > SHAPE_OFFSET then add_shape(tree, bytes(SHAPE_OFFSET)) end
end

local function add_or_short(tree, how, bytes)
  if bytes:len() < how.size then
    tree:add_proto_expert_info(e.short)
  else
    add(tree, how, bytes)
  end
end

-- wLength of each request; true: any but 0.
local LENGTHS = {
  [1] = true, [2] = true, [3] = 16, [4] = true, [5] = 0, [6] = 0, [7] = 0, [8] = 4, [9] = 0,
}
-- What a dissector gets of the setup: all but bmRequestType.
local SETUP = 7

local function dissect_request(buffer, pinfo, root, device)
  if buffer:len() < SETUP then return 0 end
  local number, value = buffer(0, 1):uint(), buffer(1, 2):le_uint()
  local length, right = buffer(5, 2):le_uint(), LENGTHS[number]
  if right == nil or buffer(3, 2):le_uint() ~= 0 then return 0 end
  if right ~= length and not (right == true and length > 0) then return 0 end
  local name = REQUESTS[number]
  if not pinfo.visited then
    requests[device] = { number = number, page = value }
    if number == 5 then streams[device] = nil end
  end
  local tree = root:add(voxlink, buffer(), "voxlink request: " .. name)
  add(tree, REQUEST, buffer)
  add(tree, VALUES[number] or VALUE, buffer)
  if number == 3 then add_or_short(tree, MODE, buffer(SETUP)) end
  if number == 8 then add_or_short(tree, POWER_LIMIT, buffer(SETUP)) end
  pinfo.cols.protocol = "voxlink"
  pinfo.cols.info = name
  return buffer:len()
end

local function dissect_answer(buffer, pinfo, root, device)
  if not pinfo.visited then
    request_of[pinfo.number] = requests[device]
    requests[device] = nil
  end
  local request = request_of[pinfo.number]
  if request == nil then return 0 end
  local name = REQUESTS[request.number]
  pinfo.cols.protocol = "voxlink"
  pinfo.cols.info = name .. " answered"
  local tree = root:add(voxlink, buffer(), "voxlink answer: " .. name)
  tree:add(f.request, request.number):set_generated()
  if buffer:len() == 0 then return 0 end
  if request.number == 1 then
    add_capabilities(tree, buffer(), request.page)
  elseif request.number == 2 then
    add_or_short(tree, STATUS, buffer())
  elseif request.number == 4 then
    add_or_short(tree, MODE, buffer())
  end
  return buffer:len()
end

-- ---- which is which

local BULK_OUT, INTERRUPT_IN = 1, 2

function voxlink.dissector(buffer, pinfo, root)
  local device, endpoint, sends = where(pinfo)
  if device == nil then return 0 end
  if endpoint == 0 then
    local dissect = sends and dissect_request or dissect_answer
    return dissect(buffer, pinfo, root, device)
  end
  if buffer:len() == 0 then return 0 end
  if endpoint == BULK_OUT and sends then return dissect_bulk(buffer, pinfo, root, device) end
  if endpoint == INTERRUPT_IN and not sends then return dissect_event(buffer, pinfo, root) end
  return 0
end

for _, name in ipairs({ "usb.bulk", "usb.interrupt", "usb.control" }) do
  DissectorTable.get(name):add(0xFF, voxlink)
end
-- §3.1: class FF, subclass 56, protocol 01
DissectorTable.get("usb.protocol"):add(0xFF5601, voxlink)
for _, name in ipairs({ "usb.device", "usb.product" }) do
  DissectorTable.get(name):add_for_decode_as(voxlink)
end
