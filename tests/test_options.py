"""Options are declared once: limits, flags, configuration files."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from vegtool.convert import ConvertOptions
from vegtool.errors import UsageError
from vegtool.flags import flags, read_config
from vegtool.options import check_limits, flag_of, option


@dataclass(frozen=True)
class Knobs:
    number: int = option(4, "A number.", least=1, most=9, short="n")
    word: str = option("red", "A colour.", choices=("red", "green"))
    many_names: tuple[str, ...] = option((), "Several.")


def app() -> typer.Typer:
    made = typer.Typer(pretty_exceptions_enable=False)

    @made.command("turn")
    @flags
    def turn(
        *,
        knobs: Knobs,
        config: Annotated[
            Path | None, typer.Option("--config", is_eager=True, callback=read_config)
        ] = None,
    ) -> None:
        print(knobs)

    return made


def test_a_flag_per_field_and_the_dataclass_put_together_again() -> None:
    done = CliRunner().invoke(
        app(), ["-n", "7", "--word", "green", "--many-name", "a", "--many-name", "b"]
    )
    assert done.output.strip() == "Knobs(number=7, word='green', many_names=('a', 'b'))"


def test_defaults_come_from_the_fields() -> None:
    assert CliRunner().invoke(app(), []).output.strip() == str(Knobs())


@pytest.mark.parametrize(
    ("knobs", "sentence"),
    [
        (Knobs(number=0), "--number: expected 1 to 9; got 0"),
        (Knobs(word="blue"), "--word: expected one of red, green; got blue"),
    ],
)
def test_limits_say_expected_and_found(knobs: Knobs, sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        check_limits(knobs)


@pytest.mark.parametrize("count", [0, -3, 10_000_000])
def test_absurd_numbers_of_billboards_are_refused(count: int) -> None:
    with pytest.raises(UsageError, match="--billboards"):
        check_limits(ConvertOptions(billboards=count))


def test_nan_is_outside_every_limit() -> None:
    with pytest.raises(UsageError, match="--fov"):
        check_limits(ConvertOptions(fov=float("nan")))


def test_a_configuration_file_gives_defaults_and_flags_win(tmp_path: Path) -> None:
    config = tmp_path / "a.toml"
    config.write_text('number = 3\nword = "green"\n')
    done = CliRunner().invoke(app(), ["--config", str(config), "--number", "5"])
    assert "number=5, word='green'" in done.output


def test_an_unknown_key_is_named_with_its_line(tmp_path: Path) -> None:
    config = tmp_path / "a.toml"
    config.write_text("number = 3\nnumbre = 4\n")
    done = CliRunner().invoke(app(), ["--config", str(config)])
    assert isinstance(done.exception, UsageError)
    assert "line 2" in str(done.exception)
    assert "numbre" in str(done.exception)


def test_every_convert_option_explains_itself() -> None:
    for item in fields(ConvertOptions):
        assert item.metadata["help"].endswith("."), flag_of(item)
