"""Hand-written seeds for sessions: courses of a protocol that are rare in real traffic, including each refusal. Like shape_seeds.py; `text`
is
make_seeds.text."""
import json
import pathlib
import sqlite3
import struct
import tempfile

from google.protobuf import text_format

from request_seeds import classes


def foxglove(put, text):
    say = lambda update: b"\x03" + text(json.dumps(update).encode())
    points = [{"x": 0, "y": 0, "z": 0}, {"x": 1, "y": 1, "z": 1}, {"x": 1}]
    colors = [{"r": 1, "g": 0, "b": 0, "a": 1}, {"r": 0.5}, {"g": 2}]
    cube = {"size": {"x": 1, "y": 1, "z": 1}}
    entity = lambda name, **what: {"id": name, **what}
    several = say({"entities": [entity("a", cubes=[cube] * 3), entity("b", cubes=[cube], lifetime={"sec": 1, "nsec": 0}), entity("c", spheres=[{"size": {"x": 1, "y": 1, "z": 1}}])]})
    for then in (say({"deletions": [{"type": 0, "id": "a"}, {"type": 0, "id": "none"}]}), say({"deletions": [{"type": 1}]}), say({"entities": [entity("a", cubes=[cube])]}), say({"entities": [entity("a")]}), b"\x04\x20" + say({"deletions": [{"type": 0, "id": "b"}]})):
        put("foxglove", several + then + several)
    for what in ({"lines": [{"type": t, "points": points, "colors": colors, "thickness": 0.1, "indices": [0, 1, 2]} for t in (0, 1, 2)]}, {"lines": [{"points": points, "colors": colors[:2]}, {}]}, {"triangles": [{"points": points, "colors": colors}, {}]},
                 {"texts": [{"text": "a", "billboard": True, "font_size": 2}, {"text": "b", "scale_invariant": True}, {}]}, {"arrows": [{}]}, {"cylinders": [{}]}, {"models": [{}]}, {"lifetime": {"sec": -1, "nsec": -5}, "cubes": [{}]}):
        put("foxglove", say({"entities": [entity("a", **what)]}))


def e131(universe=1, source=0, priority=100, sequence=0, values=b"\1\2\3", sync=0, options=0):
    out = bytearray(126) + values
    out[:16] = b"\x00\x10\x00\x00ASC-E1.17\x00\x00\x00"
    length = lambda at: struct.pack_into(">H", out, at, 0x7000 | len(out) - at)
    length(16), length(38), length(115)
    struct.pack_into(">I", out, 18, 4), struct.pack_into(">I", out, 40, 2)
    out[22:38] = bytes([source]) * 16
    struct.pack_into(">BHBBH", out, 108, priority, sync, sequence, options, universe)
    out[117:125] = b"\x02\xa1\x00\x00\x00\x01" + struct.pack(">H", len(values) + 1)
    return bytes(out)


def e131_sync(address, sequence=0):
    out = bytearray(49)
    out[:16] = b"\x00\x10\x00\x00ASC-E1.17\x00\x00\x00"
    struct.pack_into(">H", out, 16, 0x7000 | 33), struct.pack_into(">H", out, 38, 0x7000 | 11)
    struct.pack_into(">I", out, 18, 8), struct.pack_into(">I", out, 40, 1)
    out[44:47] = struct.pack(">BH", sequence, address)
    return bytes(out)


def lights(put, text):
    sent = lambda *packets: b"".join(b"\x40" + text(p) for p in packets)
    put("light_datagrams", b"\x01\x03\x01" + sent(*(e131(source=i) for i in range(18))))  # more sources than can be distinguished
    put("light_datagrams", b"\x01\x03\x01" + sent(e131(), e131(sync=7), e131_sync(7), e131_sync(8), e131(sequence=1, sync=7), e131(options=0x40), e131(priority=201), e131(universe=0), e131(source=1, priority=150), e131(sequence=3)))
    for protocol in range(4):
        network = bytes([protocol, 0, 100, 2, 3, 3])  # first universe 1, sync universe 2, 4 slices of 4 pixels
        packets = b"\x06" + text(e131_sync(2)) + b"\x06" + text(e131_sync(9)) + b"\x06" + text(e131_sync(2) + b"a") + b"".join(bytes([0, i, i == 3, 40]) for i in range(4)) + b"\x03\x04\x05\x00\x01\x01\x09"
        put("network_packets", network + packets)


