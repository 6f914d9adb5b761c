"""Options declared once: a dataclass field carries its default, help text and limits.

Operations read the fields; the command line makes its flags from them (cli.py); the manifest
writes them down. Nothing here knows about any of those.
"""

from __future__ import annotations

from dataclasses import MISSING, Field, field, fields
from typing import Any

from vegtool.errors import UsageError


def option(
    default: Any,
    help: str,
    *,
    short: str | None = None,
    least: float | None = None,
    most: float | None = None,
    choices: tuple[str, ...] = (),
    metavar: str | None = None,
) -> Any:
    """A dataclass field with what a person needs to know of it.

    least, most: inclusive limits of a number. choices: the values that a word may take.
    """
    about = {
        "help": help,
        "short": short,
        "least": least,
        "most": most,
        "choices": choices,
        "metavar": metavar,
    }
    return field(default=default, metadata=about)


def same_option(options: type, name: str) -> Any:
    """A field for an option that another options dataclass has already."""
    same = next(item for item in fields(options) if item.name == name)
    return field(default=same.default, metadata=same.metadata)


def check_limits(options: Any) -> None:
    """Hold every field of an options dataclass to its limits and choices.

    Raises UsageError saying what was expected and what was found.
    """
    for item in fields(options):
        value, about = getattr(options, item.name), item.metadata
        flag = flag_of(item)
        if about.get("choices") and value not in about["choices"]:
            raise UsageError(f"{flag}: expected one of {', '.join(about['choices'])}; got {value}")
        least, most = about.get("least"), about.get("most")
        if value is None or (least is None and most is None):
            continue
        if (least is not None and not value >= least) or (most is not None and not value <= most):
            limits = (
                f"{_plain(least)} to {_plain(most)}"
                if most is not None
                else (f"at least {_plain(least)}")
            )
            raise UsageError(f"{flag}: expected {limits}; got {_plain(value)}")


def flag_of(item: Field[Any]) -> str:
    """The command line's name of a field."""
    return "--" + item.name.replace("_", "-")


def default_of(item: Field[Any]) -> Any:
    """A field's default value."""
    return item.default_factory() if item.default_factory is not MISSING else item.default


def _plain(number: float | None) -> str:
    return (
        "any"
        if number is None
        else f"{number:,.6g}"
        if isinstance(number, float)
        else f"{number:,}"
    )
