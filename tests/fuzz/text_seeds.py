"""Hand-written seeds for the readers of maps, points, molecules and drawings: every form that they support, and each of their refusals.
Like
shape_seeds.py."""
import json
import pathlib
import re

ROOT = pathlib.Path(__file__).resolve().parents[2]


def maps(put):
    line = [[0, 0], [10, 20], [170, 10], [-170, 12], [-179, 90], [179, 90], [180, 5], [180, 6], [0, 0]]
    shape = lambda kind, coordinates: {"type": kind, "coordinates": coordinates}
    collection = lambda *g: {"type": "GeometryCollection", "geometries": list(g)}
    feature = lambda g: {"type": "Feature", "geometry": g}
    every = [shape("Point", [1, 2]), shape("MultiPoint", [[1, 2], [3, 4]]), shape("LineString", line), shape("MultiLineString", [line, line[:2]]),
             shape("Polygon", [line[:4]]), shape("MultiPolygon", [[line[:4], line[:3]]])]
    for document in (*every, collection(*every), {"type": "FeatureCollection", "features": [feature(g) for g in every] + [feature(None)]}, {"type": "Feature"}, {"type": "None\x01"}, {"type": "Point"},
                     {"type": "FeatureCollection"}, {"type": "FeatureCollection", "features": 1}, {"type": "FeatureCollection", "features": [1]}, {"type": "FeatureCollection", "features": [{}]}, collection({"type": 1}),
                     shape("Point", [1]), shape("Point", ["a", 1]), shape("LineString", 5), shape("LineString", [[1]]), shape("MultiPoint", [[1, 2], 3]), shape("Polygon", [5]), shape("LineString", []),
                     shape("LineString", [[400, 0], [1, 100]]), shape("LineString", [[350, 0], [10, 0]]), shape("LineString", [[-350, 0], [350, 9]]), shape("LineString", [[0, 0], [0, 0]]), shape("Point", [0, 1000]),
                     shape("LineString", [[170, 0], [-170, 0]]), shape("LineString", [[-170, 0], [170, 0]]), shape("LineString", [[-180, 0], [180, 0]]), shape("LineString", [[200, 0], [-100, 0]])):
        put("import_text", b"\x00" + json.dumps(document).encode())
    put("import_text", b"\x00\xef\xbb\xbf " + json.dumps(every[0]).encode())
    for text in ('{"type":"Point","coordinates":[1e999,2]}', '{"type":"Point","coordinates":[1,', '{"type":"Point",}', "", "  ", "text", "[1]", "[" * 300, '{"a":"\\ud800"}', '{"type": "Point", "coordinates": [1e308, -1e308]}',
                 '{"type": "LineString", "coordinates": [[1e308, 0], [-1e308, 0], [1e308, 1e308]]}'):
        put("import_text", b"\x00" + text.encode())

    topology = lambda objects, arcs=([[0, 0], [5, 5], [5, -5]], [[1, 1], [2, 2]]), **more: {"type": "Topology", "objects": objects, "arcs": list(arcs), **more}
    arc = lambda kind, arcs: {"type": kind, "arcs": arcs}
    scaled = {"transform": {"scale": [0.5, 0.5], "translate": [1, 2]}}
    kinds = {"a": arc("LineString", [0]), "b": arc("MultiLineString", [[0], [-2]]), "c": arc("Polygon", [[0, -1]]), "d": arc("MultiPolygon", [[[1]]]), "e": shape("Point", [1, 2]),
             "f": shape("MultiPoint", [[1, 2], [3, 4]]), "g": {}, "h": {"type": None}, "i": collection(arc("Polygon", [[1]]), shape("MultiPoint", []))}
    for document in (topology(kinds), topology(kinds, **scaled), topology({"a": 1}), topology({"a": {"type": "none\x02"}}), topology({"a": {"type": ["x"]}}), topology({"a\x01": arc("LineString", [9])}), topology({"a": arc("LineString", [-9])}),
                     topology({"a": arc("LineString", 1)}), topology({"a": arc("LineString", [1.5])}), topology({"a": arc("LineString", [[["a"]]])}), topology({"a": {"type": "Polygon"}}), topology({"a": {"type": "Point"}}),
                     topology({"a": shape("Point", [1])}), topology({"a": shape("MultiPoint", [[1, 2], ["a", 2]])}), topology({"a": {"type": "GeometryCollection"}}), topology({"a": {"type": "GeometryCollection", "geometries": 1}}),
                     topology({"a": collection(1)}), topology(kinds, arcs=[[[0, 0]], [[1, 1], [2, 2]]]), topology(kinds, arcs=[[[0, 0], ["a", 1]], 5]), topology(kinds, arcs=[5, 5]), topology({}), topology(kinds, transform=1),
                     topology(kinds, transform={"scale": [1, 1]}), topology(kinds, transform={"scale": [1], "translate": [1, 1]}), topology(kinds, transform={"scale": [1, 1], "translate": ["a", 1]}), topology(1), {"type": "Topology"},
                     {"type": "Topology", "arcs": 1, "objects": {}}, topology({"a": arc("LineString", [2 ** 63])}), topology({"a": arc("LineString", [-2 ** 63])}), topology({"a": shape("Point", [1e300, 1])}, **scaled),
                     topology({"a": arc("LineString", [0])}, arcs=[[[1e308, 0], [1e308, 0]]], **scaled), topology({"a": shape("Point", [400, 1])})):
        put("import_text", b"\x01" + json.dumps(document).encode())


