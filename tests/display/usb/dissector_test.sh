#!/usr/bin/env bash
# Usage: dissector_test.sh TSHARK LUA RECORD_SESSION
# Records a voxlink session in which everything occurs, and checks the output of the dissector: fields by name with their values, the line
# of each frame, and the same output in one pass and in two.
set -euo pipefail
tshark=$1 lua=$2 record=$3
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
file=$folder/session.pcapng
# Ignores the user's own settings and plugins.
export HOME=$folder WIRESHARK_CONFIG_DIR=$folder
"$record" "$file"

shark() { "$tshark" -X "lua_script:$lua" -r "$file" "$@" 2>>"$folder/stderr"; }
failed=0
fail() { echo "dissector_test: $*" >&2; failed=1; }

# expect FILTER FIELD=VALUE…: the field's values in the frames that match, in order, joined with commas.
expect() {
  local filter=$1 pair column=1 have
  local -a fields=()
  shift
  for pair in "$@"; do fields+=(-e "${pair%%=*}"); done
  shark -Y "$filter" -T fields -E occurrence=a -E aggregator=, "${fields[@]}" >"$folder/values"
  for pair in "$@"; do
    have=$(cut -f "$column" "$folder/values" | sed '/^$/d' | paste -sd, -)
    [ "$have" = "${pair#*=}" ] || fail "${pair%%=*} where $filter: '$have' instead of '${pair#*=}'"
    column=$((column + 1))
  done
}
# line FILTER TEXT: the info column of the frames that match.
line() {
  local have
  have=$(shark -Y "$1" -T fields -e _ws.col.Info | paste -sd'|' -)
  [ "$have" = "$2" ] || fail "line of $1: '$have' instead of '$2'"
}

# Sessions of the driver (device 1) and by hand (device 2); times are times of day.
driver='usb.device_address==1' hand='usb.device_address==2'
expect 'frame.number==1' frame.time_epoch=1750000001.000000000
expect "$driver && voxlink.request && usb.urb_type=='S'" voxlink.request=1,6,3,7,8,9,5,6

# Requests and their answers.
expect "$driver && voxlink.request==1 && usb.urb_type=='S'" voxlink.request.page=0
answer="$driver && voxlink.request==1 && usb.urb_type=='C'"
expect "$answer" voxlink.capabilities.total_length=144 \
  voxlink.version=0x0100 \
  voxlink.capabilities.features.watchdog=1 \
  voxlink.receive_buffer=4194304 \
  voxlink.capabilities.slices=6 \
  voxlink.capabilities.nominal_rate=30000 \
  voxlink.capabilities.watchdog_ms=250 \
  voxlink.shape.kind=1 \
  voxlink.shape.pitch_v_mm=1 \
  voxlink.shape.position_mm=-2.5,-1.5,-0.5,0.5,1.5,2.5
expect "$driver && voxlink.request==3" voxlink.mode.rate=30000
expect "$driver && voxlink.request==9" voxlink.request.blank=0
expect "$hand && voxlink.request==7" voxlink.request.brightness=32768
expect "$hand && voxlink.request==8" voxlink.request.power_limit_mw=45000
expect "$hand && voxlink.request==4" voxlink.mode.sub_frames=1
expect "$hand && voxlink.request==2" voxlink.status.running=1 \
  voxlink.status.bytes_received=2042 \
  voxlink.temperature=300
expect "$hand && voxlink.request==5" voxlink.request=5,5

# Packets: the first volume whole, later ones with a base.
first="$driver && voxlink.begin.base==0"
line "$first" 'VOLUME_BEGIN 1, SLICE 1/0.0, SLICE 1/1.0, SLICE 1/2.0, SLICE 1/3.0, SLICE 1/4.0, SLICE 1/5.0, VOLUME_END 1 show'
expect "$first" voxlink.type=1,2,2,2,2,2,2,3 \
  voxlink.sequence=0,1,2,3,4,5,6,7 \
  voxlink.slice=0,0,1,2,3,4,5,0 \
  voxlink.length=16,192,192,192,192,192,192,0 \
  "voxlink.magic=$(printf '0x4b4c5856,%.0s' 1 2 3 4 5 6 7)0x4b4c5856" \
  voxlink.payload_crc.status=1,1,1,1,1,1,1,1 \
  voxlink.header_crc.status=1,1,1,1,1,1,1,1 \
  voxlink.begin.pictures=6 \
  voxlink.flags.show=0,0,0,0,0,0,0,1
