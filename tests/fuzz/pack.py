"""Packs what tests/fuzz/run.sh needs on a machine without this tree: programs, their libraries, corpora, dictionaries. For tools/fuzz --pack."""
import pathlib
import re
import shlex
import shutil
import subprocess
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
# Targets that take microseconds for an input; a program with more edges than their own would slow them down.
ALONE = {"expression_program", "expression_text", "greeting", "light_datagrams", "network_packets", "opc_stream", "pictures", "voxlink_capabilities"}


def libraries(programs):
    """Returns the shared libraries that these programs and their libraries need, except glibc's own: name → path."""
    glibc = re.compile(r"(ld-linux-x86-64|libc|libm|libdl|librt|libpthread|libresolv|libutil|libanl)\.so")
    told = subprocess.run(["ldd", *map(str, programs)], capture_output=True, text=True, check=True).stdout
    return {name: path for name, path in re.findall(r"^\s*(\S+) => (/\S+)", told, re.M) if not glibc.match(name)}


def link_of(build, name):
    """Returns how a program is linked: all words of the command, and its objects."""
    told = subprocess.run(["ninja", "-C", str(build), "-t", "commands", name], capture_output=True, text=True, check=True).stdout
    words = [word.replace("\\$", "$") for word in shlex.split(told.splitlines()[-1])]
    return words, [word for word in words if word.endswith(".o")]


def is_library(word):
    return word.endswith(".a") or word.startswith("-l") or (".so" in word and not word.startswith("-Wl"))


def together(names, build, folder):
    """Links the targets of these names and hostile_exchanges into one program. Returns its path."""
    words, objects = link_of(build, "hostile_exchanges")
    entry = lambda name: "Fuzz" + "".join(part.capitalize() for part in name.split("_"))
    inputs, needed = [], [w for w in words if is_library(w)]

    def take(path, was, becomes):
        inputs.append(folder / f"{len(inputs)}.o")
        subprocess.run(["objcopy", "--redefine-sym", f"{was}={becomes}", str(build / path), str(inputs[-1])], check=True)

    for path in objects:
        take(path, "main", "HostileExchanges")
    there = {name for name in names if any(path.endswith(f"/{name}_fuzz.cc.o") for path in objects)}
    for name in sorted(set(names) - there):
        own, paths = link_of(build, f"{name}_fuzz")
        needed += [w for w in own if is_library(w) and w not in needed]
        for path in paths:
            take(path, "LLVMFuzzerTestOneInput", entry(name))
    (folder / "packed_targets.inc").write_text("".join(f"TARGET({name}, {entry(name)})\n" for name in sorted(names)))
    compiler, flags, skip = words[words.index(":") + 2] if ":" in words[:2] else words[0], [], False
    for word in words:
        if skip or word == "-o":
            skip = word == "-o"
        elif word.startswith("-") and not is_library(word):
            flags.append(word)
    inputs.append(folder / "main.o")
    subprocess.run([compiler, "-std=c++20", "-O1", "-fPIE", f"-I{folder}", "-c", str(HERE / "packed_main.cc"), "-o", str(inputs[-1])], check=True)
    program = folder / "packed_fuzz"
    # Some sources are in several targets, and are the same in all of them.
    subprocess.run([compiler, *flags, "-fsanitize=fuzzer", "-Wl,-z,muldefs", *map(str, inputs), "-Wl,--start-group", *needed, "-Wl,--end-group", "-o", str(program)],
                   cwd=build, check=True)
    return program


def pack(targets, build, folder, commit):
    """Writes `folder` and `folder`.tar.xz with these targets (tools/fuzz), as they are built. Raises ValueError if the folder has something else."""
    if folder.exists() and not (folder / "COMMIT").exists():
        raise ValueError(f"{folder} is there, and nothing that --pack wrote; name another")
    shutil.rmtree(folder, ignore_errors=True)
    for name in ("bin", "lib", "options", "dict"):
        (folder / name).mkdir(parents=True)
    with tempfile.TemporaryDirectory() as work:
        packed = [t.name for t in targets if t.name not in ALONE]
        programs = {"packed_fuzz": together(packed, build, pathlib.Path(work))} | {t.program.name: t.program for t in targets if t.name in ALONE}
        for name, program in programs.items():
            # Coverage is reported where the tree is.
            subprocess.run(["objcopy", "--strip-all", "-R", "__llvm_covmap", "-R", "__llvm_covfun", str(program), str(folder / "bin" / name)], check=True)
        needed = libraries([build / "bin/tests/hostile_exchanges", *(t.program for t in targets)])
    for name in ["hostile_exchanges"] + [f"{name}_fuzz" for name in packed]:
        (folder / "bin" / name).symlink_to("packed_fuzz")
    for name, path in needed.items():
        subprocess.run(["strip", "--strip-unneeded", "-o", str(folder / "lib" / name), path], check=True)
    for target in targets:
        shutil.copytree(target.corpus, folder / "corpus" / target.name)
        chosen = [f"-max_len={target.max_len}"]
        if target.words:
            (folder / "dict" / target.dict.name).write_text(target.words)
            chosen.append(f"-dict=dict/{target.dict.name}")
        (folder / "options" / target.name).write_text("\n".join(chosen) + "\n")
    (folder / "COMMIT").write_text(commit + "\n")
    shutil.copy(HERE / "run.sh", folder)
    archive = folder.with_name(folder.name + ".tar.xz")
    subprocess.run(f"tar -C {shlex.quote(str(folder.parent))} --owner=0 --group=0 --sort=name -cf - {shlex.quote(folder.name)}"
                   f" | xz -T1 --x86 --lzma2=preset=2,dict=128MiB >{shlex.quote(str(archive))}", shell=True, check=True)
    print(f"{len(targets)} targets and hostile_exchanges, {archive.stat().st_size / 2**20:.1f} MiB packed: {archive}")
