"""Seeds of requests: of every kind that the wire has (tests/fuzz/wire/requests.txt), alone and one after another, each followed by a
commit; and the
same with one error each: each field in turn left out or with a wrong value. `tools/fuzz --merge` keeps the few that reach new code. Like
shape_seeds.py."""
import functools
import pathlib
import re
import struct
import subprocess
import tempfile

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, text_format

ROOT = pathlib.Path(__file__).resolve().parents[2]
NOT_A_NUMBER, INFINITE = float("nan"), float("inf")


@functools.cache
def pool():
    """Returns the descriptors of proto/."""
    with tempfile.TemporaryDirectory() as folder:
        described = pathlib.Path(folder) / "set"
        files = sorted(str(p.relative_to(ROOT / "proto")) for p in ROOT.glob("proto/voxeld/v1/*.proto"))
        subprocess.run(["protoc", "-I", ROOT / "proto", "--include_imports", f"--descriptor_set_out={described}", *files], check=True)
        found = descriptor_pb2.FileDescriptorSet.FromString(described.read_bytes())
    made = descriptor_pool.DescriptorPool()
    for file in found.file:
        made.Add(file)
    return made


@functools.cache
def classes_of():
    return getattr(message_factory, "GetMessageClass", None) or message_factory.MessageFactory(pool()).GetPrototype


def classes(*names):
    return [classes_of()(pool().FindMessageTypeByName(f"voxeld.v1.{n}")) for n in names]


def lines(all_=False):
    """Returns the lines whose fields are to be made wrong in turn, or all."""
    text = (ROOT / "tests/fuzz/wire/requests.txt").read_text()
    if not all_:
        text = text[:text.index("# Refusals")]
    return [re.sub("@([0-9]+)@", lambda m: r"\000" * int(m[1]), l) for l in text.splitlines() if l and not l.startswith("#")]


def wrong_values(field, value):
    """Returns other values for one field (for a repeated one, for an element)."""
    kind = field.type
    if kind in (field.TYPE_DOUBLE, field.TYPE_FLOAT):
        huge = 3e38 if kind == field.TYPE_FLOAT else 1e300
        return [NOT_A_NUMBER, -INFINITE, 0.0, 1.0, -value, -1.0, huge, 1e-30, 5000.0, 1e8]
    if kind == field.TYPE_ENUM:
        return [v.number for v in field.enum_type.values] + [99]
    if kind == field.TYPE_BOOL:
        return [not value]
    if kind == field.TYPE_STRING:
        return ["", "a" * 300, "b", "a\x01" + value, value + " " + value, value + "(", "viridis_r", "1/0", "\u05d0\u0301\U0001f600", (value + "\n") * 3]
    if kind == field.TYPE_BYTES:
        bad = struct.pack("<f", NOT_A_NUMBER)
        return [b"", value[:-1], value[:-4], value + b"\0", value * 2, value + value[:4], bad + value[4:], value[:-4] + bad, b"\xff" * len(value), b"\x7f" * len(value), b"\0\0\x80\x7f" + value[4:], bytes(len(value))]
    signed = kind in (field.TYPE_INT32, field.TYPE_SINT32, field.TYPE_INT64, field.TYPE_SINT64, field.TYPE_SFIXED32, field.TYPE_SFIXED64)
    bits = 64 if "64" in str(field.GetOptions()) or kind in (field.TYPE_INT64, field.TYPE_UINT64, field.TYPE_FIXED64, field.TYPE_SINT64, field.TYPE_SFIXED64) else 32
    return [0, 1, 2, value + 1, max(value - 1, 0), value * 2, 5, 127, 300, 70000] + ([-1, -(1 << bits - 1), (1 << bits - 1) - 1, 7 << bits - 4] if signed else [(1 << bits) - 1, 1 << bits - 1])


def one(field):
    """Returns a value for a field that was not set."""
    return {field.CPPTYPE_STRING: b"abcd" if field.type == field.TYPE_BYTES else "x", field.CPPTYPE_DOUBLE: 2.0, field.CPPTYPE_FLOAT: 2.0, field.CPPTYPE_BOOL: True}.get(field.cpp_type, 2)


