"""Tests the writer of wire bytes against protobuf's own parser and writer."""
import random
import unittest
from typing import Any, Optional

import numpy as np

from voxeld import operations, wire
from voxeld.draw import Look
from voxeld.v1 import primitives_pb2, types_pb2
from voxeld.v1 import scene_pb2 as pb


def random_name(rng: random.Random) -> str:
    return "".join(rng.choice("abcäß火/ ") for _ in range(rng.choice([1, 5, 30, 130])))


def random_look(rng: random.Random) -> Look:
    matrix = np.eye(4)
    matrix[:3] += np.array([[rng.random() for _ in range(4)] for _ in range(3)])
    return Look(rng.choice([None, matrix]), rng.choice([0, 1, 126]), rng.random() < 0.5, rng.choice([None, 0.5, 3.0]),
                rng.choice(["", "label", "x" * 200]))


class Expected:
    """A primitive with vertices, and the same written by protobuf."""

    def __init__(self, rng: random.Random) -> None:
        numpy = np.random.default_rng(rng.randrange(1 << 30))
        count = rng.choice([1, 2, 3, 10, 42, 43, 127, 128, 1000, 20000])
        dtype, element = rng.choice([(np.float32, primitives_pb2.ELEMENT_TYPE_F32),
                                     (np.int16, primitives_pb2.ELEMENT_TYPE_I16),
                                     (np.int32, primitives_pb2.ELEMENT_TYPE_I32)])
        self.positions = numpy.integers(-99, 99, (count, 3)).astype(dtype)
        width = rng.choice([0, 3, 4])
        self.colors: Optional[Any] = numpy.integers(0, 256, (count, width), dtype=np.uint8) if width else None
        self.kind = rng.choice(["points", "segments", "mesh"])
        self.indices: Optional[Any] = None
        if self.kind == "mesh" and rng.random() < 0.7:
            self.indices = numpy.integers(0, count, (rng.choice([1, 50]), 3), dtype=np.uint32)
        vertices = primitives_pb2.Vertices(count=count, position_type=element, positions=self.positions.tobytes())
        if self.colors is not None:
            vertices.colors = self.colors.tobytes()
            vertices.color_type = {3: primitives_pb2.ELEMENT_TYPE_RGB8, 4: primitives_pb2.ELEMENT_TYPE_RGBX8}[width]
        if self.indices is not None:
            vertices.indices = self.indices.tobytes()
            vertices.index_type = primitives_pb2.ELEMENT_TYPE_U32
            vertices.index_count = self.indices.size
        self.message = primitives_pb2.Primitive()
        getattr(self.message, self.kind).vertices.CopyFrom(vertices)
        head = b""
        if self.kind == "segments":
            self.message.segments.topology = primitives_pb2.Segments.LOOP
            head = primitives_pb2.Segments(topology=primitives_pb2.Segments.LOOP).SerializeToString()
        before = b""
        if rng.random() < 0.5:
            self.message.color.rgb = 0xFF8040
            before = primitives_pb2.Primitive(color=primitives_pb2.Color(rgb=0xFF8040)).SerializeToString()
        key = wire.Field.KINDS[self.kind]
        self.packed = wire.vertices(self.positions, element, self.colors, self.indices).inside(
            wire.Field.VERTICES[self.kind], head).inside(key, before)


def expected_upsert(layer: str, id: str, look: Look, primitive: primitives_pb2.Primitive) -> pb.Upsert:
    upsert = pb.Upsert(layer=layer, id=id, entity=pb.Entity(
        priority=look.priority, erase=look.erase, lifetime_ns=look.lifetime_ns, label=look.label))
    if look.transform is not None:
        upsert.entity.transform.CopyFrom(types_pb2.Affine(m=look.transform[:3].ravel().tolist()))
    upsert.entity.primitive.CopyFrom(primitive)
    return upsert