def points(put):
    for text in ("", "# only\n// this\n", "3", "3\n", "x y z", "x,y,z\n", "1 2\n", "1 2 3\n", "1;2;3\n", "1,,3\n", "\ufeff1 2 3 # end\n4 5 6", "2\n1 2 3\n4 5 6", "1 2 3 0.5\n", "1 2 3 4 5\n", "1 2 3 -0.5 0 1\n", "1 2 3 0.5 0.5 1\n", "1 2 3 10 20 255",
                 "1 2 3 1000 2000 65535", "1 2 3 9 10 20 30", "1 2 3 1 2 3 4 5", "1 2 3 10 20 30 0 0 1", "1 2 3 4 5 6 7 8 9 10", "1 2 x\n", "1 2 3\n4 5\n", "1 2 3\n4 5 y\n", "1 2 1e99", "1 2 nan", "1 2 3\n1 2 inf", "+1 +2 3", "x,y,z,red,green,blue,intensity\n1,2,3,0.1,0.2,0.3,7\n",
                 '"x","y","z","x"\n1,2,3,4\n', "X;Y;Z;nx;ny;nz\n1;2;3;0;0;1\n", "x y z red\n1 2 3 4\n", "x y\n1 2\n", "a b c\n1 2 3\n", "x,y,z,name\n1,2,3,\n1,2", " ".join(["1"] * 300), "x\ty\tz\n1\t2\t3\n", "1 2 3 0 0 0 0 0 0\n"):
        for kind in (2, 3):
            put("import_text", bytes([kind]) + text.encode())


def molecules(put):
    def atom(number, name="CA  ", x=0.0, y=0.0, z=0.0, element=" C", record="ATOM  ", location=" "):
        return f"{record}{number:5} {name:4}{location}ALA A   1    {x:8.3f}{y:8.3f}{z:8.3f}  1.00  0.00          {element:2}\n"

    connect = lambda *numbers: "CONECT" + "".join(f"{n:5}" for n in numbers) + "\n"
    two = atom(1) + atom(2, x=1.4) + atom(3, " H  ", 0.9, 0.9, 0, " H") + atom(4, " H  ", 1.0, 0.9, 0, " H") + atom(5, "FE  ", 3, 3, 3, "FE", "HETATM")
    for text in (two, two + connect(1, 2, 3) + connect(9, 1) + connect(1, 1), "MODEL 1\n" + two + "ENDMDL\nMODEL 2\n" + two + "ENDMDL\n", "ENDMDL\n" + two, two.replace("\n", "\r\n"), "HEADER\n", "", "text", two[:40], two[:33],
                 two.replace("1.400", "1.4x0"), atom(1).replace("0.000", "9e9  ", 1), atom(1, element="  "), atom(1, " CA ", element=""), atom(1, "HG11", element=""), atom(1, "CA12", element=""), atom(1, "1H  ", element=""), atom(1, "????", element="??"),
                 atom(1, "    ", element=""), atom(1, "1234", element=""), atom(1, "XYZW", element=""), atom(1, location="A") + atom(2, location="B") + atom(3, location="1"), "".join(atom(i) for i in range(102)), atom(1, "*Q  ", element=""),
                 "ATOM  \n", atom(1)[:17], "ATOM      1  CA  ALA A   1         nan     0.0     0.0\n"):
        put("import_text", b"\x04" + text.encode(), 12288)