def spoilt(root, at=None):
    """Yields `root`'s bytes with each of its fields made wrong in turn; `at`: a message within it."""
    at = root if at is None else at
    for field in at.DESCRIPTOR.fields:
        repeated = field.label == field.LABEL_REPEATED
        kept = type(at)()
        kept.CopyFrom(at)

        def tried(change):
            try:
                change()
            except (ValueError, TypeError):  # out of the field's range
                at.CopyFrom(kept)
                return None
            made = root.SerializeToString()
            at.CopyFrom(kept)
            return made

        if repeated:
            values = getattr(at, field.name)
            if len(values) == 0:
                if field.message_type is None:
                    yield tried(lambda: getattr(at, field.name).extend([one(field)] * 3))
                else:
                    yield tried(lambda: getattr(at, field.name).add())
                continue
            yield tried(lambda: at.ClearField(field.name))
            for times in (1, 60, 300):
                yield tried(lambda: getattr(at, field.name).extend(list(getattr(kept, field.name)) * times))
            yield tried(lambda: getattr(at, field.name).__delitem__(0))
            yield tried(lambda: getattr(at, field.name).__delitem__(-1))
            if field.message_type is not None:
                for i in range(min(len(getattr(at, field.name)), 2)):
                    yield from spoilt(root, getattr(at, field.name)[i])
                continue
            for i in {0, len(values) - 1}:
                for value in wrong_values(field, values[i]):
                    yield tried(lambda: getattr(at, field.name).__setitem__(i, value))
            continue
        if field.message_type is not None:
            if at.HasField(field.name):
                yield tried(lambda: at.ClearField(field.name))
                yield tried(lambda: getattr(at, field.name).Clear() or getattr(at, field.name).SetInParent())
                yield from spoilt(root, getattr(at, field.name))
            elif field.containing_oneof is None:
                yield tried(lambda: getattr(at, field.name).SetInParent())
                for inner in field.message_type.fields:
                    if inner.label != inner.LABEL_REPEATED and inner.message_type is None:
                        for value in (1, 300) if inner.cpp_type in (inner.CPPTYPE_UINT32, inner.CPPTYPE_UINT64, inner.CPPTYPE_ENUM) else (one(inner),):
                            yield tried(lambda: setattr(getattr(at, field.name), inner.name, value))
            continue
        unset = not at.HasField(field.name) if field.has_presence else getattr(at, field.name) == field.default_value
        if unset and field.containing_oneof is not None:
            continue
        for value in [one(field), *wrong_values(field, getattr(at, field.name))]:
            yield tried(lambda: setattr(at, field.name, value))


def requests(put, text):
    [request] = classes("StreamRequest")
    parse = lambda line: text_format.Parse(line, request())
    commit = b"\x08" + text(parse("commit { frame_id: 1 }").SerializeToString()) + b"\x00"
    good = [parse(line) for line in lines(all_=True)]
    # Payloads that are large enough not to be copied with the message.
    zeros = lambda size: "\\000" * size
    for kind in (f'points {{ vertices {{ count: 300 position_type: ELEMENT_TYPE_F32 positions: "{zeros(3600)}" color_type: ELEMENT_TYPE_RGB8 colors: "{zeros(900)}" }} }}',
                 f'mesh {{ vertices {{ count: 300 position_type: ELEMENT_TYPE_I16 positions: "{zeros(1800)}" index_type: ELEMENT_TYPE_U16 index_count: 300 indices: "{zeros(600)}" }} }}'):
        good.append(parse(f'upsert {{ layer: "a" id: "large" entity {{ primitive {{ {kind} }} }} }}'))
        good.append(parse(f'batch {{ upserts {{ layer: "a" id: "large" entity {{ primitive {{ {kind} }} }} }} }}'))
        good.append(parse(f'define_object {{ object: "o" definition {{ parts {{ primitive {{ {kind} }} }} }} }}'))
    message = lambda request: b"\x08" + text(request.SerializeToString()) + b"\x50"
    for request_ in good:
        put("store", message(request_) + commit, 12288)
    kinds = [message(r) for r in good if r.WhichOneof("op") != "open"]
    for at in range(0, len(kinds), 12):
        put("store", b"".join(m + commit for m in kinds[at:at + 12]), 16384)
    put("store", b"".join(message(r) + commit for r in good if r.WhichOneof("op") not in ("open", "upsert")), 16384)
    wrong(put, text, parse, commit)
    scenes(put, text, parse)


