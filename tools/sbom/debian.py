"""Debian's packages: which package a file belongs to, its installed version, and its licence."""
import functools
import glob
import os
import re
import subprocess

# What Debian calls a licence in copyright files (and others do there), and SPDX in its list.
SPDX = {
    "0bsd": "0BSD", "apache-2": "Apache-2.0", "apache-2.0": "Apache-2.0", "boost-1.0": "BSL-1.0", "bsl-1": "BSL-1.0", "bsl-1.0": "BSL-1.0",
    "bsd-2-clause": "BSD-2-Clause", "bsd-2": "BSD-2-Clause", "bsd-3-clause": "BSD-3-Clause", "bsd-3": "BSD-3-Clause", "cc0-1.0": "CC0-1.0",
    "expat": "MIT", "mit": "MIT", "isc": "ISC", "ftl": "FTL", "gpl-2": "GPL-2.0-only", "gpl-2+": "GPL-2.0-or-later", "gpl-2.0+": "GPL-2.0-or-later",
    "gpl-3": "GPL-3.0-only", "gpl-3+": "GPL-3.0-or-later", "lgpl-2": "LGPL-2.0-only", "lgpl-2+": "LGPL-2.0-or-later",
    "lgpl-2.1": "LGPL-2.1-only", "lgpl-2.1+": "LGPL-2.1-or-later", "lgpl-3+": "LGPL-3.0-or-later", "libpng": "Libpng",
    "mpl-1.1": "MPL-1.1", "mpl-2.0": "MPL-2.0", "x11": "X11", "zlib": "Zlib", "bsd-3-clause~google": "BSD-3-Clause", "bsd-3-google": "BSD-3-Clause",
    "apache-2.0 with llvm exception": "Apache-2.0 WITH LLVM-exception", "gfdl-1.3": "GFDL-1.3-only",
    "gpl-2 with linux-syscall-note exception": "GPL-2.0-only WITH Linux-syscall-note",
}
# Our reading of packages whose copyright file is prose.
READ_BY_US = {
    "libc-ares2": "MIT", "libc6": "LGPL-2.1-or-later", "libc6-dev": "LGPL-2.1-or-later", "libfontconfig1": "HPND-sell-variant",
    "libfontconfig-dev": "HPND-sell-variant", "libgcc-s1": "GPL-3.0-or-later WITH GCC-exception-3.1",
    "libgcc-12-dev": "GPL-3.0-or-later WITH GCC-exception-3.1", "libstdc++6": "GPL-3.0-or-later WITH GCC-exception-3.1",
    "libstdc++-12-dev": "GPL-3.0-or-later WITH GCC-exception-3.1", "libusb-1.0-0": "LGPL-2.1-or-later", "libusb-1.0-0-dev": "LGPL-2.1-or-later",
    "g++-12": "GPL-3.0-or-later", "linux-libc-dev": "GPL-2.0-only WITH Linux-syscall-note",
}


@functools.cache
def _owners():
    owners = {}
    for listed in glob.glob("/var/lib/dpkg/info/*.list"):
        package = os.path.basename(listed)[: -len(".list")].split(":")[0]
        with open(listed, encoding="utf-8") as file:
            for line in file:
                path = line.rstrip("\n")
                owners.setdefault(path, package)
    return owners


def package_of(path):
    """Returns: the package of `path` (a real path), or None. dpkg records some files of /usr/lib under /lib."""
    owners = _owners()
    return owners.get(path) or (owners.get(path[len("/usr") :]) if path.startswith("/usr/") else None)


@functools.cache
def describe(package):
    """Returns: {version, source, source_version, architecture, homepage} of an installed package."""
    fields = ("Version", "source:Package", "source:Version", "Architecture", "Homepage")
    shown = subprocess.run(["dpkg-query", "-W", "-f", "\t".join("${%s}" % field for field in fields) + "\n", package],
                           capture_output=True, text=True, check=True).stdout.splitlines()[0].split("\t")
    return dict(zip(("version", "source", "source_version", "architecture", "homepage"), shown))


def copyright_file(package):
    path = f"/usr/share/doc/{package}/copyright"
    return path if os.path.exists(path) else None


class Paragraph(dict):
    """Fields of a paragraph, by lower-case names; in a field of several lines, the leading space of each is removed."""


def paragraphs(text):
    result, current, last = [], Paragraph(), None
    for line in text.splitlines() + [""]:
        if not line.strip():
            if current:
                result.append(current)
            current, last = Paragraph(), None
        elif line[0] in " \t" and last:
            current[last] += "\n" + ("" if line.strip() == "." else line[1:].rstrip())
        elif ":" in line and not line.startswith("#"):
            last, value = line.split(":", 1)
            last = last.strip().lower()
            current[last] = value.strip()
    return result


class Licence:
    """The contents of a package's copyright file. expression: the SPDX expression of `Files: *`, or None if the file is prose;
    texts: {LicenseRef: text} for licences that are not in SPDX's list; names: all that occur; notice: copyright and text of
    `Files: *`, otherwise the whole file; concluded: our reading of prose."""

    def __init__(self, package):
        self.expression, self.texts, self.names, self.notice = None, {}, [], ""
        self.concluded = READ_BY_US.get(package)
        path = copyright_file(package)
        self.path = path
        if path is None:
            return
        with open(path, encoding="utf-8", errors="replace") as file:
            text = file.read()
        if not re.match(r"\s*Format(-Specification)?:", text):
            self.notice = text
            return
        parts = paragraphs(text)
        stanzas = [part for part in parts if "files" in part and part.get("license", "").strip()]
        self.names = sorted({part["license"].splitlines()[0].strip() for part in parts if part.get("license", "").strip()})
        main = next((part for part in stanzas if "*" in part["files"].split()), None)
        if main is None:
            self.notice = text
            return
        name, _, body = main["license"].partition("\n")
        bodies = {part["license"].split("\n")[0].strip().lower(): part["license"].partition("\n")[2] for part in parts
                  if "files" not in part and part.get("license", "").strip()}
        words = self._words(name.strip())
        texts = []
        for word in words:
            own = body or bodies.get(word.lower(), "")
            if own and own not in texts:
                texts.append(own)
        self.notice = main.get("copyright", "") + "\n\n" + "\n\n".join(texts)
        self.expression = self._expression(name.strip(), words, "\n\n".join(texts))

    @staticmethod
    def _words(name):
        return [word for word in re.split(r"\s*(?:,?\s+and\s+|,?\s+or\s+|,\s*)", name, flags=re.I) if word]

    def _expression(self, name, words, text):
        known = [SPDX.get(word.lower()) for word in words]
        has_and, has_or = re.search(r"\band\b", name, re.I), re.search(r"\bor\b", name, re.I)
        if all(known) and not (has_and and has_or):
            return (" OR " if has_or else " AND ").join(known)
        reference = "LicenseRef-Debian-" + re.sub(r"[^A-Za-z0-9.]+", "-", name).strip("-")
        self.texts[reference] = text.strip() or f"See {self.path}"
        return reference
