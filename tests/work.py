"""Exact measures of work, which do not depend on how busy or how fast the machine is."""

import sys

import numpy as np


class Name(str):
    """A name whose comparisons are Python code, so that a search through a list of names counts as work."""

    __slots__ = ()

    def __eq__(self, other):
        return str.__eq__(self, other)

    def __hash__(self):
        return str.__hash__(self)


def work_of(function, *arguments):
    """The number of bytecodes that a call executes, plus the number of elements in the arrays that functions return."""
    count = 0

    def trace(frame, event, value):
        nonlocal count
        frame.f_trace_lines = False
        frame.f_trace_opcodes = True
        if event == "opcode":
            count += 1
        elif event == "return" and isinstance(value, np.ndarray):
            count += value.size
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        function(*arguments)
    finally:
        sys.settrace(before)
    return count


def calls_of(function, *arguments):
    """The number of calls of functions, of Python or of C, that a call makes."""
    count = 0

    def profile(frame, event, value):
        nonlocal count
        count += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(profile)
    try:
        function(*arguments)
    finally:
        sys.setprofile(before)
    return count
