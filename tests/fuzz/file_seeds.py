"""Hand-written seeds for the readers of points, voxels and volumes: every format that they support, and each of their refusals. Like
shape_seeds.py."""
import gzip
import struct
import zlib


def vox(put):
    chunk = lambda name, body, children=b"": name + struct.pack("<II", len(body), len(children)) + body + children
    string = lambda s: struct.pack("<I", len(s)) + s
    words = lambda pairs: struct.pack("<I", len(pairs)) + b"".join(string(k) + string(v) for k, v in pairs)
    size = chunk(b"SIZE", struct.pack("<III", 2, 2, 2))
    voxels = chunk(b"XYZI", struct.pack("<I", 3) + bytes([0, 0, 0, 1, 1, 1, 1, 2, 0, 1, 0, 0]))
    palette = chunk(b"RGBA", bytes(range(256)) * 4)

    def move(number, child, frame=(), hidden=(), frames=1):
        return chunk(b"nTRN", struct.pack("<i", number) + words(list(hidden)) + struct.pack("<iiii", child, -1, 0, frames) + (words(list(frame)) if frames else b""))

    group = lambda number, *children: chunk(b"nGRP", struct.pack("<i", number) + words([]) + struct.pack("<I", len(children)) + struct.pack(f"<{len(children)}i", *children))
    shape = lambda number, *models: chunk(b"nSHP", struct.pack("<i", number) + words([]) + struct.pack("<I", len(models)) + b"".join(struct.pack("<i", m) + words([]) for m in models))
    tree = move(0, 1) + group(1, 2) + move(2, 3, [(b"_t", b"1 -2 3"), (b"_r", b"33")]) + shape(3, 0)
    sparse = chunk(b"SIZE", struct.pack("<III", 200, 200, 200)) + voxels
    for body in (size + voxels, size + voxels + palette, size + voxels + tree, sparse + tree, size, b"", voxels, size + chunk(b"XYZI", struct.pack("<I", 1) + bytes([2, 0, 0, 1])),
                 size + chunk(b"XYZI", struct.pack("<I", 9)), chunk(b"SIZE", struct.pack("<III", 0, 1, 1)), chunk(b"SIZE", b"\1"), size + voxels + chunk(b"RGBA", b"abc"),
                 size + voxels + chunk(b"MATL", b"abc"), size + voxels + chunk(b"a\1bc", b"")[:-2], size + voxels + b"n\1GR" + struct.pack("<II", 99, 0), size + voxels + b"nGRP",
                 size + voxels + move(0, 9), size + voxels + move(0, 0), size + voxels + move(0, 1, [(b"_t", b"1 2")]) + shape(1, 0), size + voxels + move(0, 1, [(b"_t", b"1 2 99999999")]),
                 size + voxels + move(0, 1, [(b"_r", b"5")]), size + voxels + move(0, 1, [(b"_r", b"x")]), size + voxels + move(0, 1, [], [(b"_hidden", b"1")]) + shape(1, 0),
                 size + voxels + move(0, 1) + shape(1, 9), size + voxels + move(0, 1, [], [], 0) + shape(1, 0), size + voxels + chunk(b"nTRN", b"\0")):
        put("import_binary", b"\x03VOX \x96\0\0\0MAIN" + struct.pack("<II", 0, len(body)) + body)
    put("import_binary", b"\x03VOX \x96\0\0\0MAIM" + bytes(20))