def deltas(put, text):
    """Writes seeds of what a worker is sent, word by word: valid, and with each word of it wrong in turn (gpu/delta.h)."""
    record = lambda op, body: struct.pack("<IIQ", op, 0, len(body) + 16) + body
    pad = lambda data: data + bytes(-len(data) % 16)

    def head(kind, vertices=0, indices=0, mode=0, params=(0, 0, 0, 1, 1, 1, 0, 0), topology=0, texture=(0, 0), number=1):
        return struct.pack("<Q11I", number, kind, 0xFFFFFF, mode, 0, 0, 0, topology, 0, 0, vertices, indices) + struct.pack("<8f", *params) + struct.pack("<IIHH", 0, 0, *texture)

    def geometry(kind, vertices=0, indices=(), colors=(), mode=0, **more):
        arrays = pad(struct.pack(f"<{3 * vertices}f", *[i % 4 for i in range(3 * vertices)])) + pad(struct.pack(f"<{len(indices)}I", *indices)) + pad(struct.pack(f"<{len(colors)}I", *colors))
        return record(1, head(kind, vertices, len(indices), mode, **more) + arrays)

    affine = struct.pack("<12d", 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0)
    drawable = record(3, struct.pack("<3Q6I", 1, 1, 1, 1, 0, 0xFFFFFF, 0, 0, 0) + affine)
    layer = record(5, struct.pack("<QiIIIIIIIQ", 1, 0, 1, 255, 0, 1, 1, 1, 1, 2) + affine + struct.pack("<4d", 1, 0, 0, 1) + bytes(19 * 32) + affine + bytes(3 * 96) + struct.pack("<6d", 0, 0, 0, 2, 2, 2))
    program = (1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 0)
    kinds = [geometry(1, 2), geometry(1, 2, (), (1, 2), mode=1), geometry(2, 4, (0, 1, 2, 3)), geometry(2, 3, topology=1), geometry(3, 3, (0, 1, 2)), geometry(3, 6), geometry(4), geometry(5), geometry(6), geometry(7, 0, program), geometry(8, 4), geometry(8, 4, topology=1),
             geometry(9, 16), geometry(10, 0, (0,) * 32), geometry(11, 3, (0, 1, 2)), geometry(3, 3, (), (0,) * 7, texture=(1, 1)), geometry(3, 3, (), (0,) * 22, texture=(4, 4))]
    front = bytes([0, 0, 0, 0]) + bytes([1, 0, 0]) + text(b"") + bytes([1, 1, 0]) + text(b"")
    target = bytes([3, 0, 0, 0, 0, 0, 0])
    apply = lambda delta: b"\x05" + text(delta) + b"\x00\x00"
    frame = bytes([6, 1, 1, 0, 0, 2, 0xC0, 0x00])
    for kind in kinds:
        put("worker_messages", front + target + apply(kind + layer + drawable) + frame)
    bulk = lambda kind, **more: record(8, head(kind, 4, **more) + struct.pack("<4Q", 1, 0, 64, 0))
    shown = bytes([8, 1, 0]) + text(struct.pack("<12f", *range(12)))
    for ref in ((1, 0, 64, 0), (1, 16, 48, 0), (1, 8, 64, 0), (1, 0, 8, 0), (2, 0, 64, 0), (1, 16384, 64, 0), (1, 1 << 40, 1 << 62, 0)):
        put("worker_messages", front + target + shown + apply(record(8, head(1, 4) + struct.pack("<4Q", *ref)) + layer + drawable) + frame + bytes([9, 1]) + frame + shown + shown + bytes([9, 3]))
    put("worker_messages", front + shown + apply(record(8, head(7, 0, 14) + struct.pack("<4Q", 1, 0, 64, 0))))
    drops = [record(op, struct.pack("<QQ", 1, 0)) for op in (2, 4, 6)] + [record(7, b"")]
    whole = kinds[0] + layer + drawable
    for delta in (whole + drops[1] + drops[0] + drops[2], whole + drops[0], whole + drops[2], whole + drops[3], record(7, bytes(16)), record(2, b""), record(9, b""), record(0, b""), b"abc", record(1, bytes(16)), record(3, bytes(16)), record(5, bytes(16)), record(8, bytes(16)),
                  struct.pack("<IIQ", 7, 0, 8), struct.pack("<IIQ", 7, 0, 17), struct.pack("<IIQ", 7, 0, 1 << 40), kinds[0] + kinds[0], drawable, layer + drawable, geometry(4, 3), geometry(4, 0, (1,)), geometry(4, mode=1), geometry(7, 0, program, mode=1), geometry(10, 1, (0,) * 32),
                  geometry(10, 0, (0,) * 32, mode=1), geometry(8, 4, (0,)), geometry(8, 5), geometry(8, 5, topology=1), geometry(8, 4, topology=2), geometry(9, 15), geometry(11, 3, (), (0,) * 3, mode=1), geometry(11, 4), geometry(3, 4), geometry(2, 3), geometry(1, 1, texture=(1, 1)),
                  geometry(3, 3, texture=(1, 0)), geometry(3, 3, (0, 1, 9)), geometry(7, 1, program), geometry(7, 0, program, params=(0, 0, 0, 1, 1, 1, 1, 0)), geometry(7, 0, program, params=(2, 0, 0, 1, 1, 1, 1, 0)), geometry(7, 0, program, params=(2, 0, 0, 1, 1, 1, 5, 0)),
                  geometry(7, 0, ()), geometry(10, 0, (1, 2)), kinds[0][:-16]):
        put("worker_messages", front + target + apply(delta))
    # Every word, in turn, is a number that does not exist, is too large, or is negative.
    for sound, size in ((kinds[0], 112), (kinds[2], 112), (kinds[7], 112), (drawable, len(drawable)), (layer, 16 + 48 + 96 + 32), (layer[:16 + 784], 16 + 784), (layer, len(layer))):
        for at in range(0, size if size < 400 else 0, 4):
            for word in (0, 1, 3, 300, 0x7FC00000, 0xBF800000, 0xFFFFFFFF):
                put("worker_messages", front + apply(sound[:at] + struct.pack("<I", word) + sound[at + 4:]))
    for at in (160, 176, 800, 888, 1184, 1192, 1208, 1224):
        for number in (float("nan"), float("inf"), 9.0, 0.0):
            put("worker_messages", front + apply(layer[:at] + struct.pack("<d", number) + layer[at + 8:]))


