#!/usr/bin/env python3
"""The corpora of the fuzz targets: one archive a target in the tree, one folder a target in a build.

`corpus/TARGET.tar.xz` holds all inputs of a target but its regressions. Those stay readable, one file each: `corpus/TARGET/broke-…`.
`corpus/inputs.csv` lists how many inputs each archive holds. A build unpacks both kinds into one folder a target; tools/fuzz --merge
writes the archives.

  tests/fuzz/corpora.py unpack FOLDER [TARGET …]   unpack into FOLDER/TARGET (without targets: all); an unchanged folder is left as it is
  tests/fuzz/corpora.py pack TARGET FOLDER         write the archive of TARGET from the files in FOLDER, without its `broke-…` files
"""
import argparse
import csv
import hashlib
import io
import lzma
import os
import pathlib
import re
import shutil
import sys
import tarfile

CORPUS = pathlib.Path(__file__).resolve().parent / "corpus"
REGRESSION = "broke-"
INPUT = re.compile(r"[0-9A-Za-z][0-9A-Za-z._-]*")
FIELDS = ["target", "inputs", "bytes"]


class CorpusError(Exception):
    """An archive or a folder is not a valid corpus; the message names it."""


def archive_of(target, corpus=CORPUS):
    return corpus / f"{target}.tar.xz"


def targets(corpus=CORPUS):
    """Returns the names of all targets that have an archive or regressions."""
    names = {path.name.removesuffix(".tar.xz") for path in corpus.glob("*.tar.xz")}
    return sorted(names | {path.name for path in corpus.iterdir() if path.is_dir()})


def regressions(target, corpus=CORPUS):
    """Returns the paths of the inputs that once broke the target."""
    return sorted((corpus / target).glob(f"{REGRESSION}*"))


def read_archive(path):
    """Returns the inputs of an archive: name → bytes. Refuses everything but plain files without a folder in their names."""
    inputs = {}
    try:
        # All of it is decompressed first: tarfile alone does not notice that an archive is truncated.
        with tarfile.open(fileobj=io.BytesIO(lzma.decompress(path.read_bytes())), mode="r:") as archive:
            for member in archive:
                # An input is written under its name, so a name must not lead out of the target's folder.
                if not member.isreg() or not INPUT.fullmatch(member.name) or member.name.startswith(REGRESSION):
                    raise CorpusError(f'{path}: "{member.name}" is not a valid input: expected a plain file without a folder in its name, not {REGRESSION}…')
                if member.name in inputs:
                    raise CorpusError(f'{path}: "{member.name}" is there twice')
                inputs[member.name] = archive.extractfile(member).read()
    except (tarfile.TarError, lzma.LZMAError, EOFError) as error:
        raise CorpusError(f"{path} cannot be read: {error}") from error
    return inputs


def write_archive(path, inputs):
    """Writes an archive of these inputs (name → bytes). The same inputs give the same bytes, regardless of who writes them and when."""
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w", format=tarfile.USTAR_FORMAT) as archive:
        for name, data in sorted(inputs.items()):
            if not INPUT.fullmatch(name) or name.startswith(REGRESSION):
                raise CorpusError(f'"{name}" is not a valid name of an input in {path}')
            member = tarfile.TarInfo(name)  # owner 0, time 0
            member.size = len(data)
            member.mode = 0o644
            archive.addfile(member, io.BytesIO(data))
    # The file is replaced at once, so that an interrupted call leaves the old one.
    fresh = path.with_name(path.name + ".new")
    fresh.write_bytes(lzma.compress(packed.getvalue(), preset=9 | lzma.PRESET_EXTREME))
    os.replace(fresh, path)


def read_list(corpus=CORPUS):
    """Returns what inputs.csv says: target → (number of inputs in the archive, their bytes)."""
    path = corpus / "inputs.csv"
    if not path.exists():
        return {}
    with path.open(newline="") as rows:
        return {row["target"]: (int(row["inputs"]), int(row["bytes"])) for row in csv.DictReader(rows)}


def pack(target, inputs, corpus=CORPUS):
    """Writes the archive of a target and its line in inputs.csv."""
    write_archive(archive_of(target, corpus), inputs)
    listed = read_list(corpus) | {target: (len(inputs), sum(map(len, inputs.values())))}
    with (corpus / "inputs.csv").open("w", newline="") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(FIELDS)
        writer.writerows([name, *numbers] for name, numbers in sorted(listed.items()))


def state_of(target, corpus):
    """Returns a checksum of all that a target's folder is made from."""
    state = hashlib.sha256()
    for path in [archive_of(target, corpus), *regressions(target, corpus)]:
        if path.exists():
            data = path.read_bytes()
            state.update(f"{path.name} {len(data)}\n".encode() + data)
    return state.hexdigest()


def unpack(target, folder, corpus=CORPUS):
    """Makes folder/TARGET hold exactly the inputs of the target. Returns True if it was made again, False if it was up to date."""
    made, mark = folder / target, folder / f"{target}.unpacked"
    state = state_of(target, corpus)
    if made.is_dir() and mark.exists() and mark.read_text() == state:
        return False
    inputs = read_archive(archive_of(target, corpus)) if archive_of(target, corpus).exists() else {}
    inputs |= {path.name: path.read_bytes() for path in regressions(target, corpus)}
    fresh = folder / f"{target}.new"
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    for name, data in inputs.items():
        (fresh / name).write_bytes(data)
    # Without its mark, a folder that was left half replaced is made again.
    mark.unlink(missing_ok=True)
    shutil.rmtree(made, ignore_errors=True)
    os.replace(fresh, made)
    mark.write_text(state)
    return True


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("unpack", help="unpack the corpora of a build")
    command.add_argument("folder", type=pathlib.Path)
    command.add_argument("target", nargs="*")
    command = commands.add_parser("pack", help="write a target's archive")
    command.add_argument("target")
    command.add_argument("folder", type=pathlib.Path)
    args = parser.parse_args()
    try:
        if args.command == "unpack":
            for target in args.target or targets():
                unpack(target, args.folder)
        else:
            pack(args.target, {path.name: path.read_bytes() for path in args.folder.iterdir() if not path.name.startswith(REGRESSION)})
    except (CorpusError, OSError) as error:
        print(f"corpora.py: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
