#!/usr/bin/env python3
"""Writes docs/primitives.md from the comments of the wire contract and the engine's headers, and from the gallery's examples.

    tools/primitives_doc.py            writes it
    tools/primitives_doc.py --check    exit status 1 if it is not what would be written
"""
import pathlib
import re
import sys
import textwrap

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROTO = ROOT / "proto/voxeld/v1/primitives.proto"
HEADERS = ROOT / "gpu/primitives"
EXAMPLES = ROOT / "tools/voxelctl/shape/examples.cc"
OUT = ROOT / "docs/primitives.md"
PICTURES = "images/primitives"

# The headers that describe a shape, if they are not named after it.
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
# Within rims, a distance other than the general method's counts.
FLAT = ("Disc", "Patch", "Polygon")

# Unit and default by type, for fields that give none in brackets.
BY_TYPE = {
    "Vertices": ("–", "needed"), "Grid": ("–", "needed"),
    "Thickness": ("voxels or length", "0: one voxel"),
    "bool": ("–", "false"),
}
# Descriptions of fields without one, by name.
BY_NAME = {"shell": "how thick the surface is", "thickness": "how thick it is"}

HEAD = """# Primitives

<!-- Written by tools/primitives_doc.py from proto/voxeld/v1/primitives.proto, gpu/primitives/ and the gallery's examples. -->

All shapes, by their field in `Primitive`. Coordinates are in the entity's own space, before its transform, its layer's and
the display's view. Both engines cover the same voxels. `voxelctl draw "SHAPE NAME=VALUE …"` takes the same names, and for
every shape

| also | unit | default | |
|---|---|---|---|
| `color` | 0xRRGGBB | white | for everything without colours of its own; `#rrggbb` or a plain name |
| `color_scale` | – | none | colours by numbers: [ColorScale](#colorscale) |
| `scale` | times | 1, 1, 1 | along each axis, first |
| `turn` | degrees | 0, 0, 0 | about x, then y, then z |
| `at` | length | 0, 0, 0 | translation, last |
| `priority` | 0 to 126 | 0 | the higher shows where several cover a voxel |
| `erase` | – | false | removes lower or equal priorities in its layer |
| `lifetime` | seconds | unlimited | |
| `label` | – | as it was typed | for people |

On the command line a vector is `x,y,z`, or one number for all three; a box `x,y,z:x,y,z`; vertices `x,y,z x,y,z …`; values with spaces
are quoted; a thickness is in voxels, or in the shape's units with `u` (`shell=0.16u`); an enumeration is its last word (`fill=solid`);
a colour `#rrggbb` or a name; a picture the path of a PNG or JPEG file, or `base64:` and its bytes; grids and heights are their numbers,
or `file:` and the path of a little-endian raw file, of the type given (`grid.type=u8`); a boundary is its axis, form and vertices
(`y b_spline 1,0,0 …`). Counts and element types of vertices are derived.

**Units.** A *length* is in the entity's own units; the length of a *direction* does not matter; *voxels* are the display's.
*0 to 1* and the like are ranges, other words counts; – has none. A shape without a *needed* field is refused. Tests check each
**guarantee**; h is half of a shell's thickness, in voxels. `voxelctl gallery` made the pictures, of a display of 128³ voxels.

![Every shape, each as a display shows it](images/gallery.png)
"""


BESIDE = """## Beside shapes

`voxelctl draw` accepts these, too, in any order; each is a message of
[scene.proto](../proto/voxeld/v1/scene.proto).

| | |
|---|---|
| `object NAME: SHAPE …` | a part of an object; `instance object=NAME` draws it |
| `mask: SHAPE …` | other shapes are visible only in voxels that these cover; these are invisible |
| `clip_plane a= b= c= d=` | cuts off where a·x + b·y + c·z + d < 0 |
| `clip_box size=x,y,z` | cuts off everything outside the box; also `center`, and `scale`, `turn` and `at` as of shapes |
| `clip_cylinder start=x,y,z end=x,y,z radius=` | cuts off everything outside the cylinder |

Clips and masks apply to all shapes of the command; several clips intersect. Their coordinates are the scene's.

```
voxelctl draw "sphere radius=0.9 fill=solid" "clip_box size=2,1,2 at=0,0.5,0" "clip_cylinder start=0,0,-1 end=0,0,1 radius=0.6"
```

```
voxelctl draw "implicit surface='z = 0.3*sin(5*x)*cos(5*y)' level='z+0.5' colormap=viridis" "mask: sphere radius=0.8 fill=solid"
```
"""