def pcd(put):
    head = lambda fields="x y z rgb", sizes="4 4 4 4", types="F F F U", counts="1 1 1 1", points="2", data="ascii", more="": (
        f"# .PCD v.7\nVERSION .7\nFIELDS {fields}\nSIZE {sizes}\nTYPE {types}\nCOUNT {counts}\n{more}WIDTH {points}\nHEIGHT 1\nPOINTS {points}\nDATA {data}\n").encode()
    row = struct.pack("<3fI", 1, 2, 3, 0x112233) + struct.pack("<3fI", 4, 5, 6, 0x445566)
    by_field = struct.pack("<2f2f2f2I", 1, 4, 2, 5, 3, 6, 0x112233, 0x445566)
    literal = b"".join(bytes([len(by_field[i:i + 32]) - 1]) + by_field[i:i + 32] for i in range(0, 32, 32))
    packed = struct.pack("<II", len(literal), 32) + literal
    mixed = "x y z intensity r g b a b2 c"
    files = [
        head() + b"1 2 3 4\n5 6 7 8\n", head() + b"nan 2 3 4\n5 6 7 8\n", head() + b"nan 2 3 4\n-nan NaN 7 8\n", head() + b"1 2 3\n", head() + b"1 2 x 4\n", head(types="F F F F") + b"1 2 3 4e-40\n5 6 7 8",
        head(data="binary") + row, head(data="binary") + row[:9], head(data="binary") + struct.pack("<3fI", float("nan"), 2, 3, 1) + row[:16], head(data="binary_compressed") + packed,
        head(data="binary_compressed") + packed[:6], head(data="binary_compressed") + struct.pack("<II", 33, 32) + b"\xff" * 33, head(data="binary_compressed") + struct.pack("<II", 1, 9999) + b"a",
        head(mixed, "8 8 8 4 1 1 1 1 2 8", "F F F F U U U I I I", "1 1 1 1 1 1 1 2 3 1", "1", "binary") + bytes(60),
        head("x y z r g b a c d", "2 2 2 4 4 4 2 8 4", "I I I F F F U U I", "1 1 1 1 1 1 1 1 1", "1", "binary") + bytes(40),
        head("x y z i", "1 1 1 8", "I U I I", "1 1 1 1", "1", "binary") + bytes(11), head("x y z i", "4 2 1 2", "I U F F", "1 1 1 1", "1", "binary") + bytes(11),
        head("x y", "4 4", "F F", "1 1") + b"1 2\n3 4", head(sizes="4 4 4"), head(sizes="4 4 4 3"), head(types="F F F X"), head(counts="0 1 1 1"), head(points="0"), head(points="a"),
        head(data="none"), head(points="99999999999"), head()[:60], b"FIELDS x y z\nPOINTS 1\nDATA ascii\n1 2 3", head(data="ascii", more="POINTS\n"), head("x y z rgba", data="ascii") + b"1 2 3 -4\n5 6 7 9e9\n",
        head(counts="1 1 1 2") + b"1 2 3 4 9\n5 6 7 8 9\n", b"COLUMNS x\tz\n" + b"\n" * 1001, b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 1\nDATA\n",
        head("x y z", "4 4 4", "F F F", "1 1 1", "1") + b"1e30 2 3"]
    for file in files:
        put("import_binary", b"\x00" + file)


def las(put):
    def file(form=0, record=20, count=2, minor=2, scale=1.0, offset=0.0, data=None, at=None, more=0, old=None):
        header = bytearray(375 if minor >= 4 else 227)
        header[:4], header[24], header[25] = b"LASF", 1, minor
        struct.pack_into("<HIIBHI", header, 94, len(header), len(header) if at is None else at, 0, form, record, count if old is None else old)
        struct.pack_into("<6d", header, 131, scale, 1, 1, offset, 0, 0)
        if minor >= 4:
            struct.pack_into("<Q", header, 247, count)
        return bytes(header) + (bytes((37 * i) % 128 for i in range(record * count + more)) if data is None else data)

    for form, record in enumerate((20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67)):
        put("import_binary", b"\x01" + file(form, record, minor=4))
        put("import_binary", b"\x01" + file(form, record, minor=4, data=bytes(2 * record)))
        put("import_binary", b"\x01" + file(form, record, minor=2, data=b"\xff" * (2 * record)))
    for other in (file(0x80), file(11), file(scale=0.0), file(scale=float("nan")), file(offset=float("inf")), file(record=19), file(count=0), file(at=9999), file(more=-5), file(scale=1e300), file()[:100],
                  file(record=0, count=1), file(2, 26, data=b"\1" * 19 + b"\0" + bytes([9, 0, 8, 0, 7, 0]) + bytes(26)), file(minor=4, old=0)):
        put("import_binary", b"\x01" + other)