def drawings(put):
    svg = lambda body, more="": f'<svg xmlns:xlink="http://www.w3.org/1999/xlink" viewBox="0 0 9 9" {more}>{body}</svg>'
    path = lambda d, more="": f'<path d="{d}" {more}/>'
    stroke = 'fill="none" stroke="red"'
    bodies = [
        "", "text", "<rect/>", '<rect width="3" height="2"/>', '<rect x="1mm" y="2pt" width="3in" height="2cm" rx="4pc" ry="1em"/>', '<rect width="50%" height="2px" rx="9"/>', '<rect width="3q" height="2" ry="1"/>', '<circle r="2" cx="1" cy="1"/>',
        '<ellipse rx="1" ry="2"/>', '<ellipse rx="1"/>', '<circle r="a"/>', '<line x1="1" x2="5" stroke="blue"/>', '<polyline points="0,0 1,1 2,0"/>', '<polygon points="0 0 1 1 2 0" stroke="#123"/>', '<polygon points="0 0 1 1 x"/>', '<polygon points="1"/>', "<other/>",
        # paths
        path("M1 1 2 2 l3 3 h1 H2 v1 V2 z l1 1", stroke), path("m1 1 2 2c1 1 2 2 3 3s1 1 2 2S3 3 4 4q1 1 2 2t1 1T5 5Q1 1 2 2C1 1 2 2 3 3Z"), path("M0 0 S1 1 2 2 T3 3"), path("M0 0 A3 2 30 0 1 5 5 a3 2 30 1 0 -5 -5 A3 2 0 11 5 6A3 2 0 00 5 5A0 1 0 0 0 1 1A9 9 0 0 0 1 1", stroke),
        *(path(d) for d in ("L1 1", "M", "M1", "M1 1 L", "M1 1 H", "M1 1 V", "M1 1 C1", "M1 1 C1 1 2 2", "M1 1 S1", "M1 1 Q1", "M1 1 T", "M1 1 A", "M1 1 A1 1", "M1 1 A1 1 0", "M1 1 A1 1 0 2 0 5 5", "M1 1 A1 1 0 0", "M1 1 A1 1 0 0 0 5", "M1 1 B", "M1 1 &#1;", "Z", "z M1 1", "1 1", "M1e99 1",
                            "M1 1 L1e13 1", "M+1-1l.5.5e1-5.e-1", "M1 1 L1e5,1E+5", "M1e 1", "M1 1 1e400 1", "M1,1,,,2 2", "M1 1 a1 1 0 ,1,0,1 1", "M-. 1", "M1 1zm1 1zz", "")),
        # styles
        path("M0 0 3 0 3 3z", 'style="fill:#12345678;stroke:rgb(1,2%,300);fill-opacity:50%;stroke-opacity:.5;opacity:2;fill-rule:evenodd;display:inline;visibility:visible;color:teal;bad;:x;stroke-width:"'),
        path("M0 0 3 0 3 3z", 'fill="#1234" stroke="rgba(1,2)"'), path("M0 0 3 0 3 3z", 'fill="#12" stroke="currentColor" color="YELLOW"'), path("M0 0 3 0 3 3z", 'fill="transparent" stroke="none"'), path("M0 0 3 0 3 3z", 'display="none"'),
        path("M0 0 3 0 3 3z", 'visibility="hidden"'), path("M0 0 3 0 3 3z", 'opacity="x" fill="inherit" stroke="' + "a" * 1100 + '"'), path("M0 0 3 0 3 3z", 'fill="rgb" opacity="0"'), path("M0 0 3 0 3 3z", 'fill="#gggggg"'),
        '<style>/* a */ path, .a { fill: red } #b { stroke: blue !important } /* open</style>' + path("M0 0 3 0 3 3z", 'class="a c" id="b"'), "<style>.a { fill: red</style>" + path("M0 0 1 1"), "<style>" + "p{a:" + "x" * 3000 + "}" + "p{b:" + "y" * 3000 + "}</style><p/>",
        # gradients
        '<linearGradient id="g"><stop offset="0" stop-color="red"/><stop stop-color="none"/><stop style="stop-color:#00f"/><other/>t</linearGradient>' + path("M0 0 3 0 3 3z", 'fill="url(#g)"') + path("M0 0 3 0 3 3z", 'fill="url(\'#g\')"'),
        '<linearGradient id="g" xlink:href="#h"/><linearGradient id="h" href="#g"/>' + path("M0 0 3 0 3 3z", 'fill="url(#g) green"') + path("M0 0 3 0 3 3z", 'fill="url(#none)" stroke="url(#none'), '<p id="g" href="#x"/>' + path("M0 0 3 0 3 3z", 'fill="url(#g)"'),
        # groups, uses, transforms
        '<g id="a"><a><switch><circle r="1"/></switch></a></g><svg x="3" y="3"><symbol id="s"><rect width="1" height="1"/></symbol><use href="#s" x="1"/></svg><use xlink:href="#a" y="2"/>', '<use href="#none"/>', '<use href="none"/>', "<use/>", '<g id="a"><use href="#a"/></g>',
        "<text>t</text><text/><image/><foreignObject/><clipPath/><mask/><circle r='1'/>", "<text/>", "<g>" * 120 + "</g>" * 120,
        *(f'<g transform="{t}">{path("M0 0 3 0 3 3z")}</g>' for t in ("matrix(1 0 0 1 2 3)", "translate(1),translate(1,2)", "scale(2) scale(2 3)", "rotate(30) rotate(30 1 1)", "skewX(10)skewY(10)", "turn(1)", "matrix(1 2)", "rotate(1 2)", "scale(1", "scale", "scale(1 2 3 4 5 6 7)", "skewX(90)",
                                                                     "scale(1e200) scale(1e200)", "translate(1e300)", ",")),
        # layers
        '<rect width="9" height="9" fill="white"/><rect width="3" height="3"/>' + path("M1 1 2 2", "stroke='black' fill='none'"), '<rect width="3" height="3" fill="white"/><rect width="9" height="9"/>', '<rect width="9" height="9" fill="white" transform="rotate(10)"/><circle r="1"/>',
        '<rect width="9" height="9" fill="#888"/><circle r="1"/>', '<rect width="9" height="9" fill="white" opacity=".5"/><circle r="1"/>', "".join(f'<rect width="9" height="9" fill="#{i % 10}{i // 10}5"/>' for i in range(40)), path("M0 0 0 0 0 0z"), path("M0 0 3 0", "stroke='red'"),
        path("M0 0 9 9 0 9 9 0z", 'fill-rule="evenodd"'), path("M0 0 9 9 0 9 9 0z M1 1 8 8 1 8 8 1z"), path("M0 0 3 0z", "stroke='red' fill='blue'"), '<line x2="5" fill="red"/>', path("M0 0 0 9", "stroke='red'") + path("M0 0 0 5", "stroke='blue'"), path("M1e12 0 3 0 1 1"),
    ]
    # Lines that cross one another too often to be filled, and more of them than are examined one by one.
    star = "M" + " ".join(f"{(i * 7919) % 997},{(i * 104729) % 991}" for i in range(1500)) + "z"
    curves = "M0 0" + "".join(f"s{i % 9} {i % 7} {i % 5} {i % 3}" for i in range(150))
    for body in (path(star), path(star[:3000]), path(curves, stroke), path("M0 0" + "h9v1h-9v1" * 700, stroke)):
        put("import_text", b"\x05" + svg(body).encode(), 16384)
    for body in bodies:
        put("import_text", b"\x05" + svg(body).encode(), 16384)
    for text in ("", "<svg", "<a/>", "<a\x01/>", "<!-- -->", "<svg/><svg/>", svg(path("M0 0 1 1"), "display='none'"), "<?xml version='1.0'?><!DOCTYPE svg [<!ENTITY e 'x'>]><svg>&e;<style>&e;</style></svg>", "<svg>\xff</svg>", svg("<rect width='1' height='1'/>", "transform='none'")):
        put("import_text", b"\x05" + text.encode("latin-1"))


