"""What can go wrong, by who can mend it.

The text of each is the sentence that the command line prints: file, place, cause and remedy.
"""

from typing import Any


class Error(Exception):
    """Data from outside that cannot be used: the base of the classes below.

    `where` names file, line or element, `message` says cause and remedy.
    """

    where: str = ""
    message: str = ""


class FileError(Error, OSError):
    """A file that cannot be read or written."""


class FormatError(Error, ValueError):
    """A file whose content cannot be understood."""


class ModelError(Error, ValueError):
    """A model that cannot be simulated as given."""


class UnderdeterminedError(ModelError):
    """A joint that neither a spring nor an interface body holds."""


class NumericsError(Error, ArithmeticError):
    """A computation that did not end in finite, converged numbers."""


class UsageError(Error, ValueError):
    """An option or argument that makes no sense here."""


class UnknownNameError(Error, KeyError):
    """A body, control or other thing that the model does not have; the text lists those it has."""

    def __str__(self) -> str:  # KeyError would put the sentence in quotes
        return str(self.args[0])


class SweepError(Error, RuntimeError):
    """Every point of a sweep failed. `table` is the frame that `sweep` would have returned."""

    table: Any = None


class SweepWarning(UserWarning):
    """Points of a sweep that failed, and rows of its file that are computed again."""
