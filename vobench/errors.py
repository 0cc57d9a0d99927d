"""Every error that vobench raises on purpose, in one tree.

VobenchError               the user's mistake or machine: one line, exit code 1
├── InputError             a file does not say what it should
│   ├── SuiteError         a suite, scene or manifest: names file, line, key and value
│   └── TrajectoryError    a trajectory file or array
├── UnknownNameError       no scene, suite or estimator of that name
├── MissingDependencyError this machine lacks something; the message says how to get it
├── AlignmentError         two trajectories cannot be compared as asked
├── MotionError            the robot cannot drive as asked
├── RenderError            the renderer cannot make this picture
└── SequenceError          a recording is incomplete, torn or of another form
"""


class VobenchError(Exception):
    """Something the person at the keyboard can mend; the message is one line."""


class InputError(VobenchError):
    """A file does not say what it should."""


class SuiteError(InputError):
    """A suite, scene or manifest is wrong; the message names file, line, key and value."""


class TrajectoryError(InputError):
    """A trajectory file or array is wrong."""


class UnknownNameError(VobenchError):
    """No scene, suite or estimator of that name."""


class MissingDependencyError(VobenchError):
    """This machine lacks something; the message says how to get it."""


class AlignmentError(VobenchError):
    """Two trajectories cannot be compared as asked."""


class MotionError(VobenchError):
    """The robot cannot drive as asked."""


class RenderError(VobenchError):
    """The renderer cannot make this picture."""


class SequenceError(VobenchError):
    """A recording is incomplete, torn or of another form."""
