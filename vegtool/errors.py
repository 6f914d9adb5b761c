"""Everything vegtool raises on purpose.

    VegtoolError            exit 1   root; catch this one
    ├── UsageError          exit 2   options that contradict each other or make no sense
    ├── InputError          exit 1   a file that is missing, broken or not a plant
    ├── OutputError         exit 1   a place that cannot be written, or would be overwritten
    ├── BatchError          exit 3   some inputs of a batch failed, others are done
    ├── QualityError        exit 4   a quality limit was missed
    └── CapabilityError     exit 5   a decoder, a GL feature or an optional part is missing

A message says what was expected, what was found, in which file, and what to do about it.
"""

from __future__ import annotations


class VegtoolError(Exception):
    """Root of all errors that vegtool raises on purpose."""

    exit_code = 1


class UsageError(VegtoolError):
    """Options that contradict each other or make no sense."""

    exit_code = 2


class InputError(VegtoolError):
    """A file that is missing, broken or not a plant."""


class OutputError(VegtoolError):
    """A place that cannot be written, or that would overwrite the user's files."""


class BatchError(VegtoolError):
    """Some inputs of a batch failed; the others are done."""

    exit_code = 3


class QualityError(VegtoolError):
    """A quality limit was missed."""

    exit_code = 4


class CapabilityError(VegtoolError):
    """A decoder, a GL feature or an optional part is missing here."""

    exit_code = 5


def unknown(error: Exception) -> str:
    """The sentence for an error that is none of these: a bug."""
    return (
        f"vegtool failed in a way that it does not know ({type(error).__name__}: {error});"
        " this is a bug: run again with -vv and report what it prints"
    )