def workers(put, text):
    linked, front = bytes([0, 0x40, 0, 0]), bytes([0, 0, 0, 0])
    message = lambda kind, body, how=0: bytes([10, kind, 9]) + text(body) + bytes([how])
    invite = lambda library: message(11, bytes(4) + library)
    join = lambda library, byte, rank, ranks: message(12, bytes([byte]) * 128 + struct.pack("<ii", rank, ranks) + library)
    put("worker_messages", linked + invite(b"a") + invite(b"") + message(11, b"") + join(b"a", 97, 0, 2) + join(b"b", 97, 0, 2) + join(b"", 0, 0, 2) + message(12, b"short"))
    put("worker_messages", linked + join(b"a", 97, 2, 2))
    put("worker_messages", front + invite(b"a") + join(b"a", 97, 0, 2))
    for kind in range(0, 14):  # too short, before an engine is open and after
        put("worker_messages", message(kind, b""))
        put("worker_messages", front + message(kind, b"ab"))
        put("worker_messages", front + message(kind, bytes(200), 1))
        put("worker_messages", front + message(kind, bytes(200), 4))
        put("worker_messages", front + message(kind, bytes(200), 8))
    put("worker_messages", front + message(5, b"", 2))
    put("worker_messages", front + message(5, b"abc", 2))
    put("worker_messages", bytes([0, 1, 0]) + bytes([0, 2, 1, 0, 0]) + bytes([0, 2, 0, 0, 0]))
    segment = lambda number, choice, content=b"": bytes([1, number, choice]) + text(content)
    target = lambda shape, formats=0: bytes([3, shape, 0, formats, 0, 0, 0])
    frame = lambda number, size=192, pictures=0: bytes([6, 1, number, 0, 0, 2 + pictures]) + struct.pack("<H", size)
    for shape in range(6):
        for formats in range(5):
            for staging in (0, 2, 3):  # each segment a second time, pinned and not
                put("worker_messages", front + segment(0, 0) + segment(1, staging) + target(shape, formats) + frame(1) + segment(1, 0) + frame(2) + segment(1, 1, struct.pack("<Q", 16384)) + frame(3) + bytes([2, 1, 0]) + bytes([7, 0, 0, 0, 0, 4, 4, 4, 0, 64]))
    put("worker_messages", front + segment(0, 0) + bytes([3, 0, 0, 0, 0, 0, 1]) + bytes([3, 0, 0, 0, 1, 0, 0, 9, 0, 0]) + bytes([3, 0, 0, 0, 0, 0, 2]) + bytes(8) + bytes([3, 0, 0, 0, 0, 3, 0]))