def ply(put):
    head = lambda *lines, form="ascii": ("ply\nformat " + form + " 1.0\ncomment a\n" + "\n".join(lines) + "\nend_header\n").encode()
    xyz = ("property float x", "property float y", "property float z")
    colors = ("property uchar red", "property uchar green", "property uchar blue")
    normals = ("property float nx", "property float ny", "property float nz")
    files = [head("element vertex 1", *xyz) + b"1 2 +3\n", head("element vertex 1", *xyz, *colors, *normals) + b"1 2 3 4 5 6 0 0 1", head("element vertex 1", *xyz) + b"1 2 x", head("element vertex 1", *xyz) + b"1 2 inf",
             head("element face 1", "property list uchar int vertex_indices", "element vertex 1", *xyz) + b"3 0 1 2\n1 2 3\n", head("element face 1", "property list uchar int v", "element vertex 1", *xyz) + b"3 0 1 x y z w",
             head("element none 5", "element vertex 1", *xyz) + b"1 2 3\n", head("element vertex 1", *xyz, "property list char short l") + b"1 2 3 2 7 8\n", head("element vertex 1", *xyz, "property list char short l") + b"1 2 3 2 7\n",
             head("element vertex 0", *xyz), head("element vertex 1", *xyz[:2]), head("element vertex 99999999999", *xyz), head("element vertex 9", *xyz) + b"1", head("element vertex a"), head("property float x"),
             head("element vertex 1", "property none x"), head("element vertex 1", "property list float int x"), head("element vertex 1", "property a b c d e f"), head(form="none"), b"ply\nend_header\n", b"ply\nformat ascii 1.0\n",
             b"plo\n", b"ply", b"ply\n\nformat ascii 1.0\nelement vertex 1\nother\nend_header\n",
             head("element vertex 1", *xyz, "property char r", "property short g", "property int b", "property float x") + b"1 2 3 4 5 6 7\n",
             head("element vertex 1", *xyz, "property char diffuse_red", "property ushort diffuse_green", "property uint diffuse_blue", "property double q") + b"1 2 3 4 5 6 7\n",
             head("element vertex 1", *xyz, "property float red", "property double green", "property short blue", *normals) + b"1 2 3 nan 0.5 7 0 0 0\n"]
    for form, order in (("binary_little_endian", "<"), ("binary_big_endian", ">")):
        every = [f"property {t} {n}" for t, n in zip(("char", "uchar", "short", "ushort", "int", "uint", "float", "double"), ("a", "b", "c", "d", "x", "y", "z", "h"))]
        files.append(head("element vertex 1", *every, form=form) + struct.pack(order + "bBhHiIfd", 1, 2, 3, 4, 5, 6, 7, 8))
        files.append(head("element vertex 1", *every, form=form) + b"abc")
        files.append(head("element vertex 2", *xyz, "property list uchar int l", form=form) + struct.pack(order + "3fBi", 1, 2, 3, 1, 9) + struct.pack(order + "3fB", 1, 2, 3, 200))
        # As after a copy that replaced each CR LF by LF: a byte is lost before each 0x0A.
        row = lambda i: bytearray(struct.pack(order + "6f", i % 5, i % 4, i % 3, 0, 0, 1))
        text = head(*["comment"] * 110, "element vertex 40", *xyz, *normals, form=form)
        for lost in ((14,), (14, 18, 23), (0,), (39,)):
            for entry in (lambda r: r[:4] + b"\n" + r[6:], lambda r: r[:12] + b"\n" + r[15:], lambda r: b"\n" + r[2:], lambda r: r[:20]):
                body = b"".join(bytes(entry(row(i)) if i in lost else row(i)) for i in range(40))
                files.append(text + body)
        files += [text + body[:-300], text.replace(b"nz", b"no") + body, text.replace(b"float nz", b"int nz") + body, text.replace(b"property float nz", b"property list uchar float nz") + body]
    for file in files:
        put("import_binary", b"\x02" + file)


