#!/usr/bin/env python3
"""Tests the archives of the corpora: those in the tree are complete, and files that are not a corpus are refused."""
import io
import os
import pathlib
import sys
import tarfile
import tempfile
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import corpora  # noqa: E402
from corpora import CORPUS, CorpusError  # noqa: E402


def members(path):
    with tarfile.open(path, "r:xz") as archive:
        return archive.getmembers()


class TreeTest(unittest.TestCase):
    """The archives in the tree."""

    def test_every_target_has_an_archive_and_a_line_in_the_list(self):
        named = {path.name.removesuffix("_fuzz.cc") for path in CORPUS.parent.glob("*/*_fuzz.cc")}
        self.assertEqual(set(corpora.targets()), named)
        self.assertEqual(set(corpora.read_list()), named)
        self.assertEqual({path.name.removesuffix(".tar.xz") for path in CORPUS.glob("*.tar.xz")}, named)

    def test_archives_hold_the_inputs_that_are_listed(self):
        for target, listed in corpora.read_list().items():
            inputs = corpora.read_archive(corpora.archive_of(target))
            self.assertEqual((len(inputs), sum(map(len, inputs.values()))), listed, target)

    def test_archives_depend_on_nothing_but_their_inputs(self):
        for target in corpora.targets():
            found = members(corpora.archive_of(target))
            self.assertEqual([m.name for m in found], sorted(m.name for m in found), target)
            self.assertEqual({(m.type, m.mode, m.uid, m.gid, m.uname, m.gname, m.mtime) for m in found}, {(tarfile.REGTYPE, 0o644, 0, 0, "", "", 0)}, target)

    def test_folders_of_the_tree_hold_regressions_only(self):
        for path in CORPUS.glob("*/*"):
            self.assertTrue(path.name.startswith(corpora.REGRESSION) and path.is_file(), path)
            self.assertLess(path.stat().st_size, 16384, f"{path} is not a small file")

    def test_unpacked_folders_hold_archives_and_regressions(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            for target, (count, _) in corpora.read_list().items():
                self.assertTrue(corpora.unpack(target, folder))
                names = {path.name for path in (folder / target).iterdir()}
                self.assertEqual(len(names), count + len(corpora.regressions(target)), target)
                self.assertLessEqual({path.name for path in corpora.regressions(target)}, names)


class UnpackTest(unittest.TestCase):
    def setUp(self):
        self.work = tempfile.TemporaryDirectory()
        self.addCleanup(self.work.cleanup)
        self.corpus = pathlib.Path(self.work.name) / "corpus"
        self.folder = pathlib.Path(self.work.name) / "made"
        self.corpus.mkdir()

    def unpack(self):
        return corpora.unpack("store", self.folder, self.corpus)

    def content(self):
        return {path.name: path.read_bytes() for path in (self.folder / "store").iterdir()}

    def test_same_inputs_give_the_same_archive(self):
        corpora.pack("store", {"b": b"2", "a": b"1"}, self.corpus)
        first = corpora.archive_of("store", self.corpus).read_bytes()
        corpora.pack("store", {"a": b"1", "b": b"2"}, self.corpus)
        self.assertEqual(corpora.archive_of("store", self.corpus).read_bytes(), first)
        self.assertEqual(corpora.read_list(self.corpus), {"store": (2, 2)})

    def test_a_folder_follows_the_archive_and_the_regressions(self):
        corpora.pack("store", {"a": b"1", "b": b"2"}, self.corpus)
        self.assertTrue(self.unpack())
        self.assertFalse(self.unpack())
        corpora.pack("store", {"b": b"3"}, self.corpus)
        self.assertTrue(self.unpack())
        self.assertEqual(self.content(), {"b": b"3"})
        (self.corpus / "store").mkdir()
        (self.corpus / "store/broke-it").write_bytes(b"4")
        self.assertTrue(self.unpack())
        self.assertEqual(self.content(), {"b": b"3", "broke-it": b"4"})

    def test_a_new_target_has_regressions_before_it_has_an_archive(self):
        (self.corpus / "store").mkdir()
        (self.corpus / "store/broke-it").write_bytes(b"4")
        self.assertEqual(corpora.targets(self.corpus), ["store"])
        self.assertTrue(self.unpack())
        self.assertEqual(self.content(), {"broke-it": b"4"})

    def refused(self, *made, data=b""):
        with tarfile.open(corpora.archive_of("store", self.corpus), "w:xz") as archive:
            for member in made:
                member.size = len(data)
                archive.addfile(member, io.BytesIO(data))
        with self.assertRaisesRegex(CorpusError, "store.tar.xz: "):
            self.unpack()
        self.assertFalse((self.folder / "store").exists())

    def test_names_that_lead_out_are_refused(self):
        for name in ("../out", "/tmp/out", "a/../../out", "a/b", "..", ".hidden", "a\nb", "broke-it"):
            self.refused(tarfile.TarInfo(name))

    def test_what_is_no_plain_file_is_refused(self):
        for kind in (tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.DIRTYPE, tarfile.FIFOTYPE, tarfile.CHRTYPE):
            member = tarfile.TarInfo("a")
            member.type, member.linkname = kind, "/etc/passwd"
            self.refused(member)

    def test_a_name_that_is_there_twice_is_refused(self):
        self.refused(tarfile.TarInfo("a"), tarfile.TarInfo("a"), data=b"1")

    def test_a_damaged_archive_is_refused_and_the_old_folder_stays(self):
        corpora.pack("store", {"a": b"1" * 5000}, self.corpus)
        self.unpack()
        path = corpora.archive_of("store", self.corpus)
        whole = path.read_bytes()
        for damaged in (b"", b"no archive", whole[: len(whole) // 2], whole[:-20]):
            path.write_bytes(damaged)
            with self.assertRaisesRegex(CorpusError, "cannot be read"):
                self.unpack()
        self.assertEqual(self.content(), {"a": b"1" * 5000})

    def test_a_list_of_another_name_is_not_packed(self):
        with self.assertRaises(CorpusError):
            corpora.pack("store", {"../a": b""}, self.corpus)


if __name__ == "__main__":
    unittest.main()