def owners(put, text):
    """Writes seeds of the answers that an engine's owner receives (tests/fuzz/worker/worker_answers_fuzz.cc)."""
    say = lambda *words: b"".join(bytes([w]) if isinstance(w, int) else w for w in words)
    ready, right = say(10, 0, 0, text(b"a device")), say(7, 0)
    target = lambda shape=0, sub_frames=0, form=0: say(0, shape, sub_frames, form)
    frame = lambda number, holds=0, off=0: say(3, number, holds, off)
    draw = lambda value, numbers, wrong=0: say(9, 0, value, bytes(numbers), wrong)
    delta, voxels, invite, join = say(1, 0, 7), say(4, 1, 64), say(5, text(b"a")), say(6, text(b"a"), 0, 2)
    none = say(12, 33, 0, 77, text(b""), 0)  # for a call that was never made
    front = ready + target() + right
    for shape, pictures in ((0, 4), (1, 4), (2, 4), (3, 1), (4, 4)):
        for sub_frames in (0, 1):
            for form in range(5):
                numbers = [1] * (pictures * (1 + sub_frames))
                put("worker_answers", ready + target(shape, sub_frames, form) + right + frame(1) + draw(7, numbers) + frame(2, 1) + draw(8, [2] + numbers[1:]))
    for how in range(8):  # with bulk memory
        put("worker_answers", front + say(13, how, 0, 7) + right + say(13, how ^ 3, 0, 7) + right + delta + right + say(14, 0) + say(2, text(b"ab"), 9) + delta)
    put("worker_answers", front + say(14, 95) + say(11, 3) + say(7, 9) + delta)
    put("worker_answers", front + delta + right + say(2, text(b"no delta"), 0) + voxels + right + invite + say(11, 0) + join + right + frame(1) + draw(3, [1] * 4))
    put("worker_answers", front + frame(1) + frame(2) + say(9, 1, 5) + bytes([2] * 4) + b"\0" + draw(4, [1] * 4) + frame(3, 2) + draw(5, [3, 2, 3, 2]))  # in another order
    for wrong in (1, 2):
        put("worker_answers", front + frame(1) + draw(3, [1] * 4, wrong) + delta)
    for off in range(1, 9):  # a buffer of another size
        put("worker_answers", front + frame(1, 0, off) + draw(3, [1] * 4))
    asked = {"open": b"", "target": ready + target(), "delta": front + delta, "frame": front + frame(1), "voxels": front + voxels, "invite": front + invite, "join": front + join}
    for what in asked.values():
        for answer in (right, say(8, 0, 15, text(b"lost")), say(8, 0, 3, text(b"refused")), say(8, 0, 200, text(b"")), ready, say(11, 0), say(9, 0, 1, bytes(4), 0), none, say(15, 0), say(15, 1)):
            put("worker_answers", what + answer + delta + right)
        for kind in (33, 34, 35, 32, 0, 1, 255):  # too short, with a descriptor, too long, and what is not a message
            for how in (0, 1, 2, 4):
                put("worker_answers", what + say(12, kind, 1, 0, text(b"ab"), how) + delta + right)
    put("worker_answers", ready + frame(1) + say(9, 0, 1, bytes(4), 0))  # before a target is set
    # for the previous target
    put("worker_answers", front + frame(1) + target(1) + say(7, 1) + draw(1, [1] * 4) + frame(2) + draw(2, [2] * 4))
    for kind in range(3):
        put("worker_answers", say(10, 0, kind, text(b"x" * 200)) + target() + right)


