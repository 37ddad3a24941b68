#!/usr/bin/env python3
"""Tests that tools/check_includes.py finds includes in the wrong direction, in quotes and in angle brackets alike."""

import os
import sys
import unittest

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(__file__), "..", "..", "tools"))
import check_includes  # noqa: E402


def wrong(path, *lines):
    return check_includes.wrong_includes(path, list(lines), own_header=lambda header: False)


class CheckIncludesTest(unittest.TestCase):
    def test_what_points_the_right_way_passes(self):
        self.assertEqual(wrong("gpu/a.cc", "#include <vector>", '#include "gpu/word.h"',
                               '#include "display/api/geometry.h"', '#include "absl/status/status.h"',
                               '#include <gtest/gtest.h>'), [])

    def test_quotes_that_point_the_wrong_way_are_found(self):
        self.assertEqual(wrong("gpu/a.cc", "", '#include "daemon/core/core.h"'),
                         ["gpu/a.cc:2: gpu must not include daemon/core/core.h"])

    def test_everybody_may_include_common_which_includes_nobody(self):
        self.assertEqual(wrong("gpu/a.cc", '#include "common/text/printable.h"'), [])
        self.assertEqual(wrong("common/text/a.cc", '#include "gpu/word.h"'),
                         ["common/text/a.cc:1: common must not include gpu/word.h"])

    def test_a_files_own_header_comes_first(self):
        lines = ["#include <vector>", '#include "gpu/a.h"']
        self.assertEqual(check_includes.wrong_includes("gpu/a.cc", lines, lambda path: path == "gpu/a.h"),
                         ["gpu/a.cc:1: gpu/a.h comes first, so that it is known to stand alone"])
        self.assertEqual(check_includes.wrong_includes("gpu/a.cc", lines[::-1], lambda path: True), [])
        self.assertEqual(check_includes.wrong_includes("gpu/a.cc", lines, lambda path: False), [])

    def test_angle_brackets_that_point_the_wrong_way_are_found(self):
        self.assertEqual(wrong("gpu/a.cc", "#include <daemon/core/core.h>"),
                         ["gpu/a.cc:1: <daemon/core/core.h> is one of ours; it must be written "
                          '"daemon/core/core.h"',
                          "gpu/a.cc:1: gpu must not include daemon/core/core.h"])
        self.assertIn("gpu/a.cc:1: gpu must not include voxeld/v1/scene.pb.h",
                      wrong("gpu/a.cc", "# include <voxeld/v1/scene.pb.h>"))
        self.assertIn("daemon/main.cc:1: product code includes a test's header",
                      wrong("daemon/main.cc", "#include <tests/e2e/process.h>"))

    def test_ours_in_angle_brackets_is_wrong_even_where_it_may_be_included(self):
        self.assertEqual(len(wrong("gpu/a.cc", "#include <gpu/word.h>")), 1)

    def test_grpc_stays_behind_its_doors(self):
        for include in ("#include <grpcpp/server.h>", '#include "grpcpp/server.h"',
                        "#include <voxeld/v1/scene.grpc.pb.h>"):
            self.assertEqual(len(wrong("daemon/core/core.cc", include)), 1, include)
            self.assertEqual(wrong("daemon/services/server.cc", include), [], include)
            self.assertEqual(len(wrong("daemon/services/server.h", include)), 1, include)

    def test_protobuf_stays_out_of_the_engine(self):
        self.assertEqual(len(wrong("gpu/a.cc", "#include <google/protobuf/message.h>")), 1)

    def test_a_folder_without_a_rule_is_told(self):
        self.assertEqual(wrong("util/a.cc"), ["util/a.cc: lies in no folder that has a rule"])


if __name__ == "__main__":
    unittest.main()