class Writer(unittest.TestCase):
    def test_varints_are_protobufs(self) -> None:
        for value in (0, 1, 127, 128, 300, 16383, 16384, 1 << 21, 1 << 28, (1 << 32) - 1, (1 << 64) - 1):
            self.assertEqual(b"\x08" + wire.varint(value) if value else b"",
                             pb.Commit(frame_id=value).SerializeToString())

    def test_upserts_are_what_protobuf_would_have_written(self) -> None:
        rng = random.Random(1)
        for _ in range(300):
            case, look, layer, id = Expected(rng), random_look(rng), random_name(rng), random_name(rng)
            put = wire.put(layer, id, look.to_bytes(), case.packed)
            upsert = expected_upsert(layer, id, look, case.message)
            self.assertEqual(pb.StreamRequest.FromString(put.request), pb.StreamRequest(upsert=upsert))
            self.assertEqual(pb.Upsert.FromString(put.request[put.start:]), upsert)
            # Exactly as many bytes as protobuf writes: they differ only in the order of fields.
            self.assertEqual(len(put.request), pb.StreamRequest(upsert=upsert).ByteSize())

    def test_batches_hold_the_same_in_the_same_order(self) -> None:
        rng = random.Random(2)
        for _ in range(30):
            puts, expected = [], []
            for number in range(rng.choice([0, 1, 2, 100])):
                case, look = Expected(rng), random_look(rng)
                puts.append(wire.put("layer", f"id{number}", look.to_bytes(), case.packed))
                expected.append(expected_upsert("layer", f"id{number}", look, case.message))
            got = []
            for message in map(wire.together, wire.runs(puts)):
                request = pb.StreamRequest.FromString(message)
                if request.WhichOneof("op") == "batch":
                    self.assertLessEqual(len(message), wire.BATCH_BYTES + 16)
                    self.assertGreater(len(request.batch.upserts), 1)
                    got += request.batch.upserts
                else:
                    got.append(request.upsert)
            self.assertEqual(got, expected)

    def test_small_ones_share_messages(self) -> None:
        sphere = wire.message(primitives_pb2.Primitive(sphere=primitives_pb2.Sphere(radius=1)))
        puts = [wire.put("l", f"i{n}", Look(label="x" * 200).to_bytes(), sphere) for n in range(20_000)]
        total = sum(len(p.request) for p in puts)
        self.assertGreater(total, 4 << 20)
        self.assertLessEqual(len(list(wire.runs(puts))), total // (wire.BATCH_BYTES - wire.ALONE_BYTES) + 1)

    def test_a_servers_limit_bounds_batches(self) -> None:
        sphere = wire.message(primitives_pb2.Primitive(sphere=primitives_pb2.Sphere(radius=1)))
        puts = [wire.put("l", f"i{n}", Look(label="x" * (n % 200)).to_bytes(), sphere) for n in range(500)]
        for most in (400, 1024, 5000):
            messages = [wire.together(run) for run in wire.runs(puts, most)]
            self.assertLessEqual(max(map(len, messages)), most)
            self.assertGreater(max(map(len, messages)), most - 400)

    def test_a_lifetime_can_be_changed(self) -> None:
        rng = random.Random(3)
        for _ in range(50):
            case, look = Expected(rng), random_look(rng)
            changed = wire.put("l", "i", look.to_bytes(), case.packed, "o", look.lifetime_ns).with_lifetime(77)
            expected = expected_upsert("l", "i", look, case.message)
            expected.entity.lifetime_ns = 77
            self.assertEqual(pb.StreamRequest.FromString(changed.request), pb.StreamRequest(upsert=expected))
            self.assertEqual(pb.Upsert.FromString(changed.request[changed.start:]), expected)
            self.assertEqual((changed.uses, changed.lifetime_ns), ("o", 77))

    def test_objects_are_what_protobuf_would_have_written(self) -> None:
        rng = random.Random(4)
        for _ in range(50):
            cases = [Expected(rng) for _ in range(rng.choice([0, 1, 5]))]
            look = random_look(rng)
            part = primitives_pb2.Object.Part()
            if look.transform is not None:
                part.transform.CopyFrom(types_pb2.Affine(m=look.transform[:3].ravel().tolist()))
            definition = primitives_pb2.Object()
            for case in cases:
                own = definition.parts.add()
                own.CopyFrom(part)
                own.primitive.CopyFrom(case.message)
            got = operations.define("name", [
                case.packed.inside(wire.Field.PART_PRIMITIVE, part.SerializeToString()) for case in cases])
            self.assertEqual(pb.StreamRequest.FromString(got.request),
                             pb.StreamRequest(define_object=pb.DefineObject(object="name", definition=definition)))

    def test_a_payload_is_a_view(self) -> None:
        array = np.zeros((4, 3), np.float32)
        view = wire.payload(array)
        array[0, 0] = 1
        self.assertEqual(bytes(view[:4]), np.float32(1).tobytes())


if __name__ == "__main__":
    unittest.main()
