#!/usr/bin/env python3
"""Writes docs/primitives.md from what the wire contract, the engine's headers and the gallery's examples say.

    tools/primitives_doc.py            writes it
    tools/primitives_doc.py --check    exit status 1 if it is not what would be written
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROTO = ROOT / "proto/voxeld/v1/primitives.proto"
HEADERS = ROOT / "gpu/primitives"
EXAMPLES = ROOT / "tools/voxelctl/shape/examples.cc"
OUT = ROOT / "docs/primitives.md"

# The header of a primitive that is not called as its message.
# What headers say of a shape, if it is not the one that is called as the shape is.
_SOLID, _FIELD, _CURVE = ["solid.h", "solid_voxels.h"], ["../implicit/field.h"], ["../curves/cut.h"]
HEADERS_OF = {
    "Segments": ["segments.h", "line.h", "capsule.h"],
    "Mesh": ["triangle.h", "thick_triangle.h", "filled.h", "texture.h"],
    "Box": ["box.h", *_SOLID], "Sphere": ["sphere.h", *_SOLID], "Cylinder": ["cylinder.h", *_SOLID],
    "Implicit": ["implicit.h", *_FIELD],
    **{shape: [f"{shape.lower()}.h", *_FIELD]
       for shape in ("Ellipsoid", "Torus", "Cone", "Parallelepiped", "Disc", "Patch", "Polygon", "Arrow")},
    "HeightMap": ["../../daemon/wire/height_map.h", "triangle.h", "thick_triangle.h"],
    "Curve": ["spline.h", *_CURVE], "Arc": _CURVE, "Ellipse": _CURVE, "Helix": ["helix.h", *_CURVE],
    "BezierSurface": [*_CURVE, "triangle.h", "thick_triangle.h"],
    "Text": ["../../daemon/wire/text.h"],
    "Volume": ["samples.h"], "Isosurface": ["samples.h"],
    "Instance": [],
}

HEAD = """# Primitives

<!-- Written by tools/primitives_doc.py from proto/voxeld/v1/primitives.proto, gpu/primitives/ and the gallery's examples. -->

What can be drawn, by the name of its field in `Primitive`. Coordinates are in the entity's own space: its transform, its layer's and
the display's view follow. Lengths are in the entity's units unless said otherwise; colours 0xRRGGBB. Defaults are zero, or
what a field says. `voxelctl draw "SHAPE NAME=VALUE …"` takes the same names. Both engines cover the same voxels.

![Every shape, each as a display shows it](images/gallery.png)
"""


def comment_above(lines: list[str], at: int) -> str:
    begin = at
    while begin > 0 and lines[begin - 1].startswith("//"):
        begin -= 1
    return " ".join(line[2:].strip() for line in lines[begin:at])


def messages() -> dict[str, tuple[str, list[tuple[str, str, str]]]]:
    """Of each message at the top: what stands above it, and (type, name, comment) of each field."""
    lines = PROTO.read_text().split("\n")
    found = {}
    for i, line in enumerate(lines):
        start = re.match(r"message (\w+) \{", line)
        if not start:
            continue
        fields, above, depth = [], [], 1
        for inner in lines[i + 1:]:
            depth += inner.count("{") - inner.count("}")
            if depth == 0:
                break
            text = inner.strip()
            if text.startswith("//"):
                above.append(text[2:].strip())
                continue
            field = re.match(r"((?:repeated |optional )?[\w.]+) (\w+) = \d+;(?:\s*// (.*))?", text)
            if field and depth == 1:
                fields.append((field[1], field[2], " ".join([*above, field[3] or ""]).strip()))
            above = []
        found[start[1]] = (comment_above(lines, i), fields)
    return found


def enums() -> dict[str, list[tuple[str, str]]]:
    """By "Message.Enum", or "Enum" at the top: (value, comment) of each, as voxelctl takes them; what counts unless told, first."""
    owner, name, found, above = "", "", {}, []
    for line in PROTO.read_text().split("\n"):
        if start := re.match(r"message (\w+) \{", line):
            owner = start[1]
        elif line.startswith("}"):
            owner = ""
        text = line.strip()
        if start := re.match(r"enum (\w+) \{", text):
            name = f"{owner}.{start[1]}".lstrip(".")
            prefix = "" if owner else re.sub(r"(?<!^)(?=[A-Z])", "_", start[1]).upper() + "_"
            found[name] = []
        elif name and text == "}":
            name = ""
        elif name and text.startswith("//"):
            above.append(text[2:].strip())
        elif name and (value := re.match(r"(\w+) = \d+;(?:\s*// (.*))?", text)):
            found[name].append((value[1].removeprefix(prefix).lower(), " ".join([*above, value[2] or ""]).strip()))
            above = []
    return found


def words(values: list[tuple[str, str]]) -> str:
    """`a` unless told, `b` or `c`."""
    unless = values[0][1].lower()
    named = [f"`{value}`" + (" (unless told)" if value == unless else "") for value, _ in values[1:]]
    return ", ".join(named[:-1]) + " or " + named[-1]


def table(message: str, fields: list[tuple[str, str, str]], values: dict[str, list[tuple[str, str]]]) -> list[str]:
    """The fields of a message, and what its own words mean."""
    out, own = ["| field | type | |\n|---|---|---|"], []
    for kind, name, said in fields:
        of = values.get(f"{message}.{kind}", values.get(kind))
        if of and len(of) <= 8:
            named = words(of).replace(" (unless told)", "") if "UNSPECIFIED" in said else words(of)
            said = "; ".join(filter(None, [named, said]))
        if f"{message}.{kind}" in values:
            own += [f"- `{value}`: {comment}" for value, comment in values[f"{message}.{kind}"][1:] if comment]
        out.append(f"| `{name}` | {kind} | {said.replace('|', chr(92) + '|')} |")
    return [*out, "", *own, *([""] if own else [])]


def kinds() -> list[tuple[str, str]]:
    """(message, field) of each shape, in the wire's order."""
    body = re.search(r"message Primitive \{\s*oneof kind \{(.*?)\}", PROTO.read_text(), re.S)
    assert body
    return re.findall(r"(\w+) (\w+) = \d+;", body[1])