expect "$driver && voxlink.begin.base>0" voxlink.begin.base=1,2 \
  voxlink.begin.announced=3,3
expect "$driver && voxlink.type==7" voxlink.volume=0,0,0

# Damage, noise, and packets that are split by transfers.
damaged="$hand && voxlink.payload_crc.status==0"
expect "$damaged" voxlink.payload_crc.status=1,0,1,1,1,1,1,1 \
  '_ws.expert.message=The CRC is wrong'
expect "$hand && voxlink.skipped" voxlink.skipped=ee \
  voxlink.type=6,1,4,1,7 \
  voxlink.begin.bitmap=12
line "$hand && voxlink.fragment" 'beginning of a packet|carries on a packet'
line "$hand && voxlink.begun_in && voxlink.type" 'SLICE 1/0.0, VOLUME_END 1 hold'
expect "$hand && voxlink.begun_in && voxlink.type" voxlink.payload_crc.status=1,1
expect "$hand && voxlink.type==5" voxlink.show.sweep=77

# Events.
expect "$driver && voxlink.event.type==1" voxlink.receive_buffer=4194304
expect "$driver && voxlink.event.type==4" voxlink.event.volume=1,2,3
expect "$driver && voxlink.event.type==7" voxlink.event.sweep=1,2,3 \
  voxlink.event.flags.bit0=0,0,0
expect "$driver && voxlink.event.type==3 && voxlink.event.sweep==2" voxlink.event.period_ns=33333333 \
  voxlink.event.shown=2
expect "$hand && voxlink.event.type==5" voxlink.event.flags.bit0=1 \
  voxlink.event.run.first=0 \
  voxlink.event.run.count=1
expect "$hand && voxlink.event.type==6" voxlink.event.reason=1,3
expect "$hand && voxlink.event.type==8" voxlink.event.reason=1
expect "$hand && voxlink.event.type==11" voxlink.event.error=2,1 \
  voxlink.event.error.detail=192,1
expect "$hand && voxlink.event.type==12" voxlink.event.light_cause=1
expect "$hand && voxlink.event.type==10" voxlink.temperature=300
expect "$hand && voxlink.event.sequence==1" voxlink.event.credit_limit=4195792

# A capture that begins later is told what the device is.
"$tshark" -r "$file" -Y "$driver && frame.number>2" -w "$folder/later.pcapng" 2>>"$folder/stderr"
whole=$file file=$folder/later.pcapng
expect voxlink voxlink.sequence=
as_voxlink=$(shark -d 'usb.device==65537,voxlink' -Y 'voxlink.type==1' -T fields -e voxlink.volume | paste -sd, -)
[ "$as_voxlink" = 1,1,1,1,1,1,1,1,2,2,2,2,2,3,3,3,3,3 ] || fail "decoded as voxlink: volumes '$as_voxlink'"
file=$whole

# Wireshark examines frames more than once. (USB's own dissector knows more the second time.)
if ! diff <(shark -V -Y voxlink) <(shark -2 -V -Y voxlink | sed '/^ *\[Response in:/d') >"$folder/diff"; then
  fail "two passes see something else: $(head -n 4 "$folder/diff")"
fi
if shark -V | grep -i 'lua error\|malformed packet'; then fail "the dissector has an error"; fi
if grep -i 'lua' "$folder/stderr"; then fail "the dissector complains"; fi
[ "$failed" = 0 ] && echo "dissector_test: passed"
exit "$failed"