def nrrd(put):
    def file(data=bytes(range(64)), **fields):
        known = {"type": "uint8", "dimension": "3", "sizes": "2 2 2", "encoding": "raw"} | fields
        lines = [f"{k.replace('_', ' ')}: {v}" for k, v in known.items() if v is not None]
        return ("NRRD0005\n# note\nkey:=value\n" + "\r\n".join(lines) + "\r\n\r\n").encode() + data

    files = [file(), file(sizes="2 2"), file(sizes="2 2 a"), file(dimension="5"), file(dimension="2", sizes="4 4"), file(dimension="4", sizes="2 2 2 2"), file(dimension="4", sizes="3 2 2 2", kinds="RGB-color domain space ???"),
             file(dimension="4", sizes="4 2 2 2", kinds="RGBA-color domain domain domain"), file(dimension="4", sizes="2 2 2 0"), file(sizes="0 2 2"), file(sizes="99999999 99999999 99999999"), file(kinds="domain vector domain"),
             file(dimension="4", sizes="2 2 2 2", space_directions="none (1,0,0) (0,1,0) (0, 0, 1)"), file(space_directions="(1,0,0) (0,2,0) (0,0,3)", space="left-posterior-superior", space_origin="(1,2,3)"),
             file(space_directions="(1,0,0) none (0,0,3)"), file(space_directions="(1,0,0) (0,2,0)"), file(space_directions="1 2 3"), file(space_directions="(1,0,0,0) (0,1,0) (0,0,1)"), file(space_directions="(a,0,0) (0,1,0) (0,0,1)"),
             file(space="RAS", spacings="1 2 nan"), file(space="LAS"), file(space="right-anterior-superior"), file(spacings="1 a 1"), file(space_origin="1 2"), file(space_directions="(0,0,0) (0,0,0) (0,0,0)"),
             file(type="none"), file(type=None), file(encoding="bzip2"), file(encoding="hex"), file(type="short", endian="big"), file(type="float", endian="little"), file(type="short"), file(type="int", endian="middle"),
             file(type="float", encoding="txt", data=b"1 2,3 4\n5 6 7 nan 9"), file(encoding="ascii", data=b"1 2 x"), file(encoding="text", data=b"1 2"), file(encoding="gz", data=gzip.compress(bytes(8))),
             file(encoding="gzip", data=gzip.compress(bytes(4)) + gzip.compress(bytes(4))), file(encoding="gzip", data=gzip.compress(bytes(4))), file(encoding="gzip", data=gzip.compress(bytes(8))[:-9]), file(encoding="gzip", data=b"\x1f\x8b\x08zzzzzzzzzzzzzzz"),
             file(line_skip="1", data=b"a\n" + bytes(8)), file(line_skip="a"), file(byte_skip="-1"), file(byte_skip="-2"), file(byte_skip="2"), file(byte_skip="999"), file(byteskip="-1", data=b""), file(data=b"abc"), b"NRRD0001\ntype: uint8\n", b"none",
             file(line_skip="5", data=b"a"), file(dimension="4", sizes="2 2 2 2", kinds="domain domain domain list"), file(dimension="3", sizes="3 2 2", kinds="vector domain domain")]
    for kind in ("signed char", "uchar", "short int", "uint16_t", "int32", "unsigned int", "long long int", "int64", "ulonglong", "float", "double"):
        files.append(file(type=kind, endian="little", data=b"\x7f" * 64))
        files.append(file(type=kind, endian="big", data=b"\xff" * 64))
    for one in files:
        put("import_volumes", b"\x00" + one)


def nifti(put):
    def first(dim=(3, 2, 2, 2, 1, 1, 1, 1), kind=2, offset=352.0, slope=0.0, inter=0.0, magic=b"n+1\0", order="<", size=348, window=(0, 0), codes=(0, 0), data=bytes(128)):
        head = bytearray(352)
        struct.pack_into(order + "i", head, 0, size)
        struct.pack_into(order + "8h", head, 40, *dim)
        struct.pack_into(order + "hh", head, 70, kind, 8)
        struct.pack_into(order + "8f", head, 76, *[1.0] * 8)
        struct.pack_into(order + "3f", head, 108, offset, slope, inter)
        struct.pack_into(order + "2f", head, 124, *window)
        struct.pack_into(order + "2h", head, 252, *codes)
        struct.pack_into(order + "12f", head, 280, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0)
        head[344:348] = magic
        return bytes(head) + data

    def second(order="<", size=540, magic=b"n+2\0\r\n\x1a\n", kind=2, offset=544):
        head = bytearray(544)
        struct.pack_into(order + "i", head, 0, size)
        head[4:12] = magic
        struct.pack_into(order + "hh", head, 12, kind, 8)
        struct.pack_into(order + "8q", head, 16, 3, 2, 2, 2, 1, 1, 1, 1)
        struct.pack_into(order + "8d", head, 104, *[1.0] * 8)
        struct.pack_into(order + "q", head, 168, offset)
        struct.pack_into(order + "2i", head, 344, 1, 1)
        struct.pack_into(order + "12d", head, 400, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0)
        return bytes(head) + bytes(64)

    files = [first(kind=k, slope=2.0, inter=1.0, data=b"\x40" * 128) for k in (2, 4, 8, 16, 64, 128, 256, 512, 768, 1024, 1280, 2304, 1, 32)]
    files += [first(order=">"), first(size=9), first(order=">", size=9), second(), second(">"), second(size=9), second(">", size=9), second(magic=b"ni2\0\r\n\x1a\n"), second(magic=b"none....")[:600], first(magic=b"ni1\0"), first(magic=b"none"),
              first(dim=(0, 2, 2, 2, 1, 1, 1, 1)), first(dim=(3, 0, 2, 2, 1, 1, 1, 1)), first(dim=(5, 2, 2, 2, 2, 3, 1, 1)), first(dim=(7, 2, 2, 2, 32767, 32767, 32767, 32767)), first(dim=(3, 32767, 32767, 32767, 1, 1, 1, 1)), first(dim=(2, 2, 2, 1, 1, 1, 1, 1)),
              first(offset=1.0), first(offset=float("nan")), first(offset=1e12), first(window=(1, 5)), first(codes=(1, 0)), first(codes=(0, 1)), first(data=b"a"), first()[:100], gzip.compress(first()), gzip.compress(second()), gzip.compress(first(data=b"a")),
              gzip.compress(first())[:50], first(slope=float("inf")), gzip.compress(b"a"), first(offset=352.0, data=b"")]
    for one in files:
        put("import_volumes", b"\x03" + one)


