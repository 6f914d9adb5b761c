"""Command line flags made from options dataclasses, so that no option is declared twice.

A command names an options dataclass as the annotation of a parameter; `flags` takes that parameter
apart into one flag per field, with the field's default, help and limits, and puts the dataclass
together again before the command runs.
"""

from __future__ import annotations

import inspect
import re
import tomllib
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, Literal, get_type_hints

import typer

from vegtool.errors import UsageError
from vegtool.options import check_limits, default_of, flag_of


def flags(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command one flag per field of each options dataclass among its parameters."""
    hints = get_type_hints(command, include_extras=True)
    parameters: list[inspect.Parameter] = []
    groups: dict[str, Any] = {}
    for parameter in inspect.signature(command).parameters.values():
        kind = hints[parameter.name]
        if not (isinstance(kind, type) and is_dataclass(kind)):
            parameters.append(parameter.replace(annotation=kind))
            continue
        groups[parameter.name] = kind
        field_hints = get_type_hints(kind)
        parameters += [_flag(item, field_hints[item.name], kind.__name__) for item in fields(kind)]

    @wraps(command)
    def run(**values: Any) -> None:
        for name, kind in groups.items():
            given = {item.name: values.pop(item.name) for item in fields(kind)}
            options = kind(**{k: tuple(v) if isinstance(v, list) else v for k, v in given.items()})
            check_limits(options)
            values[name] = options
        command(**values)

    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {p.name: p.annotation for p in parameters}
    return run


def _flag(item: Any, hint: Any, group: str) -> inspect.Parameter:
    about, default = item.metadata, default_of(item)
    names = [flag_of(item)] + ([f"-{about['short']}"] if about.get("short") else [])
    if isinstance(default, tuple):
        hint, default, names = list[str], list(default), [names[0].removesuffix("s"), *names[1:]]
    if about.get("choices"):
        hint = Literal[about["choices"]]
    setting = typer.Option(
        *names,
        help=_literal(about.get("help", "")),
        metavar=about.get("metavar"),
        rich_help_panel=_panel(group),
    )
    return inspect.Parameter(
        item.name,
        inspect.Parameter.KEYWORD_ONLY,
        default=default,
        annotation=Annotated[hint, setting],
    )


def _literal(text: str) -> str:
    """Text that means what it says where rich's markup is read, to which [words] are styles.

    As `rich.markup.escape`, which takes longer to load than all flags to make.
    """
    return re.sub(r"(\[[a-z#/@][^\[]*?\])", r"\\\1", text)


def _panel(group: str) -> str:
    titles = {
        "ConvertOptions": "Levels of detail",
        "MeasureOptions": "Measuring",
        "PreviewOptions": "What is shown",
        "ReportOptions": "What is compared",
        "ReadOptions": "Reading",
    }
    return titles.get(group, group)


def read_config(context: typer.Context, path: Path | None) -> Path | None:
    """Callback of `--config`: the file's keys become the defaults of this command's flags.

    A key is the long name of a flag. Raises UsageError with the line of a key that is unknown or
    has no value of its flag's kind.
    """
    if path is None:
        return None
    try:
        text = path.read_text(encoding="utf-8")
        values = tomllib.loads(text)
    except OSError as error:
        raise UsageError(f"{path}: cannot read this configuration ({error.strerror})") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"{path}: expected TOML; {error}") from error
    known = {
        name.removeprefix("--").replace("-", "_"): p
        for p in context.command.params
        if p.param_type_name == "option" and p.name not in ("config", "help")
        for name in p.opts
        if name.startswith("--")
    }
    found: dict[str, Any] = {}
    for key, value in values.items():
        option = known.get(key.replace("-", "_"))
        if isinstance(value, dict):
            raise UsageError(f"{_place(path, text, key)}: expected keys alone, found a [{key}]")
        if option is None:
            choices = ", ".join(sorted(known))
            raise UsageError(
                f"{_place(path, text, key)}: no option is called {key!r}; known: {choices}"
            )
        if isinstance(value, bool) and not getattr(option, "is_flag", False):
            raise UsageError(
                f"{_place(path, text, key)}: expected a value for {key}, found {str(value).lower()}"
            )
        found[str(option.name)] = [value] if option.multiple and isinstance(value, str) else value
    context.default_map = {**(context.default_map or {}), **found}
    return path


def _place(path: Path, text: str, key: str) -> str:
    """File and line of a key, as far as a plain search can tell."""
    start = re.compile(rf"""\s*\[?["']?{re.escape(key)}\b""")
    line = next((i for i, t in enumerate(text.splitlines(), 1) if start.match(t)), None)
    return f"{path}, line {line}" if line else f"{path}"
