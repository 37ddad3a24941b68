"""Checks that the list of voxeld's components is valid by SPDX's own rules, and has what the loader finds; and that the notices cover what is included.

SBOM is the folder of both, PROGRAMS has the installed programs, joined by colons; PAGE is empty if the daemon has no page.
"""
import json
import os
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

FOLDER = Path(os.environ["SBOM"])
PROGRAMS = os.environ["PROGRAMS"].split(":")
SOURCE = Path(os.environ["SOURCE"])
sys.path.insert(0, str(SOURCE / "tools/sbom"))

ID = re.compile(r"SPDXRef-[A-Za-z0-9.-]+")
# Of SPDX 2.3, clause 11.1: those that are used.
RELATIONSHIPS = {"DESCRIBES", "CONTAINS", "DEPENDS_ON", "DYNAMIC_LINK", "STATIC_LINK", "BUILD_TOOL_OF", "OPTIONAL_DEPENDENCY_OF"}
# Licences and exceptions of SPDX's list that occur in Debian's packages of these libraries; others must be explained in the document.
LISTED = set("""0BSD Apache-2.0 BSD-2-Clause BSD-3-Clause BSL-1.0 CC0-1.0 FTL GFDL-1.3-only GPL-2.0-only GPL-2.0-or-later GPL-3.0-only
GPL-3.0-or-later HPND-sell-variant ISC LGPL-2.0-only LGPL-2.0-or-later LGPL-2.1-only LGPL-2.1-or-later LGPL-3.0-or-later Libpng MIT MPL-1.1 MPL-2.0
X11 Zlib""".split())
EXCEPTIONS = {"GCC-exception-3.1", "LLVM-exception", "Linux-syscall-note"}


