"""The npm modules in a bundle: version, licence, hash and notice."""
import base64
import glob
import json
import os


class Module:
    """name, version, licence; sha512 (hex) of the archive that npm fetched, or None; notice: the text of its licence."""

    def __init__(self, modules, name):
        self.name = name
        with open(os.path.join(modules, name, "package.json"), encoding="utf-8") as file:
            described = json.load(file)
        self.version, self.licence = described["version"], described.get("license", "NOASSERTION")
        self.homepage = described.get("homepage")
        with open(os.path.join(modules, ".package-lock.json"), encoding="utf-8") as file:
            locked = json.load(file)["packages"].get(f"node_modules/{name}", {})
        if locked.get("version") != self.version:
            raise SystemExit(f"{modules}: {name} is {self.version}, npm's lock says {locked.get('version')}; run tools/setup")
        kind, _, digest = locked.get("integrity", "").partition("-")
        self.sha512 = base64.b64decode(digest).hex() if kind == "sha512" else None
        texts = sorted(glob.glob(os.path.join(modules, name, "LICEN[SC]E*")))
        self.notice = ""
        if texts:
            with open(texts[0], encoding="utf-8") as file:
                self.notice = file.read().strip()


def bundled(modules, listed):
    """Returns: the modules of the list that tools/viewer/bundle.mjs wrote; none without a page."""
    if not listed:
        return []
    with open(listed, encoding="utf-8") as file:
        return [Module(modules, name) for name in json.load(file)]