def guarantees(message: str) -> list[tuple[str, str]]:
    """(header, what it says) of each that says which voxels a shape covers."""
    found = []
    for name in HEADERS_OF.get(message, [f"{message.lower()}.h"]):
        path = (HEADERS / name).resolve()
        text = path.read_text().split("#pragma once")[0]
        said = "\n".join(line[2:].strip() for line in text.split("\n") if line.startswith("//"))
        found.append((str(path.relative_to(ROOT)), said))
    return found


def examples() -> dict[str, list[str]]:
    """By field: the gallery's texts."""
    text = EXAMPLES.read_text()
    body = text[text.index("kExamples[]"):text.index("std::span<const ShapeExample> ShapeExamples")]
    result: dict[str, list[str]] = {}
    for entry in re.finditer(r'\{("[^{}]*?")\}', re.sub(r'"\s*\n\s*"', "", body)):
        parts = re.findall(r'"((?:[^"\\]|\\.)*)"', entry[1])
        field = parts[0].split(" ")[0].rstrip(",")
        result.setdefault(field, []).append(parts[1])
    return result


def page() -> str:
    all_messages, values, shown = messages(), enums(), examples()
    out = [HEAD]
    pages: dict[str, str] = {}  # where a header's words stand
    for message, field in kinds():
        above, fields = all_messages[message]
        out.append(f"## {field}\n")
        if above:
            out.append(above + "\n")
        out += table(message, fields, values)
        elsewhere = []
        for path, said in guarantees(message):
            if path in pages:
                elsewhere.append(f"`{path}`, under [{pages[path]}](#{pages[path]})")
            else:
                pages[path] = field
                out.append(f"**What it covers** (`{path}`): {said}\n")
        if elsewhere:
            out.append(f"**What it covers**, as others do: {'; '.join(elsewhere)}.\n")
        for text in shown.get(field, []):
            shapes = " \\\n    ".join(f'"{shape}"' for shape in re.split(r"(?<!\\)\\n", text))
            out.append(f"```\nvoxelctl draw {shapes}\n```\n")
    out.append("## Types that several have\n")
    for message in ("Vertices", "Thickness", "Texture", "ColorScale", "Grid", "Transfer", "Expression", "Boundary"):
        above, fields = all_messages[message]
        out.append(f"### {message}\n\n{above}\n")
        if fields:
            out += table(message, fields, values)
    for name in ("Fill", "SurfaceRule", "LineSampling"):
        out.append(f"### {name}\n\n{words(values[name]).capitalize()}.\n")
        out += [*(f"- `{value}`: {comment}" for value, comment in values[name][1:] if comment), ""]
    out.append("[Expressions](expressions.md) have a page of their own; colour maps are those of "
               "`proto/voxeld/v1/colormaps.txt`.\n")
    return "\n".join(out)


def main() -> int:
    text = page()
    if sys.argv[1:] == ["--check"]:
        if OUT.read_text() == text:
            return 0
        print("docs/primitives.md is not what tools/primitives_doc.py writes; run it", file=sys.stderr)
        return 1
    OUT.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