def viewers(put, text):
    say = lambda page, *messages: b"".join(bytes([3 | page << 3]) + text(m.encode() if isinstance(m, str) else json.dumps(m).encode()) for m in messages)
    show = b"\x01\x00\x01\x01\x01\xd0"
    draw = b"\x02\x01\x03"
    watch = lambda *ids, of="main": [{"watch": of, "id": i} for i in ids]
    compare = lambda number, **more: {"compare": number, **more}
    course = say(0, {"hello": True}, *watch(1), *watch(2, of="lights"), *watch(3, of="none"), {"watch": 5, "id": 4}, {"watch": "main"}, {"watch": "main", "id": 70000}, {"watch": "main", "id": -1}) + show + draw + show + say(
        0, {"shown": 1}, {"shown": 9}, {"shown": "a"}, {"dark": 1}, {"dark": 9}, {"dark": []}, compare(1), compare(1, without=[{"owner": "1", "layer": "a"}]), compare(2), compare(9), compare("a"), compare(1, without=5), compare(1, without=[5]),
        compare(1, without=[{"owner": 1, "layer": "a"}]), compare(1, without=[{"owner": "x", "layer": "a"}]), compare(1, without=[{"owner": "1", "layer": 2}]), compare(1, without=[{}] * 300)) + draw + show + b"\x83" + text(b'{"compare": 1}') + b"\x83" + text(
        b'{"compare": 1}') + say(0, {"unwatch": 1}, {"unwatch": "a"}, {"unwatch": 9}, {"stats": 1}, {"layers": 1}, {"stop": 1}, {"none": 1}, 5, "{", "")
    update = [{"update": u} for u in ({"name": "main", "brightness": 0.5}, {"name": "main", "brightness": 9}, {"name": "none", "brightness": 0.5}, {"name": "main"}, {"none": 1}, 5, {"name": "main", "blank": True}, {"name": "main", "view": {}},
                                      {"name": "main", "brightness": "NaN"}, {"name": "\ud800"})]
    clear = [{"clear": c} for c in ({"owner": "1", "layer": "a"}, {"owner": "9", "layer": "a"}, {"owner": "1", "layer": ""}, {}, [], {"owner": -1})]
    lost = say(0, *watch(1, 2)) + show + b"\x01\xf0" + say(0, {"shown": 1}, {"hello": 1}, {"stats": 1}) + b"\x00\x40\x01\xe0" + draw + show + say(0, {"shown": 1}, compare(1))
    for control in (b"\x00", b"\x01"):
        put("viewer_messages", control + course)
        put("viewer_messages", control + draw + say(0, *update, *clear))
        put("viewer_messages", control + lost)
        put("viewer_messages", control + say(0, *watch(*range(18))) + b"".join(say(page, *watch(*range(16))) for page in range(1, 5)), 8192)
        put("viewer_messages", control + say(1, *watch(1)) + show + b"\xfb" + text(b'{"hello": 1}') + b"\x8b" + text(b'{"compare": 1}') + b"\xfb" + text(b"{}") + show)