def faults(document):
    """Returns the requirements of SPDX 2.3 that the document does not meet, as far as they can be checked without its schema."""
    wrong = []

    def want(right, what):
        if not right:
            wrong.append(what)

    for key, value in (("spdxVersion", "SPDX-2.3"), ("dataLicense", "CC0-1.0"), ("SPDXID", "SPDXRef-DOCUMENT")):
        want(document.get(key) == value, f"{key} is {document.get(key)!r}")
    want(re.fullmatch(r"https://[^#\s]+", document.get("documentNamespace", "")), "documentNamespace")
    creation = document.get("creationInfo", {})
    want(re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", creation.get("created", "")), "created")
    want(all(re.match(r"(Tool|Person|Organization): \S", one) for one in creation.get("creators", [""])), "creators")
    explained = {one.get("licenseId"): one.get("extractedText") for one in document.get("hasExtractedLicensingInfos", [])}
    want(all(re.fullmatch(r"LicenseRef-[A-Za-z0-9.-]+", name or "") and text for name, text in explained.items()), "extracted licences")
    known = {"SPDXRef-DOCUMENT"}
    used = set()
    for package in document.get("packages", []):
        name = package.get("name", "?")
        want(ID.fullmatch(package.get("SPDXID", "")) and package["SPDXID"] not in known, f"{name}: SPDXID")
        known.add(package.get("SPDXID"))
        want(package.get("versionInfo"), f"{name}: version")
        want(package.get("downloadLocation"), f"{name}: downloadLocation")
        want(package.get("filesAnalyzed") is False, f"{name}: filesAnalyzed, and no files")
        want(re.match(r"NOASSERTION$|(Organization|Person): \S", package.get("supplier", "")), f"{name}: supplier")
        for key in ("licenseDeclared", "licenseConcluded"):
            expression = package.get(key, "")
            for word in re.split(r"\s+(?:AND|OR)\s+", expression.replace("(", " ").replace(")", " ").strip()):
                licence, _, exception = word.partition(" WITH ")
                used.add(licence)
                want(licence in LISTED or licence in explained or licence == "NOASSERTION", f"{name}: {key} {word!r}")
                want(exception in EXCEPTIONS | {""}, f"{name}: {key} {word!r}")
        for checksum in package.get("checksums", []):
            want(checksum["algorithm"] == "SHA512" and re.fullmatch(r"[0-9a-f]{128}", checksum["checksumValue"]), f"{name}: checksum")
        for reference in package.get("externalRefs", []):
            want(reference["referenceCategory"] == "PACKAGE-MANAGER" and reference["referenceType"] == "purl" and
                 re.fullmatch(r"pkg:[a-z]+/\S+@\S+", reference["referenceLocator"]), f"{name}: externalRefs")
    want(set(explained) <= used, f"explained, and of no package: {set(explained) - used}")
    for one in document.get("relationships", []):
        want(one.get("spdxElementId") in known and one.get("relatedSpdxElement") in known, f"{one}: of what is not there")
        want(one.get("relationshipType") in RELATIONSHIPS, f"{one}: no such relationship")
    want(any(one.get("relationshipType") == "DESCRIBES" for one in document.get("relationships", [])), "it describes nothing")
    return wrong


class Sbom(unittest.TestCase):
    def setUp(self) -> None:
        self.text = (FOLDER / "voxeld.spdx.json").read_text()
        self.document = json.loads(self.text)
        self.packages = {one["name"]: one for one in self.document["packages"]}

    def related(self, kind):
        names = {one["SPDXID"]: one["name"] for one in self.document["packages"]}
        return {names[one["relatedSpdxElement"]] for one in self.document["relationships"]
                if one["relationshipType"] == kind and one["spdxElementId"] == "SPDXRef-voxeld"}

    def test_is_a_document_of_spdx(self) -> None:
        self.assertEqual(faults(self.document), [])

    def test_faults_are_found(self) -> None:
        for damage, what in ((lambda d: d.update(spdxVersion="SPDX-2.2"), "spdxVersion"),
                             (lambda d: d["packages"][0].update(licenseDeclared="Apache 2"), "licenseDeclared"),
                             (lambda d: d["packages"].pop(), "of what is not there"),
                             (lambda d: d["packages"][1].update(SPDXID=d["packages"][0]["SPDXID"]), "SPDXID"),
                             (lambda d: d["creationInfo"].update(created="today"), "created")):
            document = json.loads(self.text)
            damage(document)
            self.assertTrue(any(what in one for one in faults(document)), what)

    def test_has_each_library_that_the_loader_finds(self) -> None:
        listed = self.related("DYNAMIC_LINK") | self.related("DEPENDS_ON")
        libraries = {os.path.realpath(path) for program in PROGRAMS
                     for path in re.findall(r"(?:=> )?(/\S+) \(0x", subprocess.run(["ldd", program], capture_output=True, text=True, check=True).stdout)}
        self.assertGreater(len(libraries), 50)
        # dpkg itself is asked, since it lists some files under /lib.
        asked = sorted(libraries | {path.removeprefix("/usr") for path in libraries})
        said = subprocess.run(["dpkg-query", "-S", *asked], capture_output=True, text=True).stdout
        owners = {path.removeprefix("/usr"): package.split(":")[0] for package, path in re.findall(r"^(\S+): (/\S+)$", said, re.M)}
        owned = {owners[path.removeprefix("/usr")] for path in libraries}
        self.assertEqual(owned - listed, set())
        said = subprocess.run(["dpkg-query", "-W", "-f", "${Package} ${Version}\n", *owned], capture_output=True, text=True, check=True).stdout
        for package, version in (line.split() for line in said.splitlines()):
            self.assertEqual(self.packages[package]["versionInfo"], version)
        for program in PROGRAMS:
            dynamic = subprocess.run(["readelf", "-dW", program], capture_output=True, text=True, check=True).stdout
            direct = {owners[path.removeprefix("/usr")] for path in libraries
                      if os.path.basename(path).split(".so")[0] + ".so" in {name.split(".so")[0] + ".so" for name in re.findall(r"\(NEEDED\).*\[(.+)\]", dynamic)}}
            self.assertLessEqual(direct, self.related("DYNAMIC_LINK"))
        self.assertLessEqual({"libgrpc++1.51", "libgrpc29", "libprotobuf32", "libstdc++6", "libc6"}, self.related("DYNAMIC_LINK"))
        self.assertIn("libc-ares2", self.related("DEPENDS_ON"))

    def test_has_what_is_of_headers_alone(self) -> None:
        self.assertLessEqual({"libboost1.74-dev", "nlohmann-json3-dev", "libcli11-dev", "libstdc++-12-dev"}, self.related("STATIC_LINK"))

    def test_tests_and_their_libraries_are_not_in_it(self) -> None:
        self.assertFalse({"libgtest-dev", "libgmock-dev", "libbenchmark-dev", "libumockdev0"} & self.packages.keys())

    def test_every_licence_is_named(self) -> None:
        for name, package in self.packages.items():
            # Some packages have neither a paragraph for all files nor a conclusion of our own: then all licences that occur are named.
            if package["licenseDeclared"] == package["licenseConcluded"] == "NOASSERTION":
                self.assertRegex(package.get("licenseComments", "") + package.get("comment", ""), "Licences named in|is prose|not brought along", name)

    def test_has_the_modules_of_the_page(self) -> None:
        self.assertEqual(self.related("CONTAINS"), {"three", "uplot"} if os.environ["PAGE"] else set())
        notices = (FOLDER / "NOTICES").read_text()
        for name in self.related("CONTAINS"):
            package = self.packages[name]
            self.assertEqual(package["licenseDeclared"], "MIT")
            self.assertEqual(package["checksums"][0]["algorithm"], "SHA512")
            self.assertIn(f"{name} {package['versionInfo']} (npm)", notices)
        if os.environ["PAGE"]:
            self.assertIn("Leon Sorokin", notices)  # uPlot's author; its notice is not in the page itself
            self.assertRegex(notices, r"three\.js authors|Three\.js Authors")

    def test_notices_have_what_headers_bring(self) -> None:
        notices = (FOLDER / "NOTICES").read_text()
        for word in ("Niels Lohmann", "University of Cincinnati", "Cynthia Brewer", "matplotlib", "Boost Software License"):
            self.assertIn(word, notices)


class Parts(unittest.TestCase):
    """Tests the scripts that make the list, with known input."""

    def test_copyright_files(self) -> None:
        import debian
        parts = debian.paragraphs("Format: x\n\nFiles: *\nCopyright: A\n B\nLicense: Expat\n\n# no\nLicense: Expat\n Permission\n .\n  granted\n")
        self.assertEqual(parts[1], {"files": "*", "copyright": "A\nB", "license": "Expat"})
        self.assertEqual(parts[2]["license"], "Expat\nPermission\n\n granted")

    def test_licences_that_spdx_knows_and_others(self) -> None:
        import debian
        licence = debian.Licence("")  # of no package
        for name, expression in (("Expat", "MIT"), ("BSD-3-clause or GPL-2", "BSD-3-Clause OR GPL-2.0-only"), ("Expat, Apache-2.0", "MIT AND Apache-2.0"),
                                 ("beerware", "LicenseRef-Debian-beerware"),
                                 ("MIT and GPL-2 or Zlib", "LicenseRef-Debian-MIT-and-GPL-2-or-Zlib")):
            self.assertEqual(licence._expression(name, licence._words(name), "text"), expression)
        self.assertEqual(licence.texts["LicenseRef-Debian-beerware"], "text")

    def test_the_same_content_is_the_same_bytes(self) -> None:
        import spdx

        def made(order, epoch=0):
            document = spdx.Document("a", "1", epoch)
            for name in order:
                document.relate("SPDXRef-DOCUMENT", "DESCRIBES", document.add(spdx.identifier("deb", name), name, "1+b1"))
            return document.text()

        self.assertEqual(made("xyz"), made("zyx"))
        self.assertNotEqual(made("xyz"), made("xy"))
        self.assertIn('"created": "1970-01-02T00:00:00Z"', made("x", 86400))

    def test_ninjas_log(self) -> None:
        import ninja_graph
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "b.cc").write_text('#include "b.h"\n')
            Path(folder, "b.h").write_text("")
            Path(folder, "build.ninja").write_text("rule cc\n  command = c++ -MD -MF $out.d -c $in -o $out\n  depfile = $out.d\n  deps = gcc\n"
                                                   "build b.o: cc b.cc\nbuild all: phony b.o\n")
            subprocess.run(["ninja", "-C", folder, "all"], check=True, stdout=subprocess.DEVNULL)
            read = {os.path.basename(path) for path in ninja_graph.dependencies(folder)["b.o"]}
            self.assertLessEqual({"b.cc", "b.h"}, read)
            self.assertIn("b.cc", ninja_graph.inputs(folder, "b.o"))


if __name__ == "__main__":
    unittest.main()