def scenes(put, text, parse):
    """Requests that a scene refuses from any client: quotas, depths, transforms, frames. From two clients, one of which may not erase."""
    say = lambda client, *what: b"".join(bytes([8 | client]) + text(parse(line).SerializeToString()) + b"\x00" for line in what)
    commit = "commit { frame_id: 1 }"
    sphere = "primitive { sphere { radius: 1 } }"
    upsert = lambda name, what=sphere, layer="a": f'upsert {{ layer: "{layer}" id: "{name}" entity {{ {what} }} }}'
    of = lambda name: f'primitive {{ instance {{ object: "{name}" }} }}'
    define = lambda name, *parts: f'define_object {{ object: "{name}" definition {{ {" ".join(f"parts {{ {p} }}" for p in parts)} }} }}'
    matrix = lambda n: f"transform {{ m: [{n},0,0,0, 0,{n},0,0, 0,0,{n},0] }}"
    state = lambda more, layer="a": f'layer_state {{ layer: "{layer}" {more} }}'
    letters = lambda number: upsert(f"t{number}", f'primitive {{ text {{ text: "{"".join(chr(97 + (number * 7 + i) % 26) for i in range(14))}" height: 1 depth: 0.5 }} }}')
    many = define("m", *[sphere] * 16)
    for strict in ((), ("open { strict: true }",)):
        for client in (0, 1):
            front = say(client, *strict)
            for course in (
                    [*[upsert("x", layer=f"l{i}") for i in range(14)], commit], [many, *[upsert(f"i{i}", of("m")) for i in range(14)], commit], [letters(i) for i in range(5)] + [commit] + [letters(i) for i in range(5, 12)] + [commit] + [letters(i) for i in range(12, 20)] + [commit],
                    [define("1", sphere), *[define(str(i), of(str(i - 1))) for i in range(2, 8)], commit], [define("1", of("1")), commit], [define("1", of("none")), commit], [define("2", sphere), define("1", of("2")), define("2", of("1")), commit],
                    [define("1", sphere), *[define(str(i), of(str(i - 1)) + " " + matrix("1e150")) for i in range(2, 6)], commit], [define("1", sphere), upsert("x", of("1")), commit, *[define("1", *[sphere] * 16)], commit],
                    [define("1", sphere), *[upsert(f"i{i}", of("1")) for i in range(40)], commit, define("1", *[sphere] * 16), commit], [define("1", sphere), upsert("x", of("1") + matrix("1e30")), commit, define("1", sphere + matrix("1e30")), commit],
                    [define("1", sphere), define("2", of("1"), of("1")), upsert("x", of("2")), commit, 'delete_object { object: "1" }', commit, 'delete_object { object: "1" cascade: true }', commit, 'delete_object { object: "1" }', commit],
                    [state(matrix("1e200")), upsert("x", sphere + matrix("1e200")), commit], [upsert("x", sphere + matrix("1e30")), commit, state(matrix("1e30")), commit], [upsert("x"), commit, 'set_transform { layer: "a" id: "x" transform { m: [1e38,0,0,0, 0,1e38,0,0, 0,0,1e38,0] } }', commit],
                    [state("blend: BLEND_MODE_ERASE"), commit], [upsert("x", sphere + " erase: true"), commit], ['frame_begin { layer: "a" }', 'frame_begin { layer: "a" }', upsert("x"), 'frame_end { layer: "a" }', 'frame_end { layer: "a" }', commit], ['frame_begin { layer: "a" }', upsert("x"), commit],
                    ['frame_begin { layer: "a" }', upsert("x", of("none")), 'frame_end { layer: "a" }', commit], [*[upsert("x", layer=f"l{i}") for i in range(12)], 'frame_begin { layer: "more" }', upsert("x", layer="more"), 'frame_end { layer: "more" }', state("visible: true", "more2"), commit],
                    [upsert(f"{i}") for i in range(150)] + [commit], [state('mask_layer: "a"'), state('mask_layer: "b"'), state('mask_layer: "a"', "b"), commit]):
                put("store", front + say(client, *course), 16384)
                # Within the quotas that an operator has set, in few and in small requests; and beside another's.
                put("store", front + bytes([4 | client, 6]) + say(client, *course), 16384)
                put("store", front + bytes([4 | client, 4]) + say(client, *course), 16384)
                both = say(client, *course) + say(1 - client, *course)
                put("store", front + both, 16384)
    update, = classes("ApplyUpdateRequest")
    asked = lambda *what, **opened: text(update(operations=[parse(l) for l in what], **opened).SerializeToString())
    put("store", b"\x06" + asked(*[upsert(str(i)) for i in range(130)]), 16384)
    named = [l for l in lines() if "_in {" in l]
    opened = parse('open { resume_token: "0123456789abcdef" }').open
    put("store", b"\x06" + asked(upsert("x"), open=opened))
    for line in (*named, *[l for l in lines(all_=True) if "text {" in l][:3]):
        for how in (b"\x06", b"\x86"):
            put("store", how + asked(line), 16384)


