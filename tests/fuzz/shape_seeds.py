"""Hand-written seeds: files and texts in forms that real ones seldom have, including each reader's refusals. For make_seeds.py, which
passes
`put(target, bytes)`."""
import base64
import copy
import json
import pathlib
import struct
import subprocess

import file_seeds
import text_seeds

PROTO = pathlib.Path(__file__).resolve().parents[2] / "proto"


def model():
    """Returns a glTF document that has a little of everything."""
    data = struct.pack("<9f", *range(9)) + struct.pack("<4H", 0, 1, 2, 0) + bytes([0, 1, 2, 0]) + struct.pack("<3I", 0, 1, 2)
    return {
        "asset": {"version": "2.0"},
        "extensionsRequired": ["KHR_materials_unlit", 1],
        "buffers": [{"byteLength": len(data), "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}],
        "bufferViews": [{"buffer": 0, "byteLength": 36, "byteStride": 12}, {"buffer": 0, "byteOffset": 36, "byteLength": 8},
                        {"buffer": 0, "byteOffset": 44, "byteLength": 4}, {"buffer": 0, "byteOffset": 48, "byteLength": 12}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
                      {"bufferView": 2, "byteOffset": 1, "componentType": 5121, "count": 2, "type": "SCALAR"},
                      {"bufferView": 3, "componentType": 5125, "count": 3, "type": "SCALAR"},
                      {"componentType": 5120, "count": 1, "type": "MAT4", "sparse": {}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": i} for i in (1, 2, 3, 4)] + [{"attributes": {"POSITION": 0}}]}],
        "nodes": [{"mesh": 0, "children": [1]}, {}],
    }


def meshes(put):
    def change(*path_and_value):
        changed = copy.deepcopy(model())
        *path, last, value = path_and_value
        at = changed
        for step in path:
            at = at[step]
        if value is None:
            del at[last]
        else:
            at[last] = value
        return changed

    documents = [
        model(), [], {"asset": 1}, change("asset", "version", "1.0"), change("asset", "version", None), change("extensionsRequired", ["KHR_draco"]),
        change("extensionsRequired", None), change("buffers", {}), change("buffers", [1]), change("buffers", 0, "byteLength", None),
        change("buffers", 0, "byteLength", -1), change("buffers", 0, "byteLength", 999), change("buffers", 0, "uri", 5),
        change("buffers", 0, "uri", "data:,%"), change("buffers", 0, "uri", "no%20such%2"), change("bufferViews", None),
        change("bufferViews", 0, "buffer", 9), change("bufferViews", 0, "byteLength", 99), change("bufferViews", 0, "byteStride", 0),
        change("bufferViews", 0, "byteStride", 70000), change("accessors", 0, "componentType", 5124), change("accessors", 0, "componentType", 5122),
        change("accessors", 0, "type", "VEC9"), change("accessors", 0, "type", 3), change("accessors", 0, "count", 0),
        change("accessors", 0, "count", 1 << 39), change("accessors", 0, "count", 4), change("accessors", 2, "count", 1 << 12), change("accessors", 0, "bufferView", 9),
        change("meshes", 0, "primitives", 0, "attributes", None), change("meshes", 0, "primitives", 0, "attributes", "POSITION", 9),
        change("meshes", 0, "primitives", 0, "indices", 9), change("accessors", 0, "count", 2), change("nodes", 0, "children", 1),
        change("nodes", 0, "children", ["a"]), change("nodes", 0, "children", [9]), change("nodes", 1, "children", [1]),
        change("nodes", 1, "children", [0]), change("meshes", 0, "primitives", "none"), change("nodes", 0, "children", [0]), change("meshes", {"a": 1}),
    ]
    for document in documents:
        put("import_meshes", b"\x02" + json.dumps(document, separators=(",", ":")).encode())

    def glb(text, chunks=b"", version=2, length=None, kind=b"JSON", chunk=None):
        whole = struct.pack("<II", version, 20 + len(text) + len(chunks) if length is None else length)
        return b"\x03glTF" + whole + struct.pack("<I", len(text) if chunk is None else chunk) + kind + text + chunks

    text = json.dumps({"asset": {"version": "2.0"}, "buffers": [{"byteLength": 4}]}).encode()
    binary = lambda size: struct.pack("<I", size) + b"BIN\0abcd"
    for file in (glb(text, binary(4)), glb(text, binary(9)), glb(text), glb(text, version=1), glb(text, length=9999), glb(text, kind=b"BIN\0"),
                 glb(text, chunk=9999), b"\x03glTF\2\0", b"\x03solid", b"\x02glTF\2\0\0\0", b"\x02{", b"\x02\"a\""):
        put("import_meshes", file)
    for file in (b"v 1 2 3\nv 1 2 4\nv 3 \\\n 2 1\nf 1/1/1 2 -1 # and\nl 1 2\np 1\n", b"v 1 2\n", b"v 1\n", b"v\n", b"\xff\xfev", b"v 1 2 3\0", b"# none\n",
                 b"v 1 2 3\r\nf 1 2 3", b"v 1 2 3\nf x", b"f -1\nv 1 2 3\n", b"v 1 2 3\nf 0\n"):
        put("import_meshes", b"\x00" + file)
    triangle = struct.pack("<12fH", *range(12), 0)
    facet = b"facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
    for file in (bytes(80) + struct.pack("<I", 1) + triangle, bytes(80) + struct.pack("<I", 2) + triangle, bytes(80) + struct.pack("<I", 0),
                 bytes(84), bytes(20), b"solid a\n" + facet + b"endsolid a\n", b"solid a\n" + facet, b"solid a\n", b"solid" + bytes(75) + struct.pack("<I", 1) + triangle,
                 b"solid a\n" + facet[:40], bytes(80) + struct.pack("<I", 0xFFFFFFFF), b"", b"  solid a\nendsolid"):
        put("import_meshes", b"\x01" + file)
    for which, front in ((4, b"OFF\n"), (4, b"COFF"), (4, b"none"), (5, b"PK\3\4"), (5, b"PK"), (6, b"Kaydara FBX Binary"), (6, b"; FBX 7"), (6, b"x"),
                         (7, b"<COLLADA>"), (7, b"\xff\xfe<"), (7, b"<xml>")):
        put("import_meshes", bytes([which]) + front)


def layouts(put):
    for file in ("[]", "{", "{}", "[null,{}]", '[{"point":[0,0,0]},null,{"point":[1,0,0]}]', '[{"point":[0,0,0]},{"point":[0,0,0]}]', '[{"point":[0,0]}]',
                 '[{"point":[0,0,2e6]}]', '[{"point":["a",0,0]}]', "[1]", '[{"point":1}]', "[[[[[[]]]]]]", '[{"point":[0,0,1e3]}]',
                 "[" + ",".join(["null"] * 65) + "]", '["' + "a" * 80 + '"]'):
        put("layout", file.encode())
    for options in ("", "cube=2x2x2", "cube=4x4x4,order=zyx,serpentine=rows,reverse=true,flip=x;z,rotate=90", "order=xxy", "flip=a", "flip=x;x", "cube=9x9x9",
                    "cube=2x2x2,serpentine=rows_and_slices,rotate=270,per_strip=2,first=3,order=yxz", "cell_mm=1;2", "cell_mm=1;2;3,cube=2x2x2", "cell_mm=0",
                    "cell_mm=4,pitch_mm=9,cube=1x1x1", "cube=3x3x3,rotate=180,flip=y,serpentine=none", "pitch_mm=a", "per_strip=0", "rotate=45", "cube=2x2"):
        put("layout", b"=" + options.encode())


def displays(put):
    for options in (
            # planar
            "size=8x8x6", "size=8x8", "size=8x8x6x2", "size=0x8x8", "size=99999x1x1", "size=axb", "normal=y,size=4x4x4", "normal=x", "motion=sine,travel_mm=5,size=4x4x4",
            "motion=sawtooth,strokes=down,size=4x4x4,dead_begin=0.1,dead_end=0.1", "motion=sine,dead_begin=0.6,dead_end=0.6", "motion=sine,slice_pitch_mm=1", "travel_mm=1",
            "dead_begin=0.1", "strokes=both,size=4x4x4", "positions_mm=0;1;2,size=4x4", "positions_mm=0;1;2,size=4x4x3,strokes=both", "positions_mm=0;1,size=4x4x3",
            "positions_mm=0;1,strokes=down", "positions_mm=0;1,motion=sine", "positions_mm=0;a", "positions_mm=0;1e9", "mirror_u=true,mirror_v=false,size=4x4x4", "mirror_u=yes",
            "positions_mm=1;0,size=4x4", "positions_mm=0;0,size=4x4", "pitch_mm=0", "pitch_mm=2,slice_pitch_mm=1,size=4x4x4", "size=16384x16384x16384",
            "size=8192x8192x8,sub_frames=64", "format=rgb332,size=4x4x4", "format=bitplanes,bits=4,size=4x4x4", "format=hub75,bits=8,size=4x3x4", "format=planes24,size=4x4x4",
            "bits=9", "bits=3", "sub_frames=65", "sub_frames=4,size=4x4x4", "rate=0", "rate=60.5,size=4x4x4", "rate=a", "voxel_mm=2,size=4x4x4", "voxel_mm=1;2;3,size=4x4x4",
            "voxel_mm=1;2", "voxel_mm=0", "voxel_mm=1e-6,size=64x64x64",
            # tone
            "gamma=2.2,size=4x4x4", "gamma=1;2;3", "gamma=0", "white=1;0.9;0.8,brightness=0.5,size=4x4x4", "white=2", "brightness=2", "curve_red=0;0.2;1,size=4x4x4", "curve_green=0",
            "curve_blue=1;0", "curve_red=0;2", "dither=blue,sampling=weighted,density=even,size=4x4x4", "dither=x", "sampling=x", "density=x",
            "curve_red=" + ";".join(["0"] * 300),
            # rotor
            "geometry=rotor,size=8x8,slices=12", "geometry=rotor,size=8x8x8", "geometry=rotor,size=8x8,slices=12,clockwise=true,eccentricity=1;0,panel_phase=0;0.5,shift_u=0;1,shift_v=1;0,tilt=1;2",
            "geometry=rotor,eccentricity=1;0,panel_phase=0", "geometry=rotor,panel_phase=1", "geometry=rotor,eccentricity=" + ";".join(["0"] * 17),
            "geometry=rotor,size=8x8,slices=4,eccentricity=1;0,panel_pitch_u_mm=1;2,panel_pitch_v_mm=2;1,mirror_u=true;false,mirror_v=true", "geometry=rotor,mirror_u=true;false",
            "geometry=rotor,mirror_u=x", "geometry=rotor,slices=0", "geometry=rotor,tilt=99,size=8x8,slices=4", "geometry=rotor,keystone_mm=0;0;1;0;1;1;0;1",
            # helix
            "geometry=helix,size=8x8,slices=12", "geometry=helix,size=8x8,slices=8,blades=2,span=0.5,radius_mm=4,hub_mm=1,travel_mm=9,phase=0.5,left_handed=true,clockwise=true,mirror_u=true,mirror_v=true",
            "geometry=helix,blades=11", "geometry=helix,blades=2,span=1", "geometry=helix,hub_mm=9,radius_mm=1", "geometry=helix,phase=2",
            # lattice
            "geometry=lattice,size=2x2x2", "geometry=lattice,size=200x200x2", "geometry=lattice,points_mm=0;0;0;1;1;1,width=4", "geometry=lattice,points_mm=0;0",
            "geometry=lattice,points_mm=0;0;0,size=1x1x1", "geometry=lattice,width=4", "geometry=lattice,cell_mm=0", "geometry=lattice,points_mm=0;0;0;0;0;0", "geometry=sphere",
            # correction
            "affine=1;0;0;1;0;1;0;2;0;0;1;3,size=4x4x4", "affine=1;2", "affine=0;0;0;0;0;0;0;0;0;0;0;0,size=4x4x4", "keystone_mm=-2;-2;2;-2;2;2;-2;2,size=4x4x4",
            "keystone_mm=-2;-2;2;-2;2;2;-1;1,size=4x4x4", "keystone_mm=0;0;0;0;0;0;0;0,size=4x4x4", "keystone_mm=1;2,size=4x4x4",
            "geometry=helix,size=4x4,slices=4,keystone_mm=-2;-2;2;-2;2;2;-2;2",
            "displacement_mm=" + ";".join(["0"] * 24) + ",displacement_size=2x2x2,displacement_low_mm=-2;-2;-2,displacement_high_mm=2;2;2,size=4x4x4",
            "displacement_mm=1", "displacement_mm=1,displacement_low_mm=0;0;0", "displacement_mm=1,displacement_low_mm=0;0;0,displacement_high_mm=1;1;1",
            "displacement_mm=1;1;1,displacement_low_mm=0;0;0,displacement_high_mm=1;1;1,size=4x4x4", "none=1", "no\x01ne=1"):
        put("display_option", ("a=simulated," + options).encode())
    for text in ("", "a", "a=", "=simulated", "-a=simulated", "a" * 65 + "=simulated", "a=b,c", "a=b,=c", "a=b,c=1,c=2", "a=b,c=", "a_.-9=b"):
        put("display_option", text.encode())
    for text in ("title = 'a'\ndriver = 'simulated'\nrate = 30\nclockwise = true\ngamma = 2.5\ncurve = [0, 0.5, 1]\nnames = ['a', 'b']\n", "name = 'a'", "profile = 'a'",
                 "[table]\na = 1", "a = [[1]]", "a = 1979-05-27", "a = [1979-05-27]", "a = {b = 1}", "a = ", "\"a\\u0001\" = {}", "a = 1\na = 2", "a = 0x10\nb = 1e3\nc = inf", "a = []"):
        put("profile_text", text.encode())


def encode(line):
    return subprocess.run(["protoc", "-I", PROTO, "--encode=voxeld.v1.WatchSceneResponse", "voxeld/v1/scene.proto"], input=line.encode(), cwd=PROTO, capture_output=True,
                          check=True).stdout


def shapes(put):
    file_seeds.files(put)
    text_seeds.texts(put)
    file_seeds.recordings(put, encode)
    displays(put)
    meshes(put)
    layouts(put)
