"""Finds which argument was meant when a drawing call does not have the given one."""
from __future__ import annotations

import difflib
import functools
import inspect
from typing import Any, Callable, Iterable, Type, TypeVar

from .errors import InvalidOption
from .look import Look

Drawing = TypeVar("Drawing")

LOOK = tuple(inspect.signature(Look.of).parameters)

# Names used by the wire, `voxelctl draw` and other libraries, and their names here, for calls that have those.
_ELSEWHERE = {
    "alignment": ("align",), "at": ("transform",), "boundary_points": ("boundary",), "cells": ("array",), "colormap": ("cmap",),
    "edge_a": ("edges",), "edge_b": ("edges",), "edge_c": ("edges",), "grid": ("array",), "indices": ("faces",), "linewidth": ("width",),
    "normal": ("facing",), "object": ("of",), "parameter_names": ("parameters",), "parameter_values": ("parameters",),
    "picture": ("texture",), "points": ("positions", "curves"), "red": ("rgb",), "green": ("rgb",), "blue": ("rgb",),
    "rotation": ("transform",), "s": ("width",), "scale": ("transform",), "size": ("height", "width", "radius"), "text": ("content",),
    "thickness": ("width", "shell"), "topology": ("mode",), "transfer": ("values",), "turn": ("transform",),
    "vertices": ("positions", "points", "patches"), "xyz": ("positions", "points")}
_CALLS = {"segments": "lines", "line": "lines", "point": "points", "scatter": "points", "plot": "lines", "label": "text"}


def _meant(word: str, known: Iterable[str]) -> str:
    there = list(known)
    for other in _ELSEWHERE.get(word, ()):
        if other in there:
            return other
    return next(iter(difflib.get_close_matches(word, there, 1)), "")


def refused(call: str, option: str, takes: Iterable[str]) -> InvalidOption:
    there = list(takes)
    meant = _meant(option, there)
    right = f"did you mean {meant!r}?" if meant else f"it takes {', '.join(there)}"
    return InvalidOption(f"{call}() has no option {option!r}; {right}")


def _checked(method: Callable[..., Any]) -> Callable[..., Any]:
    parameters = list(inspect.signature(method).parameters.values())[1:]
    takes = [one.name for one in parameters if one.kind is not one.VAR_KEYWORD]
    if len(takes) < len(parameters):
        takes += LOOK
    known = frozenset(takes)

    @functools.wraps(method)
    def call(*args: Any, **options: Any) -> Any:
        for option in options:
            if option not in known:
                raise refused(method.__name__, option, takes)
        return method(*args, **options)

    return call


@functools.lru_cache(maxsize=None)
def leading_names(method: Callable[..., Any], count: int) -> tuple[str, ...]:
    """Returns the names of a drawing call's first `count` positional arguments after the name."""
    return tuple(inspect.signature(method).parameters)[2:2 + count]


def named(cls: Type[Drawing]) -> Type[Drawing]:
    """Makes every public method refuse unknown options under its own name, and suggest which may have been meant."""
    for name, method in list(vars(cls).items()):
        if not name.startswith("_") and inspect.isfunction(method):
            setattr(cls, name, _checked(method))
    return cls


def no_call(where: object, name: str) -> AttributeError:
    """Returns the error for a missing method or field `name`."""
    meant = _CALLS.get(name)
    if meant is None and not name.startswith("_"):
        meant = next(iter(difflib.get_close_matches(name, [one for one in dir(type(where)) if not one.startswith("_")], 1)), None)
    kind = type(where).__name__
    return AttributeError(f"{kind!r} has no {name!r}" + (f"; did you mean {meant!r}?" if meant else ""), name=name, obj=where)