def states(put, _):
    """Writes seeds of files of the daemon's state, with rows of every kind (daemon/state/state_file.cc), and others that are not state files."""
    owner, thing, layer, entity = classes("KeptOwner", "KeptObject", "KeptLayer", "KeptEntity")
    read = lambda kind, line: text_format.Parse(line, kind()).SerializeToString()
    box = "primitive { box { size { x: 1 y: 1 z: 1 } } }"
    rows = [(1, 1, "", "", owner(token=b"0123456789abcdef").SerializeToString()), (1, 2, "", "", owner(hidden=True).SerializeToString()), (1, 3, "", "", b"\xff")]
    rows += [(2, 1, "a", "", read(thing, f"definition {{ parts {{ {box} }} }}")), (2, 9, "a", "", b""), (2, 1, "bad", "", b"\xff"), (2, 1, "none", "", b"")]
    rows += [(2, 1, name, "", read(thing, f'definition {{ parts {{ primitive {{ instance {{ object: "{of}" }} }} }} }}')) for name, of in (("b", "c"), ("c", "a"), ("d", "d"), ("e", "f"), ("f", "e"))]
    rows += [(3, 1, name, "", read(layer, f'info {{ layer: "{name}" number: {number} visible: true opacity: 255 client_name: "c" }}')) for name, number in (("l", 2), ("k", 1))]
    rows += [(3, 9, "l", "", b""), (3, 1, "bad", "", b"\xff"), (3, 1, "none", "", b"")]
    rows += [(4, 1, place, name, read(entity, f"entity {{ {what} }} {more}")) for place, name, what, more in (
        ("l", "x", box, ""), ("l", "y", box, "expires_unix_ns: 2000000000000000000"), ("l", "z", box, "expires_unix_ns: -5"), ("k", "x", 'primitive { instance { object: "b" } }', ""), ("none", "x", box, ""), ("l", "bad", "", ""))]
    rows += [(4, 1, "l", "bytes", b"\xff"), (0, 1, "", "", b""), (7, 1, "a\x01", "", b""), (1 << 40, 1, "", "", b"")]
    table = ("CREATE TABLE rows(kind INTEGER NOT NULL, owner INTEGER NOT NULL, name BLOB NOT NULL, id BLOB NOT NULL,bytes BLOB NOT NULL, PRIMARY KEY(kind, owner, name, id)) WITHOUT ROWID")

    def file(some, application=0x76786C64, version=1, table=table, more=""):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "state.db"
            database = sqlite3.connect(path)
            database.executescript(f"PRAGMA page_size=512; PRAGMA application_id={application}; PRAGMA user_version={version}; {table}; {more}")
            if some:
                database.executemany("INSERT INTO rows VALUES(?, ?, ?, ?, ?)", [(k, o, n.encode(), i.encode(), b) for k, o, n, i, b in some])
            database.commit()
            database.close()
            return path.read_bytes()

    whole = file(rows)
    for data in (whole, file(rows[:2]), file([]), file([], 0), file([], 0, table=""), file([], 5), file([], version=2), file([], table="CREATE TABLE rows(a)"), file([], table="CREATE TABLE other(a)"), file([], table="CREATE VIEW rows AS SELECT 1 AS kind"), file([], table=""),
                 file(rows, table=table.replace(" WITHOUT ROWID", "")), file(rows, table=table.replace("bytes BLOB", "bytes TEXT")), file([(4, i, "l", str(i), b"x" * 300) for i in range(20)]),
                 file([], more="CREATE TRIGGER t BEFORE INSERT ON rows BEGIN SELECT RAISE(ABORT, 'no'); END"), file([], more="CREATE TRIGGER t BEFORE DELETE ON rows BEGIN SELECT RAISE(ABORT, 'no'); END"),
                 file([], more="CREATE TRIGGER t AFTER INSERT ON rows BEGIN DELETE FROM rows; END"), file([], more="CREATE TRIGGER t AFTER INSERT ON rows BEGIN SELECT RAISE(ROLLBACK, 'no'); END"),
                 file([], table=table.replace("id BLOB NOT NULL,", "id BLOB NOT NULL CHECK(length(id) > 5),")), whole[:512], whole[:1000], whole[:-512], b"SQLite format 3", b"", b"none", whole[:100] + b"\xff" * 40 + whole[140:],
                 whole[:700] + b"\xff" * 20 + whole[720:], whole[:2000] + bytes(512) + whole[2512:]):
        put("state_file", data, 16384)