def dicom(put):
    def element(tag, kind, value, order="<", explicit=True):
        group, number = tag >> 16, tag & 0xFFFF
        value += b" " * (len(value) % 2)
        if not explicit:
            return struct.pack(order + "HHI", group, number, len(value)) + value
        if kind in ("OB", "OW", "SQ", "UN", "UT"):
            return struct.pack(order + "HH", group, number) + kind.encode() + b"\0\0" + struct.pack(order + "I", len(value)) + value
        return struct.pack(order + "HH", group, number) + kind.encode() + struct.pack(order + "H", len(value)) + value

    undefined = lambda tag, kind, body, order="<": struct.pack(order + "HH", tag >> 16, tag & 0xFFFF) + kind + b"\0\0" + struct.pack(order + "I", 0xFFFFFFFF) + body
    item = lambda body, length=None, order="<": struct.pack(order + "HHI", 0xFFFE, 0xE000, len(body) if length is None else length) + body
    ends = lambda number, order="<": struct.pack(order + "HHI", 0xFFFE, number, 0)

    def file(syntax="1.2.840.10008.1.2.1", rows=2, columns=2, bits=8, stored=None, high=None, photometric="MONOCHROME2", samples=1, frames=None, more=b"", pixels=bytes(64), order="<", explicit=True, raw=None, deflate=False):
        e = lambda tag, kind, value: element(tag, kind, value, order, explicit)
        us = lambda n: struct.pack(order + "H", n)
        stored = bits if stored is None else stored
        body = e(0x0020000E, "UI", b"1.2") + e(0x00280002, "US", us(samples)) + e(0x00280004, "CS", photometric.encode()) + e(0x00280006, "US", us(1)) + more
        if frames is not None:
            body += e(0x00280008, "IS", frames)
        body += e(0x00280010, "US", us(rows)) + e(0x00280011, "US", us(columns)) + e(0x00280100, "US", us(bits)) + e(0x00280101, "US", us(stored)) + e(0x00280102, "US", us(stored - 1 if high is None else high)) + e(0x00280103, "US", us(1))
        body += raw if raw is not None else e(0x7FE00010, "OW", pixels) if pixels is not None else b""
        if deflate:
            packer = zlib.compressobj(9, zlib.DEFLATED, -15)
            body = packer.compress(body) + packer.flush()
        return bytes(128) + b"DICM" + element(0x00020010, "UI", syntax.encode() + b"\0") + body

    ds = lambda tag, text: element(tag, "DS", text)
    palette = lambda bits=8, count=2, size=2: b"".join(element(0x00281101 + i, "US", struct.pack("<HHH", count, 0, bits)) for i in range(3)) + b"".join(element(0x00281201 + i, "OW", bytes(size)) for i in range(3))
    jpeg = b"\xff\xd8\xff\xe0\0\4ab\xff\xc0\0\x11\x08\0\2\0\2\1" + bytes(8)
    jp2 = b"\xff\x4f\xff\x51" + bytes(4) + struct.pack(">IIII", 2, 2, 0, 0)
    packed = lambda *fragments: undefined(0x7FE00010, b"OB", item(b"") + b"".join(item(f) for f in fragments) + ends(0xE0DD))
    rle, j2k = "1.2.840.10008.1.2.5", "1.2.840.10008.1.2.4.90"
    deep = lambda n: b"" if n == 0 else undefined(0x00081140, b"SQ", item(deep(n - 1) + ends(0xE00D), 0xFFFFFFFF) + ends(0xE0DD))
    files = [file(), file("1.2.840.10008.1.2", explicit=False), file("1.2.840.10008.1.2.2", order=">"), file("1.2.840.10008.1.2.1.99", deflate=True), file("1.2.840.10008.1.2.1.99"), file(frames=b"2"), file(frames=b"x"), file(frames=b"999999999999"),
             file(rows=0), file(bits=12), file(bits=16, stored=12), file(bits=16, stored=12, high=15), file(bits=32), file(bits=1), file(stored=9), file(pixels=None), file(pixels=b"a"), file(photometric="RGB", samples=3), file(photometric="RGB"),
             file(photometric="YBR_FULL_422", samples=3), file(photometric="YBR_FULL_422", samples=3, columns=3), file(photometric="YBR_FULL", samples=3, bits=16), file(photometric="RGB", samples=3, bits=32), file(photometric="other"),
             file(photometric="PALETTE COLOR", more=palette()), file(photometric="PALETTE COLOR", more=palette(16, 2, 4)), file(photometric="PALETTE COLOR", more=palette(9)), file(photometric="PALETTE COLOR", more=palette(8, 0)), file(photometric="PALETTE COLOR"),
             file(photometric="PALETTE COLOR", more=palette(16, 2, 2)),
             file(more=ds(0x00200037, b"1\\0\\0\\0\\1\\0") + ds(0x00200032, b"0\\0\\0") + ds(0x00280030, b"1\\1") + ds(0x00180050, b"1") + ds(0x00180088, b"1") + ds(0x00281052, b"1") + ds(0x00281053, b"2") + ds(0x00281050, b"1") + ds(0x00281051, b"x") + ds(0x3004000C, b"0\\1")),
             file(more=element(0x00081140, "SQ", item(element(0x00280030, "DS", b"1\\1")))), file(more=element(0x00081140, "UN", item(b""))), file("1.2.840.10008.1.2", explicit=False, more=element(0x00081140, "SQ", item(element(0x00080060, "CS", b"CT", explicit=False)), explicit=False)),
             file(more=undefined(0x00081140, b"UN", item(element(0x00080060, "CS", b"CT", explicit=False)) + ends(0xE0DD))), file(more=deep(3)), file(more=deep(40)), file(more=undefined(0x00081140, b"SQ", b"abcdefgh")), file(more=undefined(0x00081140, b"SQ", item(b"ab", 9999))),
             file(raw=undefined(0x7FE00010, b"OB", item(b"", 0xFFFFFFFF))), file(raw=undefined(0x7FE00010, b"OB", b"abc")), file(j2k, raw=packed(jp2)), file(j2k, raw=packed(jpeg)), file(j2k, raw=packed(jpeg, b"more")), file(j2k, raw=packed()), file(j2k, rows=3, raw=packed(jp2)),
             file(rle, raw=packed(bytes(64))), file(rle, bits=16, photometric="RGB", samples=3, raw=packed(bytes(64))), file(rows=65535, columns=65535, frames=b"9"), file(raw=b"ab"), file(raw=struct.pack("<HH", 0x7FE0, 0x10) + b"OW\0\0"),
             file(raw=element(0x7FE00010, "OW", b"")[:-4] + struct.pack("<I", 99)), b"none", bytes(128) + b"DICM" + bytes(20)]
    for one in files:
        put("import_volumes", b"\x02" + one)


