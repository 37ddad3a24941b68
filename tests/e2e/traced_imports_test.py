"""Checks with strace that importing an untrusted file opens only that file and the files that voxelctl always opens, even if the file
refers to others. Requires VOXELD, VOXELCTL and strace."""
import base64
import json
import os
import re
import shutil
import subprocess
import tempfile
import unittest
import zipfile
from pathlib import Path
from typing import Callable

from polling import LONG
from quick_daemon import VOXELCTL, QuickDaemon

# Files that voxelctl and its libraries open for every input.
OWN = re.compile(r"""
    /etc/ld\.so\.(cache|preload)
  | /(\S*/)?lib(64)?/\S*\.so(\.\S+)?
  | /proc/(self|thread-self|\d+)/(maps|status|statm?|fd|cgroup|mountinfo|task\S*)
  | /proc/(sys/vm/overcommit_memory|cpuinfo|meminfo)
  | /sys/(devices/system/(cpu|node)|fs/cgroup)\S*
  | /dev/(null|urandom|shm/?\S*)
  | /usr/(lib|share)/locale\S* | /etc/localtime | /usr/share/zoneinfo\S* | /usr/lib/x86_64-linux-gnu/gconv/\S*
  | (/etc|/usr/share|/var/cache)/fontconfig\S* | \S*/\.(cache/)?fontconfig/\S* | /etc/fonts\S* | /usr/(local/|X11R6/lib/X11/)?(share/)?fonts\S* | \S*/\.(local/share/)?fonts
  | /proc/filesystems
  | /etc/ssl/openssl\.cnf | /usr/lib/ssl/openssl\.cnf
  | /etc/(resolv\.conf|hosts|nsswitch\.conf|host\.conf|gai\.conf)
""", re.VERBOSE)
OPENED = re.compile(r'(?:open|openat|openat2|creat)\((?:AT_FDCWD, |\d+<?[^,]*, )?"((?:[^"\\]|\\.)*)"')

TRIANGLE = b"\0\0\0\0" * 3 + b"\0\0\x80?\0\0\0\0\0\0\0\0" + b"\0\0\0\0\0\0\x80?\0\0\0\0"
XML = "<?xml version='1.0'?>"