def devices(put, text):
    ask = lambda kind, request, value=0, length=4096: bytes([0, kind, request]) + struct.pack("<HH", value, length) + text(b"")
    begun = b"\x00\x02"
    usb = b"".join(ask(0x80, 6, value) for value in (0x0100, 0x0200, 0x0201, 0x0300, 0x0301, 0x0309, 0x0F00, 0x0700)) + b"".join(ask(*a) for a in ((0x80, 0), (0x81, 0), (0x82, 0), (0x80, 8), (0x81, 10), (0xC0, 0x20), (0xC0, 0x21), (0xC1, 1), (0xC1, 99), (0xC1, 1, 9)))
    set_ = b"".join(ask(*a) for a in ((0x00, 9, 1), (0x00, 9, 2), (0x00, 9, 0), (0x01, 11, 0), (0x01, 11, 1), (0x02, 1), (0x02, 3), (0x00, 5, 7), (0x41, 99), (0x41, 1)))
    for target in ("voxlink_device", "voxlink_firmware"):
        put(target, begun + usb + set_)
        put(target, b"\x00" + usb + set_ + b"\x02" + usb)


def hosts(put, _):
    """Writes seeds of a device that lies once, in each of the first things that it reports."""
    for holding in (0, 1):
        for at in range(16):
            tell = lambda *lie: put("voxlink_host", bytes([holding]) + bytes(at) + bytes(lie) + bytes(40) + bytes([0, 9, 2, 200, 9, 250]) + bytes(60))
            for status in range(7):
                tell(0x80, status)
            for word in range(19):
                for value in (0, 1, 5000, 30001, 0xFFFFFFFF):
                    tell(0xC0, word, *struct.pack("<I", value))
            tell(0xE0, 0x5C, 0)
            tell(0xE0, *bytes(60), 0x5C, 0)


def producers(put, text):
    """Writes seeds for the local socket: what is not a packet, and packets that go with it."""
    hello, release = b"\x00", lambda number: bytes([4, number])
    hold = lambda number, size, seals=0: bytes([1]) + struct.pack("<H", size) + bytes([number, seals])
    other = lambda choice, *more: bytes([7, choice, *more])
    raw = lambda packet, descriptors=0: b"\x06" + text(packet) + bytes([descriptors])
    put("local_packets", hello + hold(1, 4096) + other(0xC1) + other(0xC1) + release(1) + b"".join(hold(i, 4096) for i in range(1, 6)) + other(0xE0) + hold(6, 4096))
    put("local_packets", hello + b"".join(hold(i, 4096) + other(0xC0 + i) + release(i) for i in range(4)) + b"".join(hold(i, 4096) for i in range(4)) + other(0xE0) + hold(3, 4096))
    put("local_packets", hello + hold(1, 30000) + hold(2, 32000) + hold(3, 5000) + release(1) + hold(3, 5000) + other(0x00) + hello + hold(1, 100) + hold(1, 100))
    put("local_packets", other(0x90) + other(0x60) + hello + other(0x61) + other(0x70) + hello + other(0x71) + hello + other(0xA0, 40) + other(0x90))
    for count in (5, 40, 255):
        put("local_packets", other(0xA0, count) + hello + other(0xA0, count) + other(0x80) + other(0xA0, count))
    for packet in (hello, hold(1, 4096), release(1), raw(b"\x0a\x02ab", 1), raw(b"\x0a\x02ab", 2), raw(b"\x1a\x02\x08\x01", 1), raw(b"\x1a\x02\x08\x01", 2), raw(b"", 1), raw(b"\x0a\x10" + b"a" * 16), raw(b"\x7a\x00")):
        put("local_packets", hello + packet + packet)
        put("local_packets", other(0x40) + packet + hello + other(0x40) + packet + packet)
    put("local_packets", hello + raw(b"a" * 4097), 8192)  # longer than a packet may be
    put("local_packets", raw(b"\x0a\x00", 1) + raw(b"\x0a\x00", 2) + hello + raw(b"\x0a\x00", 1))
    for size, real in ((0, 0), (0, 50), (50, 0), (50, 100), (100, 100)):
        put("local_packets", hello + bytes([1]) + struct.pack("<H", size) + bytes([1, 0x80]) + struct.pack("<H", real))
    for seals in range(0x40, 0x60):
        put("local_packets", hello + hold(1, 4096, seals))
    put("local_packets", hello + bytes([3]) + struct.pack("<Q", 1 << 62) + bytes([1, 0]) + other(0x30) + hold(1, 64))


