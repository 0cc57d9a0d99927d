"""evo's spelling of alignments on the command line: -a, -s, -as and -va."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, get_args

import typer
from typer.core import TyperCommand

from vobench.trajectory.align import AlignmentKind

ALIGN = "-a"
END_OF_OPTIONS = "--"
# Several of evo's flags in one word: align, correct scale and verbose. vobench always prints what -v adds in evo.
EVO_FLAGS = re.compile(r"-(?=.*[as])[asv]+")
KIND_BY_FLAGS: dict[frozenset[str], AlignmentKind] = {
    frozenset("a"): "se3",
    frozenset("s"): "scale",
    frozenset("as"): "sim3",
}


class EvoAlignCommand(TyperCommand):
    """A command with an option --align (-a) that also understands evo's flags."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse words in which evo's flags are replaced."""
        return super().parse_args(ctx, without_evo_flags(args))


def without_evo_flags(words: Sequence[str]) -> list[str]:
    """Words of a command line with `-a KIND` in place of evo's flags.

    An -a without a kind is evo's. What follows -a is a kind unless it is an option or an existing file.

    Raises typer.BadParameter if both -a KIND and a flag of evo are given.
    """
    end = words.index(END_OF_OPTIONS) if END_OF_OPTIONS in words else len(words)
    options = words[:end]
    remaining = list[str]()
    flags = set[str]()
    for index, word in enumerate(options):
        has_kind = word == ALIGN and _is_kind(options[index + 1 : index + 2])
        if EVO_FLAGS.fullmatch(word) and not has_kind:
            flags |= set(word.strip("-v"))
        else:
            remaining.append(word)
    if not flags:
        return list(words)
    if ALIGN in remaining:
        raise typer.BadParameter(f"give either {ALIGN} with a kind of alignment, or evo's flags -a, -s and -as")
    return [ALIGN, KIND_BY_FLAGS[frozenset(flags)], *remaining, *words[end:]]


def _is_kind(following: Sequence[str]) -> bool:
    """Whether the word that follows -a, if there is one, is meant as a kind of alignment, right or wrong."""
    if not following:
        return False
    (word,) = following
    if word in get_args(AlignmentKind):
        return True
    return not word.startswith("-") and not Path(word).exists()