def grants(put):
    digest = "0123456789abcdef" * 4
    token = lambda *more: "\n".join(["[[token]]", 'name = "a"', f'sha256 = "{digest}"', 'scopes = ["view"]', *more]) + "\n"
    user = lambda name: f'[[user]]\nname = "{name}"\nscopes = ["all"]\n'
    certificate = lambda subject: f'[[certificate]]\nname = "b"\nsubject = {subject}\nscopes = ["draw", "view"]\n'
    for text in (token(), token() + token(), token("expires = 2027-01-31T00:00:00Z"), token("expires = 2027-01-31T00:00:00-05:30"), token("expires = 2027-01-31T00:00:00"), token("expires = 2027-01-31"), token('expires = "soon"'), token("expires = 5"), token("expire = 5"),
                 user("root") + user("0"), user("no-such-user"), user("7") + user("7"), user("a b"), user("a" * 300), user("4294967296"), certificate('"x"') + certificate('"x"'), certificate('""'), certificate("1"), certificate('"x"').replace("subject", "sha256"),
                 token().replace(digest, digest.upper()), token().replace(digest, "12"), token().replace("sha256", "#"), token().replace('["view"]', '["view", 1]'), token().replace('["view"]', '"view"'), token().replace('["view"]', "[]"), token().replace('["view"]', '["none"]'),
                 "token = 1", "[token]", "token = [1]", "tokens = []", "[[token]]", "[[token]]\n" * 30, "a = ", "all", "none", "view,draw control", "view paint", ""):
        put("grants", text.encode())