def wrapped(text: str) -> str:
    """Returns: the text with lines longer than 140 characters wrapped; a list's lines are indented."""
    lines = []
    for line in text.split("\n"):
        indent = "  " if line.startswith("- ") else re.match(r" *", line)[0]
        lines += [line] if len(line) <= 140 else textwrap.wrap(line, 140, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    return "\n".join(lines)


def comment_above(lines: list[str], at: int) -> str:
    begin = at
    while begin > 0 and lines[begin - 1].startswith("//"):
        begin -= 1
    text = "\n".join(line[2:].strip() for line in lines[begin:at])
    return "\n\n".join(part.replace("\n", " ") for part in text.split("\n\n"))


def messages() -> dict[str, tuple[str, list[tuple[str, str, str]]]]:
    """Returns: for each top-level message, the comment above it, and (type, name, comment) of each field."""
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
    """Returns: by "Message.Enum", or "Enum" at the top: (value, comment) of each, as voxelctl accepts them; the default value is
    first."""
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
    """Returns: `a`, `b` or `c`."""
    named = [f"`{value}`" for value, _ in values]
    return " or ".join(filter(None, [", ".join(named[:-1]), named[-1]]))


def unless_told(values: list[tuple[str, str]]) -> str:
    """Returns: the default value that UNSPECIFIED's comment names."""
    return values[0][1].lower()


def allowed(values: list[tuple[str, str]], said: str) -> tuple[list[tuple[str, str]], str]:
    """Returns: the values that a field allows, by "not SOLID" or "SURFACE or SOLID" in its comment; and the rest of the comment."""
    taken = values[1:]
    if only := re.match(r"([A-Z]+) or ([A-Z]+)(; |$)", said):
        taken = [v for v in taken if v[0].upper() in only.groups()]
        said = said[only.end():]
    elif never := re.match(r"not ([A-Z]+)(; |$)", said):
        taken = [v for v in taken if v[0].upper() != never[1]]
        said = said[never.end():]
    return taken, said


def table(message: str, fields: list[tuple[str, str, str]], values: dict[str, list[tuple[str, str]]]) -> list[str]:
    """Returns: a table of a message's fields with their descriptions."""
    out, own = ["| field | type | unit | default | |\n|---|---|---|---|---|"], []
    for kind, name, said in fields:
        unit, default = BY_TYPE.get(kind, ("", ""))
        of = values.get(f"{message}.{kind}", values.get(kind))
        if of and len(of) <= 8:
            unit, default = "–", f"`{unless_told(of)}`"
        if brackets := re.search(r"\s*\[([^\[\];]+); ([^\[\]]+)\]$", said):
            unit, default = brackets[1], brackets[2]
            said = said[:brackets.start()]
        if not unit:
            sys.exit(f"{PROTO.relative_to(ROOT)}: {message}.{name} says no unit and default, as [length; 0]")
        if of and len(of) <= 8:
            taken, said = allowed(of, said)
            said = "; ".join(filter(None, [words(taken), said]))
        if f"{message}.{kind}" in values:
            own += [wrapped(f"- `{value}`: {comment}") for value, comment in values[f"{message}.{kind}"][1:] if comment]
        row = [f"`{name}`", kind, unit, default, said or BY_NAME.get(name, "")]
        out.append("| " + " | ".join(cell.replace("|", chr(92) + "|") for cell in row) + " |")
    return [*out, "", *own, *([""] if own else [])]


def kinds() -> list[tuple[str, str]]:
    """Returns: (message, field) of each shape, in the protocol's order."""
    body = re.search(r"message Primitive \{\s*oneof kind \{(.*?)\}", PROTO.read_text(), re.S)
    assert body
    return re.findall(r"(\w+) (\w+) = \d+;", body[1])


def paragraphs(text: str) -> tuple[str, str]:
    """Returns: a comment's description, and its guarantees."""
    parts = text.split("\n\n")
    said = [part for part in parts if not part.startswith("Guarantee: ")]
    promised = [part.removeprefix("Guarantee: ").replace("\n", " ") for part in parts if part.startswith("Guarantee: ")]
    return "\n\n".join(said), " ".join(part[0].upper() + part[1:] for part in promised)


def headers(message: str) -> list[tuple[str, str, str]]:
    """Returns: (header, description, guarantees) for each header that says which voxels a shape covers."""
    found = []
    for name in HEADERS_OF.get(message, [f"{message.lower()}.h"]):
        path = (HEADERS / name).resolve()
        text = path.read_text().split("#pragma once")[0]
        said, promised = paragraphs("\n".join(line[2:].rstrip() for line in text.split("\n") if line.startswith("//"))
                                    .replace("\n ", "\n").strip())
        found.append((str(path.relative_to(ROOT)), said, promised))
    return found


def picture(name: str) -> str:
    """Returns: an example's picture, by the gallery's name for it; it must exist."""
    file = re.sub(r"[^a-z0-9_]+", "-", name.lower()) + ".png"
    if not (OUT.parent / PICTURES / file).exists():
        sys.exit(f"docs/{PICTURES}/{file} is missing; voxelctl gallery docs/images/gallery.png --each docs/{PICTURES}")
    return f"![{name}]({PICTURES}/{file})"


def examples() -> dict[str, list[tuple[str, str]]]:
    """Returns: by field: (name, text) of each of the gallery's examples."""
    text = EXAMPLES.read_text()
    body = text[text.index("kExamples[]"):text.index("std::span<const ShapeExample> ShapeExamples")]
    result: dict[str, list[tuple[str, str]]] = {}
    for entry in re.finditer(r'\{("[^{}]*?")\}', re.sub(r'"\s*\n\s*"', "", body)):
        parts = re.findall(r'"((?:[^"\\]|\\.)*)"', entry[1])
        field = parts[0].split(" ")[0].rstrip(",")
        result.setdefault(field, []).append((parts[0], parts[1]))
    return result


def page() -> str:
    all_messages, values, shown = messages(), enums(), examples()
    out = [HEAD]
    pages: dict[str, str] = {}  # headers' comments by page
    for message, field in kinds():
        above, fields = all_messages[message]
        about, promised = paragraphs(above)
        guarantees = [promised] if promised else []
        out.append(f"## {field}\n")
        if about:
            out.append(wrapped(about) + "\n")
        out += table(message, fields, values)
        elsewhere = []
        for path, said, promised in headers(message):
            if promised and not (message in FLAT and path.startswith("gpu/implicit/")):
                guarantees.append(promised)
            if path in pages:
                elsewhere.append(f"`{path}`, under [{pages[path]}](#{pages[path]})")
            else:
                pages[path] = field
                out.append(wrapped(f"**Coverage** (`{path}`): {said}") + "\n")
        if elsewhere:
            out.append(wrapped(f"**Coverage**, shared with others: {'; '.join(elsewhere)}.") + "\n")
        if not guarantees:
            sys.exit(f"nothing says what {message} guarantees: a header's comment, or the message's, has \"Guarantee: …\"")
        out.append(wrapped(f"**Guarantee**: {' '.join(guarantees)}") + "\n")
        for name, text in shown.get(field, []):
            shapes = " \\\n    ".join(f'"{shape}"' for shape in re.split(r"(?<!\\)\\n", text))
            # A backslash at the end of a line continues it in the shell, within double quotes too.
            command = "\n".join(" \\\n".join(textwrap.wrap(line, 138, break_long_words=False, break_on_hyphens=False, drop_whitespace=True))
                                if len(line) > 140 else line for line in f"voxelctl draw {shapes}".split("\n"))
            out.append(f"{picture(name)}\n\n```\n{command}\n```\n")
    out.append("## Shared types\n")
    for message in ("Vertices", "Thickness", "Texture", "ColorScale", "Grid", "Transfer", "Expression", "Boundary"):
        above, fields = all_messages[message]
        out.append(f"### {message}\n\n{wrapped(above)}\n")
        if fields:
            out += table(message, fields, values)
    for name in ("Fill", "SurfaceRule", "LineSampling"):
        out.append(f"### {name}\n\n{words(values[name][1:])}; default `{unless_told(values[name])}`.\n")
        out += [*(wrapped(f"- `{value}`: {comment}") for value, comment in values[name][1:] if comment), ""]
    out.append(BESIDE)
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