def assets(put, text):
    """Writes seeds of uploads, in memory, in a folder, and in a folder that is damaged or does not exist."""
    begin = lambda content, choice=0, *more: bytes([0, content, choice, *more])
    append = lambda upload, choice=0, size=8192, *more: bytes([2, upload, choice]) + struct.pack("<H", size) + bytes(more)
    finish, abandon = lambda upload=0: bytes([4, upload]), lambda upload=0: bytes([5, upload])
    wait = lambda choice, *more, time=0: bytes([6, choice, *more, time, 0])
    find = lambda content, offset=0, size=50: bytes([7, content, 0, offset]) + struct.pack("<H", size)
    whole = lambda content: begin(content) + append(0) + finish()
    for where in (0, 1, 0x80, 0x81):
        front = bytes([where])
        put("asset_uploads", front + whole(2) + find(2) + whole(2) + find(2, 99, 9) + find(3) + whole(0) + begin(2, 1, *bytes(8)) + begin(3, 1, 255, 255, 0, 0, 0, 0, 0, 0) + begin(3, 2, 7, 0, 0, 0, 0, 0, 0, 0))
        put("asset_uploads", front + begin(3) + append(0, 0, 100) + append(0, 2, 100, 9, 0, 0, 0, 0, 0, 0, 0) + append(0, 0, 0) + finish() + begin(3, 200) + append(0) + append(0, 1, 0) + text(b"too much") + finish() + find(3, 0, 4096))
        put("asset_uploads", front + begin(3) + append(0, 1, 0) + text(b"wrong") + finish() + begin(1) + append(0, 1, 0) + text(b"z") + finish() + find(1))
        put("asset_uploads", front + begin(2) + begin(2) + begin(3) + begin(4) + begin(5) + wait(99, time=90) + begin(5) + append(0) + finish() + append(1) + finish(1) + abandon() + abandon())
        put("asset_uploads", front + b"".join(whole(i) for i in (1, 2, 3, 4, 5)) + b"".join(find(i) for i in range(6)) + whole(5) + begin(5) + begin(4) + begin(3) + begin(2) + wait(99, time=40) + begin(1))
        put("asset_uploads", front + whole(3) + wait(20) + find(3) + wait(20) + whole(3) + begin(4) + append(0, 0, 100) + wait(20) + begin(4, 200) + append(0) + finish() + find(4))
        for how in (0, 1, 64, 65, 66, 31, 100, 130, 200):
            for file in (0, 1):
                put("asset_uploads", front + whole(3) + whole(4) + find(3) + wait(5, how, file, 9, 0) + find(3) + find(4) + whole(3) + whole(4) + find(3, 200, 4000))
                put("asset_uploads", front + whole(3) + begin(4) + append(0, 0, 100) + wait(40, how, file) + find(3) + find(3, 0, 4096) + append(0) + finish() + whole(3) + begin(2) + wait(40, how, file) + append(0) + finish() + begin(2) + append(0) + wait(40, how, file) + find(2))
                put("asset_uploads", front + whole(3) + wait(20) + wait(40, how, file) + whole(3) + begin(3) + find(3) + begin(5) + append(0, 0, 200) + abandon() + wait(40, how, file) + begin(5, 200) + append(0) + finish())


def sessions(put, text):
    for each in (devices, hosts, producers, assets, states, foxglove, lights, deltas, workers, owners, viewers):
        each(put, text)