def files(put):
    for reader in (vox, pcd, las, ply, nrrd, nifti, dicom):
        reader(put)


def recordings(put, encode):
    """Writes seeds of MCAP files; `encode` makes bytes of a WatchSceneResponse's text."""
    string = lambda s: struct.pack("<I", len(s)) + s
    record = lambda kind, body: bytes([kind]) + struct.pack("<Q", len(body)) + body
    message = lambda body, number=0, channel=1: record(5, struct.pack("<HIQQ", channel, number, 5 + number, 5 + number) + body)
    chunk = lambda records, packing=b"", size=None, crc=0, body=None: record(6, struct.pack("<QQQI", 0, 9, len(records) if size is None else size, crc) + string(packing) +
                                                                             struct.pack("<Q", len(records if body is None else body)) + (records if body is None else body))
    magic = b"\x89MCAP0\r\n"
    head = record(1, string(b"") + string(b"seed")) + record(3, struct.pack("<H", 1) + string(b"voxeld.v1.WatchSceneResponse") + string(b"protobuf") + string(b"x"))
    head += record(4, struct.pack("<HH", 1, 1) + string(b"voxeld/scene") + string(b"protobuf") + struct.pack("<I", 14) + string(b"a") + string(b"bcdef"))
    box = 'primitive { box { size { x: 1 y: 1 z: 1 } } }'
    layer = lambda name, number, more="visible: true": f'layers {{ owner: 1 layer: "{name}" number: {number} opacity: 255 {more} }} '
    entity = lambda name, what=box, on="a": f'entities {{ info {{ key {{ owner: 1 layer: "{on}" id: "{name}" }} }} {what} }} '
    thing = lambda name, what=box: f'objects {{ key {{ owner: 1 object: "{name}" }} definition {{ parts {{ {what} }} }} }} '
    instance = lambda of: f'primitive {{ instance {{ object: "{of}" }} }}'
    first = (layer("a", 1, 'visible: true mask_layer: "b"') + layer("b", 2, "") + layer("c" * 70, 3) + thing("o") + thing("p", instance("o")) + thing("q", instance("q")) + entity("x") + entity("y", instance("p")) +
             entity("z", box, "b") + entity("w", box, "none") + "in_sync: 1")
    steps = [first, 'removed_entities { owner: 1 layer: "a" id: "x" } ' + layer("a", 9) + "in_sync: 2", thing("o") + "in_sync: 3",
             'removed_objects { owner: 1 object: "o" } removed_objects { owner: 1 object: "p" } removed_objects { owner: 1 object: "none" } in_sync: 4', 'removed_layers { owner: 1 layer: "a" } ' + layer("a", 10) + "in_sync: 5",
             'removed_layers { owner: 1 layer: "b" } in_sync: 6']
    told = [message(encode(step), i) for i, step in enumerate(steps)]
    end = record(15, bytes(4))
    whole = head + b"".join(told)
    for body in (whole + end, whole, head + chunk(b"".join(told)) + end, head + chunk(b"".join(told), crc=1), head + chunk(b"".join(told), crc=zlib.crc32(b"".join(told))) + end, head + chunk(b"abc", b"lz4"), head + chunk(b"abc", b"zstd"),
                 head + chunk(chunk(b"")), head + chunk(b"\5abc"), head + chunk(b"", size=1 << 40), head + record(6, b"abc"), head + record(3, b"a"), head + record(4, b"a"), head + record(5, b"a"), head + end,
                 head + message(b"\xff\xff"), head + message(encode(steps[1]), channel=7), head + b"\0" + bytes(8), head + b"\5" + b"\xff" * 8, head + b"\5" + struct.pack("<Q", 99), head + record(4, struct.pack("<HH", 1, 1) + string(b"voxeld/scene") + string(b"")
                 + struct.pack("<I", 99)), whole[:len(head) + 40], head + message(encode(layer("a", 1))) + told[1] + end, head + record(0x80, b"later") + told[0] + end,
                 head + chunk(b"".join(told), b"zstd", body=b"\x28\xb5\x2f\xfd\x24\x03\x19\x00\x00abc\x00\x00\x00\x00"), head + b"".join(told[i % 6] for i in range(40)) + end):
        put("mcap_file", magic + body, 16384)
    # An uncompressed block of zstd, without a checksum: as valid as any frame.
    plain = b"".join(told)
    frame = b"\x28\xb5\x2f\xfd\xa0" + struct.pack("<I", len(plain)) + struct.pack("<I", len(plain) << 3 | 1)[:3] + plain
    for packed in (frame, frame + b"\0", frame[:-9]):
        put("mcap_file", magic + head + chunk(plain, b"zstd", body=packed) + end, 16384)
    put("mcap_file", magic + head + chunk(plain, b"zstd", size=9, body=frame) + end, 16384)
    put("mcap_file", b"none of it", 16384)
    put("mcap_file", b"", 16384)
