#!/usr/bin/env python3
"""Writes the components of voxeld as SPDX 2.3, and the notices of the components inside its programs.

They are determined from the programs and from the build: the libraries that they and their libraries name (ldd), the packages whose
headers or static libraries their compiler and linker read (Ninja's log), and the modules in the page (esbuild's report). The same build
of the same commit on the same system gives the same bytes.
"""
import argparse
import os
import re
import subprocess

import debian
import ninja_graph
import npm
import spdx

# A compiler's own parts in a program, which its exception exempts, and the kernel's interface: these need no notice.
NO_NOTICE = {"libc6-dev", "libgcc-12-dev", "libstdc++-12-dev", "linux-libc-dev", "libcrypt-dev"}


def shared_libraries(program):
    """Returns: (names that it needs itself, {name: path} of all)."""
    dynamic = subprocess.run(["readelf", "-dW", program], capture_output=True, text=True, check=True).stdout
    needed = set(re.findall(r"\(NEEDED\).*\[(.+)\]", dynamic))
    loaded = subprocess.run(["ldd", program], capture_output=True, text=True, check=True).stdout
    if missing := re.findall(r"(\S+) => not found", loaded):
        raise SystemExit(f"{program}: not found: {' '.join(missing)}")
    paths = dict(re.findall(r"^\s*(\S+) => (/\S+)", loaded, re.M))
    for path in re.findall(r"^\s*(/\S+) \(0x", loaded, re.M):
        paths[os.path.basename(path)] = path
    return needed, paths


def add_debian(document, package):
    """Adds a Debian package, once."""
    spdx_id = spdx.identifier("deb", package)
    if spdx_id in document.packages:
        return spdx_id
    described, licence = debian.describe(package), debian.Licence(package)
    document.licences.update(licence.texts)
    comment = f"Licences named in {licence.path}: {'; '.join(licence.names)}" if licence.names else ""
    if licence.path and not licence.names:
        comment = f"{licence.path} is prose; licenseConcluded is how it was read"
    distribution = os_release()
    return document.add(
        spdx_id, package, described["version"], declared=licence.expression, concluded=licence.concluded,
        supplier=f"Organization: {distribution['NAME']}", licenseComments=comment, homepage=described["homepage"],
        sourceInfo=f"built from {described['source']} {described['source_version']}",
        purl=spdx.purl(f"deb/{distribution['ID']}", package, described["version"], arch=described["architecture"],
                       distro=f"{distribution['ID']}-{distribution.get('VERSION_ID', 'unknown')}"))


def os_release():
    with open("/etc/os-release", encoding="utf-8") as file:
        return {key: value.strip('"') for key, value in re.findall(r"^(\w+)=(.*)$", file.read(), re.M)}


def add_modules(document, page, modules):
    for module in modules:
        spdx_id = document.add(
            spdx.identifier("npm", module.name), module.name, module.version, declared=module.licence, concluded=module.licence,
            homepage=module.homepage, purl=spdx.purl("npm", module.name, module.version),
            checksums=[{"algorithm": "SHA512", "checksumValue": module.sha512}] if module.sha512 else None)
        document.relate(page, "CONTAINS", spdx_id, "bundled, and made smaller, by esbuild")


