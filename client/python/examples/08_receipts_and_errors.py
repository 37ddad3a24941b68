#!/usr/bin/env python3
"""Errors are raised locally where the client can detect them, and reported by the server otherwise; none is silent."""
from typing import Callable

import numpy as np

import voxeld as voxel

with voxel.connect(name="errors", on_issue=lambda issue: print("issue:", issue)) as v:
    cloud = np.random.default_rng(1).uniform(-1, 1, (1000, 3))
    with_nan = cloud.copy()
    with_nan[17, 2] = np.nan
    caught = 0
    mistakes: list[Callable[[], object]] = [
        lambda: v.points("cloud", cloud.T), lambda: v.points("cloud", with_nan),
        lambda: v.points("cloud", cloud, colors="oragne"), lambda: v.sphere("ball", radius=0)]
    for mistake in mistakes:
        try:
            mistake()
        except voxel.VoxelError as error:
            caught += 1
            print(f"{type(error).__name__}: {error}")
    assert caught == 4 and v.counts["commits"] == 0

    frame = v.instance("nobody", "an object that was never defined").frame
    assert frame is not None
    accepted = frame.wait(timeout=10).accepted
    assert accepted is not None and accepted.refused_operations == 1
    assert [issue.reason for issue in frame.issues] == ["NOT_FOUND"]

with voxel.connect(name="strict", strict=True, on_issue=lambda issue: None) as v:
    with v.batch() as frames:
        v.sphere("ball")
        v.instance("nobody", "an object that was never defined")
    try:
        frames[0].wait(timeout=10)
    except voxel.CommitRefused as error:
        print("refused:", error)
        assert not v.entities() and len(error.issues) == 1
    else:
        raise SystemExit("a strict session took a commit with a refused operation")