def configurations(put):
    """Writes seeds of each key of daemon/config/fields.h in its section, with values of every kind."""
    section = ""
    for word, name in re.findall(r'visitor\.(\w+)\("(\w+)"', (ROOT / "daemon/config/fields.h").read_text()):
        if word == "Section":
            section = name
            continue
        for value in ('"text"', '""', "true", "5", "-1", "9223372036854775807", "1e300", "nan", "0.5", "[]", '["127.0.0.1:1"]', "1979-05-27"):
            put("config_text", f"[{section}]\n{name} = {value}\n".encode())
    for text in ("display = 5", "display = [1]", "display = []", "[display]\nname = 'a'", "[[display]]", "[[display]]\nname = 'a'\ndriver = 'simulated'\n" * 2, "[[display]]\nname = 'a b'\ndriver = 'x'\nsize = [1, 2]\nmore = {}", "[none]\na = 1", "server = 1", "[server]\nnone = 1", "a = ",
                 "[server]\nlocal_socket = 'tcp:5'", "[server]\nlocal_socket = '/run/a'", "[server]\nlocal_socket = 'off'", "[server]\nlocal_socket = '" + "a" * 200 + "'", "[server]\nhttp = 'off'", "[server]\nhttp = 'unix:/a'", "[server]\nhttp = ':::'", "[server]\nlisten = ['unix:/a', 5]", "[server]\nlisten = ['a']"):
        put("config_text", text.encode())


def texts(put):
    for reader in (configurations, grants, maps, points, molecules, drawings):
        reader(put)