def gltf(name: str) -> bytes:
    return json.dumps({
        "asset": {"version": "2.0"}, "buffers": [{"uri": name, "byteLength": 36}], "images": [{"uri": name}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0}).encode()


def glb(name: str) -> bytes:
    text = gltf(name)
    text += b" " * (-len(text) % 4)
    return b"glTF" + (2).to_bytes(4, "little") + (20 + len(text)).to_bytes(4, "little") + len(text).to_bytes(4, "little") + b"JSON" + text


def collada(name: str) -> bytes:
    return (f"{XML}<!DOCTYPE COLLADA [<!ENTITY bait SYSTEM \"{name}\">]><COLLADA version='1.4.1'><library_images><image id='i'><init_from>{name}"
            f"</init_from></image></library_images><asset>&bait;</asset></COLLADA>").encode()


def svg(name: str) -> bytes:
    return (f"{XML}<?xml-stylesheet href='{name}'?><!DOCTYPE svg SYSTEM \"{name}\" [<!ENTITY bait SYSTEM \"{name}\">]>"
            f"<svg xmlns='http://www.w3.org/2000/svg' xmlns:xlink='http://www.w3.org/1999/xlink'><image href='{name}'/><use xlink:href='{name}#a'/>"
            f"<style>@import url({name});</style><text>&bait;</text><rect width='1' height='1'/></svg>").encode()


def obj(name: str) -> bytes:
    return f"mtllib {name}\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".encode()


def ply(name: str) -> bytes:
    return (f"ply\nformat ascii 1.0\ncomment TextureFile {name}\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
            "element face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n").encode()


def nhdr(name: str) -> bytes:
    return f"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: {name}\n".encode()


def nrrd(name: str) -> bytes:
    return f"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: {name}\n".encode()


def mhd(name: str) -> bytes:
    return f"NDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\nElementDataFile = {name}\n".encode()


def amf(name: str) -> bytes:
    return (f"{XML}<!DOCTYPE amf [<!ENTITY bait SYSTEM \"{name}\">]><amf unit='millimeter'><object id='0'><mesh><vertices>&bait;</vertices></mesh>"
            f"</object><texture id='1' width='1' height='1' depth='1' tiled='1' type='{name}'/></amf>").encode()


def directx(name: str) -> bytes:
    return (f'xof 0303txt 0032\nMaterial m {{ 1;1;1;1;; 1; 1;1;1;; 1;1;1;; TextureFilename {{ "{name}"; }} }}\n'
            "Mesh a { 3; 0;0;0;, 1;0;0;, 0;1;0;; 1; 3; 0,1,2;; }\n").encode()


def threemf(name: str) -> bytes:
    with tempfile.NamedTemporaryFile(suffix=".zip") as file:
        with zipfile.ZipFile(file.name, "w") as archive:
            archive.writestr("[Content_Types].xml", f"{XML}<Types xmlns='http://schemas.openxmlformats.org/package/2006/content-types'/>")
            archive.writestr("_rels/.rels", f"{XML}<Relationships xmlns='http://schemas.openxmlformats.org/package/2006/relationships'><Relationship "
                             f"Target='{name}' Id='r' Type='http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel'/></Relationships>")
            archive.writestr(name, "bait")
        return Path(file.name).read_bytes()


def step(name: str) -> bytes:
    return (f"ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('{name}','',(''),(''),'','','');\nFILE_SCHEMA(('IFC2X3'));\nENDSEC;\n"
            f"DATA;\n#1=IFCIMAGETEXTURE(.T.,.T.,.TEXTURE.,$,'{name}');\nENDSEC;\nEND-ISO-10303-21;\n").encode()


FORMATS: "dict[str, Callable[[str], bytes]]" = {
    "gltf": gltf, "glb": glb, "obj": obj, "dae": collada, "svg": svg, "ply": ply, "nhdr": nhdr, "nrrd": nrrd, "mhd": mhd, "amf": amf, "x": directx, "3mf": threemf,
    "ifc": step}


class TracedImports(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        if shutil.which("strace") is None:
            raise unittest.SkipTest("strace is not installed (tools/setup --dev)")
        cls.daemon = QuickDaemon()
        # An empty entry in LD_LIBRARY_PATH means the working directory.
        cls.daemon.environment.pop("LD_LIBRARY_PATH", None)
        cls.addClassCleanup(cls.daemon.close)
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "a.stl").write_text("solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n")
            played = cls.daemon.voxelctl("play", "--other-files", "none", f"{folder}/a.stl")
        if "Landlock" in played.stderr:
            # Nothing would be read, so nothing would be tested.
            raise unittest.SkipTest(played.stderr)
        assert played.returncode == 0, played.stderr

    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.outside = Path(folder.name, "outside")
        self.folder = Path(folder.name, "inside")
        for each in (self.outside, self.folder):
            each.mkdir()
            (each / "bait").write_bytes(TRIANGLE)
        (self.folder / "link").symlink_to(self.outside / "bait")
        os.mkfifo(self.folder / "fifo")

    def opened(self, name: str, others: str) -> "tuple[set[str], subprocess.CompletedProcess[str]]":
        """Plays a file. Returns: the paths that voxelctl opened or tried to open, except that file and the files it always opens; and the
        completed process."""
        trace = self.folder.parent / "trace"
        played = subprocess.run(["strace", "-f", "-qq", "-s", "4096", "-e", "trace=open,openat,openat2,creat", "-o", trace, VOXELCTL, "play",
                                 "--other-files", others, self.folder / name], env=self.daemon.environment, capture_output=True, text=True, timeout=LONG,
                                check=False)
        found = set(OPENED.findall(trace.read_text(errors="replace")))
        self.assertIn(str(self.folder / name), found, "the trace has the file itself")
        return {path for path in found if path != str(self.folder / name) and not OWN.fullmatch(path)}, played

    def test_untrusted_file_opens_no_other_file(self) -> None:
        baits = [str(self.outside / "bait"), "../outside/bait", "bait", "link", "fifo"]
        for extension, make in FORMATS.items():
            for number, bait in enumerate(baits):
                with self.subTest(f".{extension} that refers to {bait}"):
                    name = f"{number}.{extension}"
                    (self.folder / name).write_bytes(make(bait))
                    found, played = self.opened(name, "none")
                    self.assertEqual(found, set(), played.stderr)
                    self.assertNotIn("crashed", played.stderr)

    def test_trace_records_referenced_files(self) -> None:
        # The formats in which other files are read for a local user.
        for extension in ("gltf", "obj", "nhdr", "mhd"):
            with self.subTest(extension):
                (self.folder / f"a.{extension}").write_bytes(FORMATS[extension]("bait"))
                found, played = self.opened(f"a.{extension}", "below")
                self.assertEqual(played.returncode, 0, played.stderr)
                self.assertIn("bait", found)

    def test_embedded_data_is_read(self) -> None:
        (self.folder / "a.gltf").write_bytes(gltf("data:application/octet-stream;base64," + base64.b64encode(TRIANGLE).decode()))
        found, played = self.opened("a.gltf", "none")
        self.assertEqual((found, played.returncode), (set(), 0), played.stderr)


if __name__ == "__main__":
    unittest.main()