def notices(modules, packages):
    """Returns: the notices for the components inside the programs: (name, version, text) of each."""
    parts = [(f"{module.name} {module.version} (npm), in the page that voxeld serves", module.notice) for module in modules]
    for package in packages:
        if package not in NO_NOTICE:
            parts.append((f"{package} {debian.describe(package)['version']} (Debian), code of its headers", debian.Licence(package).notice))
    empty = [name for name, text in parts if not text.strip()]
    if empty:
        raise SystemExit(f"no licence text for {', '.join(empty)}")
    return parts


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--build", required=True, help="the build's folder, of Ninja")
    parser.add_argument("--program", action="append", required=True, dest="programs", metavar="FILE", help="a program that is installed")
    parser.add_argument("--tool", action="append", default=[], dest="tools", metavar="FILE", help="a program that the build ran")
    parser.add_argument("--version", required=True)
    parser.add_argument("--epoch", required=True, type=int, help="when, in seconds since 1970")
    parser.add_argument("--modules", help="folder of npm's modules")
    parser.add_argument("--bundled", help="list of the modules in the page")
    parser.add_argument("--cuda", help="version of the CUDA runtime that is linked, if it is")
    parser.add_argument("--notice", action="append", default=[], dest="notices", metavar="FILE", help="a notice that is there already")
    parser.add_argument("--out", required=True, help="the document")
    parser.add_argument("--out-notices", required=True, help="the notices")
    options = parser.parse_args()

    document = spdx.Document("voxeld", options.version, options.epoch)
    voxeld = document.add("SPDXRef-voxeld", "voxeld", options.version, declared="Apache-2.0", concluded="Apache-2.0",
                          purl=spdx.purl("generic", "voxeld", options.version), primaryPackagePurpose="APPLICATION",
                          comment="voxeld, voxelctl and voxeld-engine; versions are those that it was built with")
    document.relate("SPDXRef-DOCUMENT", "DESCRIBES", voxeld)

    linked = set()
    for program in options.programs:
        needed, paths = shared_libraries(program)
        for name, path in paths.items():
            package = debian.package_of(os.path.realpath(path))
            if package is None:
                raise SystemExit(f"{program}: {path} is of no package")
            linked.add(package)
            document.relate(voxeld, "DYNAMIC_LINK" if name in needed else "DEPENDS_ON", add_debian(document, package))
    # If a program needs a library both itself and through another library, the first relationship is enough.
    for one, _, other in [key for key in document.relationships if key[1] == "DYNAMIC_LINK"]:
        document.relationships.discard((one, "DEPENDS_ON", other))

    read = {debian.package_of(path) for path in ninja_graph.files_read(options.build, options.programs)} - {None}
    # Excludes linked libraries, because static libraries and headers are in packages of their own.
    inside = sorted(read - linked)
    for package in inside:
        document.relate(voxeld, "STATIC_LINK", add_debian(document, package), "code of its headers or static libraries is compiled in")

    modules = npm.bundled(options.modules, options.bundled)
    add_modules(document, voxeld, modules)
    for tool in options.tools:
        if package := debian.package_of(os.path.realpath(tool)):
            document.relate(add_debian(document, package), "BUILD_TOOL_OF", voxeld)
    if options.bundled:
        esbuild = npm.Module(options.modules, "esbuild")
        document.relate(document.add(spdx.identifier("npm", "esbuild"), "esbuild", esbuild.version, declared=esbuild.licence,
                                     purl=spdx.purl("npm", "esbuild", esbuild.version)), "BUILD_TOOL_OF", voxeld)
    if options.cuda:
        document.licences["LicenseRef-NVIDIA-CUDA-EULA"] = "https://docs.nvidia.com/cuda/eula/"
        cuda = document.add("SPDXRef-cuda-cudart", "cuda-cudart-static", options.cuda, declared="LicenseRef-NVIDIA-CUDA-EULA",
                            supplier="Organization: NVIDIA", comment="Attachment A of the licence lists it as redistributable")
        document.relate(voxeld, "STATIC_LINK", cuda)
        for name in ("libcuda", "libnvrtc", "libnccl"):
            other = document.add(spdx.identifier("opened", name), name, "NOASSERTION", supplier="Organization: NVIDIA",
                                 comment="opened at run time where it is; not brought along")
            document.relate(other, "OPTIONAL_DEPENDENCY_OF", voxeld)

    with open(options.out, "w", encoding="utf-8") as file:
        file.write(document.text())
    with open(options.out_notices, "w", encoding="utf-8") as file:
        file.write("What others wrote and is inside voxeld's programs. voxeld.spdx.json beside this lists the libraries that they use, too.\n")
        for path in options.notices:
            with open(path, encoding="utf-8") as given:
                file.write(f"\n{'=' * 80}\n{given.read().strip()}\n")
        for name, text in notices(modules, inside):
            file.write(f"\n{'=' * 80}\n{name}\n\n{text.strip()}\n")


if __name__ == "__main__":
    main()