def wrong(put, text, parse, commit):
    update, entity, thing, layer, owner = classes("ApplyUpdateRequest", "KeptEntity", "KeptObject", "KeptLayer", "KeptOwner")
    # The objects, layers and entities that exist before.
    before = b"".join(b"\x08" + text(parse(line).SerializeToString()) + b"\x00" for line in (
        'define_object { object: "p" definition { parts { primitive { box { size { x: 1 y: 1 z: 1 } } } } } }',
        'define_object { object: "o" definition { parts { primitive { instance { object: "p" } } } } }',
        'upsert { layer: "a" id: "x" entity { primitive { instance { object: "o" } } } }')) + commit
    for line in lines():
        good = parse(line)
        kind = good.WhichOneof("op")
        for bytes_ in spoilt(good):
            if bytes_ is None:
                continue
            front = before if kind in ("set_transform", "delete", "delete_object", "define_object", "layer_state") else b""
            put("store", front + b"\x08" + text(bytes_) + b"\x50" + commit, 16384)
        if kind == "upsert":
            put("kept_rows", b"\x03\x00" + entity(entity=good.upsert.entity).SerializeToString(), 8192)
        if kind == "define_object":
            put("kept_rows", b"\x02\x00" + thing(definition=good.define_object.definition).SerializeToString(), 8192)
        if kind not in ("open", "commit"):
            put("store", b"\x06" + text(update(operations=[good]).SerializeToString()), 16384)
    whole = update(operations=[parse(l) for l in lines()[10:14]])
    whole.open.client_name = "c"
    for bytes_ in spoilt(whole):
        if bytes_ is not None:
            put("store", b"\x06" + text(bytes_), 16384)
    for number, kept in ((0, owner(token=b"0123456789abcdef", principal="a", hidden=True, max_bytes=5, max_entities=6)),
                         (2, thing(definition=parse(lines()[17]).define_object.definition)),
                         (3, entity(entity=parse(next(l for l in lines() if "lifetime_ns" in l)).upsert.entity, expires_unix_ns=1_700_000_001_000_000_000))):
        for bytes_ in spoilt(kept):
            if bytes_ is not None:
                put("kept_rows", bytes([number, 0]) + bytes_, 8192)
    info = text_format.Parse('info { owner: 1 layer: "a" number: 3 visible: true opacity: 255 order: -2 blend: BLEND_MODE_ADD mask_layer: "b" clip { planes { a: 1 d: 1 } } '
                             'region { min { x: -1 y: -1 z: -1 } max { x: 1 y: 1 z: 1 } } transform { m: [2,0,0,0, 0,2,0,0, 0,0,2,1] } }', layer())
    for bytes_ in spoilt(info):
        if bytes_ is not None:
            put("kept_rows", b"\x01\x00" + bytes_, 8192)
