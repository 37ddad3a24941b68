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
  [11] = "ERROR", [12] = "LIGHT",
}
local REQUESTS = {
  [1] = "GET_CAPABILITIES", [2] = "GET_STATUS", [3] = "SET_MODE", [4] = "GET_MODE",
  [5] = "START", [6] = "STOP", [7] = "SET_BRIGHTNESS", [8] = "SET_POWER_LIMIT",
  [9] = "SET_BLANK",
}
local FORMATS = { [0] = "RGB888", [1] = "RGB332", [2] = "three bit planes" }
local SHAPES = { [1] = "planar stack", [2] = "rotor" }
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

-- ---- fields

local fields = {}
local function field(make, name, label, ...)
  local made = make("voxlink." .. name, label, ...)
  fields[#fields + 1] = made
  return made
end

local P = ProtoField
local DEC, HEX = base.DEC, base.HEX
local f = {
  -- §5.1 the packet
  magic = field(P.uint32, "magic", "Magic", HEX),
  type = field(P.uint8, "type", "Type", DEC, PACKETS),
  flags = field(P.uint8, "flags", "Flags", HEX),
  flag_show = field(P.bool, "flags.show", "Show from the next sweep on", 8, nil, 0x01),
  sub_frame = field(P.uint16, "sub_frame", "Sub-frame", DEC),
  volume = field(P.uint64, "volume", "Volume", DEC),
  sequence = field(P.uint32, "sequence", "Sequence", DEC),
  slice = field(P.uint32, "slice", "Slice", DEC),
  offset = field(P.uint32, "offset", "Offset in the picture", DEC),
  length = field(P.uint32, "length", "Length of the payload", DEC),
  payload_crc = field(P.uint32, "payload_crc", "CRC-32C of the payload", HEX),
  payload_crc_status = field(P.uint8, "payload_crc.status", "CRC of the payload", DEC, SUMS),
  header_crc = field(P.uint32, "header_crc", "CRC-32C of the header", HEX),
  header_crc_status = field(P.uint8, "header_crc.status", "CRC of the header", DEC, SUMS),
  payload = field(P.bytes, "payload", "Payload"),
  skipped = field(P.bytes, "skipped", "Bytes that belong to no packet"),
  fragment = field(P.bytes, "fragment", "Part of a packet"),
  begun_in = field(P.framenum, "begun_in", "Packet begins in frame"),
  -- §5.2, §5.5
  base = field(P.uint64, "begin.base", "Base", DEC),
  pictures = field(P.uint32, "begin.pictures", "Pictures", DEC),
  bitmap = field(P.bytes, "begin.bitmap", "Bitmap"),
  announced = field(P.uint32, "begin.announced", "Pictures that follow", DEC),
  show_sweep = field(P.uint64, "show.sweep", "From sweep", DEC),
  -- §6 events
  event = field(P.uint8, "event.type", "Type", DEC, EVENTS),
  event_flags = field(P.uint8, "event.flags", "Flags", HEX),
  event_last = field(P.bool, "event.flags.last", "The list ends here", 8, nil, 0x01),
  event_dark = field(P.bool, "event.flags.dark", "The device was dark", 8, nil, 0x01),
  event_length = field(P.uint16, "event.length", "Length", DEC),
  event_sequence = field(P.uint32, "event.sequence", "Sequence", DEC),
  event_time = field(P.uint64, "event.time_ns", "Device's time (ns)", DEC),
  event_credit = field(P.uint64, "event.credit_limit", "Credit limit (bytes)", DEC),
  event_body = field(P.bytes, "event.body", "Body"),
  version = field(P.uint16, "version", "Version", HEX),
  receive_buffer = field(P.uint32, "receive_buffer", "Receive buffer (bytes)", DEC),
  sweep = field(P.uint64, "event.sweep", "Sweep", DEC),
  start_ns = field(P.uint64, "event.start_ns", "Start of the sweep (ns)", DEC),
  event_volume = field(P.uint64, "event.volume", "Volume", DEC),
  shown = field(P.uint64, "event.shown", "Volume shown", DEC),
  period_ns = field(P.uint32, "event.period_ns", "Period (ns)", DEC),
  underruns = field(P.uint32, "event.underruns", "Underruns", DEC),
  runs = field(P.uint32, "event.runs", "Runs", DEC),
  run_first = field(P.uint32, "event.run.first", "First picture", DEC),
  run_count = field(P.uint32, "event.run.count", "Pictures", DEC),
  reason = field(P.uint32, "event.reason", "Reason", DEC, REASONS),
  temperature = field(P.int16, "temperature", "Temperature (0.1 °C)", DEC),
  power_mw = field(P.uint32, "event.power_mw", "Power (mW)", DEC),
  error = field(P.uint32, "event.error", "Error", DEC, ERRORS),
  error_sequence = field(P.uint32, "event.error.sequence", "Sequence of the packet", DEC),
  error_picture = field(P.uint32, "event.error.picture", "Picture", DEC),
  error_detail = field(P.uint32, "event.error.detail", "Detail", DEC),
  lit = field(P.uint32, "event.lit", "Lit", DEC),
  light_cause = field(P.uint32, "event.light_cause", "Cause", DEC, LIGHTS),
  -- §4 requests
  request = field(P.uint8, "request", "Request", DEC, REQUESTS),
  page = field(P.uint16, "request.page", "Page", DEC),
  brightness = field(P.uint16, "request.brightness", "Brightness (65535: full)", DEC),
  dark = field(P.uint16, "request.blank", "Blank", DEC, { [0] = "light", [1] = "dark" }),
  value = field(P.uint16, "request.value", "Value", DEC),
  index = field(P.uint16, "request.index", "Index", DEC),
  wlength = field(P.uint16, "request.length", "Length", DEC),
  power_limit = field(P.uint32, "request.power_limit_mw", "Power limit (mW)", DEC),
  -- §4.1
  caps_length = field(P.uint32, "capabilities.total_length", "Length of the block", DEC),
  caps_formats = field(P.uint8, "capabilities.formats", "Pixel formats", HEX),
  caps_sub_frames = field(P.uint8, "capabilities.max_sub_frames", "Most sub-frames", DEC),
  caps_features = field(P.uint32, "capabilities.features", "Features", HEX),
  caps_watchdog = field(P.bool, "capabilities.features.watchdog", "Watchdog", 32, nil, 0x1),
  caps_brightness = field(P.bool, "capabilities.features.brightness", "Brightness", 32, nil, 0x2),
  caps_power = field(P.bool, "capabilities.features.power_limit", "Power limit", 32, nil, 0x4),
  caps_temp = field(P.bool, "capabilities.features.temperature", "Temperature", 32, nil, 0x8),
  caps_payload = field(P.uint32, "capabilities.max_payload", "Largest payload", DEC),
  caps_slices = field(P.uint32, "capabilities.slices", "Slices", DEC),
  caps_width = field(P.uint32, "capabilities.width", "Width", DEC),
  caps_height = field(P.uint32, "capabilities.height", "Height", DEC),
  caps_buffers = field(P.uint32, "capabilities.volume_buffers", "Volume buffers", DEC),
  caps_min_rate = field(P.uint32, "capabilities.min_rate", "Least sweeps in 1,000 s", DEC),
  caps_max_rate = field(P.uint32, "capabilities.max_rate", "Most sweeps in 1,000 s", DEC),
  caps_rate = field(P.uint32, "capabilities.nominal_rate", "Nominal sweeps in 1,000 s", DEC),
  caps_power_mw = field(P.uint32, "capabilities.max_power_mw", "Most power (mW)", DEC),
  caps_keepalive = field(P.uint16, "capabilities.keepalive_ms", "Keepalive (ms)", DEC),
  caps_watchdog_ms = field(P.uint16, "capabilities.watchdog_ms", "Watchdog (ms)", DEC),
  caps_more = field(P.bytes, "capabilities.more", "Bytes of the block"),
  -- §4.2
  shape = field(P.uint8, "shape.kind", "Shape", DEC, SHAPES),
  shape_normal = field(P.uint8, "shape.normal", "Normal", DEC,
                       { [0] = "slices lie flat", [1] = "slices stand" }),
  mirror_rows = field(P.bool, "shape.mirror.rows", "Mirrored along rows", 8, nil, 0x01),
  mirror_columns = field(P.bool, "shape.mirror.columns", "Mirrored along columns", 8, nil, 0x02),
  shape_positions = field(P.uint32, "shape.positions", "Positions", DEC),
  pitch_u = field(P.double, "shape.pitch_u_mm", "Pitch along rows (mm)"),
  pitch_v = field(P.double, "shape.pitch_v_mm", "Pitch along columns (mm)"),
  thickness = field(P.double, "shape.thickness_mm", "Thickness of the only slice (mm)"),
  position = field(P.double, "shape.position_mm", "Position (mm)"),
  clockwise = field(P.uint8, "shape.clockwise", "Clockwise", DEC),
  panels = field(P.uint8, "shape.panels", "Panels", DEC),
  turn = field(P.uint32, "shape.slices_per_turn", "Slices a turn", DEC),
  eccentricity = field(P.double, "shape.eccentricity_mm", "Eccentricity (mm)"),
  shift_u = field(P.double, "shape.shift_u_mm", "Shift along rows (mm)"),
  shift_v = field(P.double, "shape.shift_v_mm", "Shift along Z (mm)"),
  phase = field(P.double, "shape.phase_turns", "Phase (turns)"),
  -- §4.3
  format = field(P.uint8, "mode.format", "Pixel format", DEC, FORMATS),
  sub_frames = field(P.uint8, "mode.sub_frames", "Sub-frames", DEC),
  rate = field(P.uint32, "mode.rate", "Sweeps in 1,000 s", DEC),
  -- §4.4
  running = field(P.uint8, "status.running", "In a session", DEC),
  blanked = field(P.bool, "status.flags.blanked", "Blanked", 8, nil, 0x01),
  watchdog = field(P.bool, "status.flags.watchdog", "Dark by the watchdog", 8, nil, 0x02),
  next_event = field(P.uint32, "status.event_sequence", "Number of the next event", DEC),
  time = field(P.uint64, "status.time_ns", "Device's time (ns)", DEC),
  received = field(P.uint64, "status.bytes_received", "Bytes received", DEC),
  credit = field(P.uint64, "status.credit_limit", "Credit limit (bytes)", DEC),
  filling = field(P.uint64, "status.filling", "Volume being filled", DEC),
  complete = field(P.uint64, "status.last_complete", "Last complete volume", DEC),
  status_shown = field(P.uint64, "status.shown", "Volume shown", DEC),
  shown_sweep = field(P.uint64, "status.shown_sweep", "First shown with sweep", DEC),
  shown_start = field(P.uint64, "status.shown_start_ns", "which began at (ns)", DEC),
  status_underruns = field(P.uint32, "status.underruns", "Underruns", DEC),
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
  tree:add_le(f.base, payload(0, 8))
  tree:add_le(f.pictures, payload(8, 4))
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
  if kind ~= 7 then says = says .. " " .. tostring(buffer(8, 8):le_uint64()) end
  if kind == 2 then
    says = says .. "/" .. buffer(20, 4):le_uint() .. "." .. buffer(6, 2):le_uint()
  elseif kind == 3 then
    says = says .. (buffer(5, 1):uint() % 2 == 1 and " show" or " hold")
  end
  local packet = tree:add(voxlink, buffer, "voxlink packet: " .. says)
  packet:add_le(f.magic, buffer(0, 4))
  packet:add(f.type, buffer(4, 1))
  local flags = packet:add(f.flags, buffer(5, 1))
  if kind == 3 then flags:add(f.flag_show, buffer(5, 1)) end
  packet:add_le(f.sub_frame, buffer(6, 2))
  packet:add_le(f.volume, buffer(8, 8))
  packet:add_le(f.sequence, buffer(16, 4))
  packet:add_le(f.slice, buffer(20, 4))
  packet:add_le(f.offset, buffer(24, 4))
  packet:add_le(f.length, buffer(28, 4))
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
      packet:add_le(f.show_sweep, payload(0, 8))
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

-- By type: how many bytes the body has, what is in it, and what to say in a line.
local BODIES = {
  [1] = { 8, function(t, b)
    t:add_le(f.version, b(0, 2))
    t:add_le(f.receive_buffer, b(4, 4))
  end },
  [3] = { 32, function(t, b)
    t:add_le(f.sweep, b(0, 8))
    t:add_le(f.start_ns, b(8, 8))
    t:add_le(f.shown, b(16, 8))
    t:add_le(f.period_ns, b(24, 4))
    t:add_le(f.underruns, b(28, 4))
    return tostring(b(0, 8):le_uint64())
  end },
  [4] = { 8, function(t, b)
    t:add_le(f.event_volume, b(0, 8))
    return tostring(b(0, 8):le_uint64())
  end },
  [5] = { 40, function(t, b)
    t:add_le(f.event_volume, b(0, 8))
    t:add_le(f.runs, b(8, 4))
    for i = 0, math.min(b(8, 4):le_uint(), 3) - 1 do
      t:add_le(f.run_first, b(16 + 8 * i, 4))
      t:add_le(f.run_count, b(20 + 8 * i, 4))
    end
    return tostring(b(0, 8):le_uint64())
  end },
  [7] = { 24, function(t, b)
    t:add_le(f.event_volume, b(0, 8))
    t:add_le(f.sweep, b(8, 8))
    t:add_le(f.start_ns, b(16, 8))
    return tostring(b(0, 8):le_uint64())
  end },
  [9] = { 16, function(t, b)
    t:add_le(f.sweep, b(0, 8))
    t:add_le(f.underruns, b(8, 4))
  end },
  [10] = { 8, function(t, b)
    t:add_le(f.temperature, b(0, 2))
    t:add_le(f.power_mw, b(4, 4))
  end },
  [11] = { 24, function(t, b)
    t:add_le(f.error, b(0, 4))
    t:add_le(f.error_sequence, b(4, 4))
    t:add_le(f.event_volume, b(8, 8))
    t:add_le(f.error_picture, b(16, 4))
    t:add_le(f.error_detail, b(20, 4))
    return ERRORS[b(0, 4):le_uint()]
  end },
  [12] = { 8, function(t, b)
    t:add_le(f.lit, b(0, 4))
    t:add_le(f.light_cause, b(4, 4))
    return LIGHTS[b(4, 4):le_uint()]
  end },
}
BODIES[6] = { 16, function(t, b)
  t:add_le(f.event_volume, b(0, 8))
  t:add_le(f.reason, b(8, 4))
  return tostring(b(0, 8):le_uint64()) .. ", " .. (REASONS[b(8, 4):le_uint()] or "?")
end }
BODIES[8] = BODIES[6]

local EVENT_HEADER = 24

local function dissect_event(buffer, pinfo, root)
  if buffer:len() < EVENT_HEADER or buffer(2, 2):le_uint() ~= buffer:len() then return 0 end
  local kind = buffer(0, 1):uint()
  local name = EVENTS[kind] or ("event " .. kind)
  local tree = root:add(voxlink, buffer(), "voxlink event: " .. name)
  tree:add(f.event, buffer(0, 1))
  local flags = tree:add(f.event_flags, buffer(1, 1))
  if kind == 5 then flags:add(f.event_last, buffer(1, 1)) end
  if kind == 7 then flags:add(f.event_dark, buffer(1, 1)) end
  tree:add_le(f.event_length, buffer(2, 2))
  tree:add_le(f.event_sequence, buffer(4, 4))
  tree:add_le(f.event_time, buffer(8, 8))
  tree:add_le(f.event_credit, buffer(16, 8))
  local says
  if buffer:len() > EVENT_HEADER then
    local body = buffer(EVENT_HEADER)
    local how = BODIES[kind]
    if how and body:len() >= how[1] then
      says = how[2](tree, body)
    else
      local item = tree:add(f.event_body, body)
      if how then item:add_proto_expert_info(e.short) end
    end
  end
  pinfo.cols.protocol = "voxlink"
  pinfo.cols.info = says and name .. " " .. says or name
  return buffer:len()
end

-- ---- requests, §4

local function add_mirror(tree, range)
  tree:add(f.mirror_rows, range)
  tree:add(f.mirror_columns, range)
end

local function add_shape(tree, b)
  local kind = b(0, 1):uint()
  tree:add(f.shape, b(0, 1))
  if kind == 1 and b:len() >= 32 then
    tree:add(f.shape_normal, b(1, 1))
    add_mirror(tree, b(2, 1))
    tree:add_le(f.shape_positions, b(4, 4))
    tree:add_le(f.pitch_u, b(8, 8))
    tree:add_le(f.pitch_v, b(16, 8))
    tree:add_le(f.thickness, b(24, 8))
    for at = 32, b:len() - 8, 8 do tree:add_le(f.position, b(at, 8)) end
  elseif kind == 2 and b:len() >= 8 then
    tree:add(f.clockwise, b(1, 1))
    tree:add(f.panels, b(2, 1))
    tree:add_le(f.turn, b(4, 4))
    for at = 8, b:len() - 56, 56 do
      local panel = tree:add(voxlink, b(at, 56), "Panel")
      panel:add_le(f.pitch_u, b(at, 8))
      panel:add_le(f.pitch_v, b(at + 8, 8))
      panel:add_le(f.eccentricity, b(at + 16, 8))
      panel:add_le(f.shift_u, b(at + 24, 8))
      panel:add_le(f.shift_v, b(at + 32, 8))
      panel:add_le(f.phase, b(at + 40, 8))
      add_mirror(panel, b(at + 48, 1))
    end
  end
end

local function add_capabilities(tree, b, page)
  if page > 0 or b:len() < 64 then
    tree:add(f.caps_more, b)
    return
  end
  tree:add_le(f.caps_length, b(0, 4))
  tree:add_le(f.version, b(4, 2))
  tree:add(f.caps_formats, b(6, 1))
  tree:add(f.caps_sub_frames, b(7, 1))
  local features = tree:add_le(f.caps_features, b(8, 4))
  for _, feature in ipairs({ f.caps_watchdog, f.caps_brightness, f.caps_power, f.caps_temp }) do
    features:add_le(feature, b(8, 4))
  end
  tree:add_le(f.receive_buffer, b(12, 4))
  local at = 16
  for _, field32 in ipairs({
    f.caps_payload, f.caps_slices, f.caps_width, f.caps_height, f.caps_buffers, f.caps_min_rate,
    f.caps_max_rate, f.caps_rate, f.caps_power_mw,
  }) do
    tree:add_le(field32, b(at, 4))
    at = at + 4
  end
  tree:add_le(f.caps_keepalive, b(52, 2))
  tree:add_le(f.caps_watchdog_ms, b(54, 2))
  if b:len() > 64 then add_shape(tree, b(64)) end
end

local function add_mode(tree, b)
  if b:len() < 16 then return tree:add_proto_expert_info(e.short) end
  tree:add(f.format, b(0, 1))
  tree:add(f.sub_frames, b(1, 1))
  tree:add_le(f.rate, b(4, 4))
end

local function add_status(tree, b)
  if b:len() < 80 then return tree:add_proto_expert_info(e.short) end
  tree:add(f.running, b(0, 1))
  tree:add(f.blanked, b(1, 1))
  tree:add(f.watchdog, b(1, 1))
  tree:add_le(f.next_event, b(4, 4))
  local at = 8
  for _, field64 in ipairs({
    f.time, f.received, f.credit, f.filling, f.complete, f.status_shown, f.shown_sweep,
    f.shown_start,
  }) do
    tree:add_le(field64, b(at, 8))
    at = at + 8
  end
  tree:add_le(f.status_underruns, b(72, 4))
  tree:add_le(f.temperature, b(76, 2))
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
  tree:add(f.request, buffer(0, 1))
  local named = { [1] = f.page, [7] = f.brightness, [9] = f.dark }
  tree:add_le(named[number] or f.value, buffer(1, 2))
  tree:add_le(f.index, buffer(3, 2))
  tree:add_le(f.wlength, buffer(5, 2))
  if number == 3 and buffer:len() > SETUP then
    add_mode(tree, buffer(SETUP))
  elseif number == 8 and buffer:len() >= SETUP + 4 then
    tree:add_le(f.power_limit, buffer(SETUP, 4))
  end
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
    add_status(tree, buffer())
  elseif request.number == 4 then
    add_mode(tree, buffer())
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
