"""Damaged files of every kind: a result or a refusal in a sentence or two, in bounded time and memory.

Each file is a sound one with a few bits flipped, an end cut off, a value swapped for one of another
type, or one that is huge. The readers run in this process under an alarm and a limit of address space,
because a command of its own for every trial would take minutes.
"""

from __future__ import annotations

import re
import resource
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from shaftline.agents.learning.recipe import read_recipe
from shaftline.mismatch.recordings.columns import load_map
from shaftline.mismatch.recordings.load import load_recording
from shaftline.mismatch.search.catalogue import read_entries
from shaftline.plant import load_ship
from shaftline.plant.columns import input_columns
from shaftline.plant.recording import read_recording

from .test_numbers import EFFECTS, MAP, ROOT

pytest.importorskip("stable_baselines3")

LONGEST_S, MORE_BYTES = 10, 2_000_000_000
WRITTEN_FOR_US = 600
"""Letters of a message; a parser's own words are quoted in it."""

SHIP = (ROOT / "plant/ships/frigate-at-sea.toml").read_bytes()
RECIPE = (ROOT / "agents/learning/recipes/ppo.yml").read_bytes()
LOG = "Zeit;Fuellung;Steigung;Drehzahl\ns;mm;-;rpm\n" + "".join(
    f"{k // 10},{k % 10};{20 + k % 3};1,2;{94 + k % 5}\n" for k in range(120)
)
PLAIN = "time_s,fuel_rack_mm,pitch_ratio_command\n" + "".join(
    f"{0.1 * k:.1f},{20 + k % 3},1.2\n" for k in range(120)
)
FRIGATE = load_ship("frigate")

NAMES = """
[columns]
Zeit = "time_s"
Fuellung = "fuel_rack_mm"
Steigung = "pitch_ratio_command"
Drehzahl = "shaft_speed_rad_s"
"""

KINDS: dict[str, tuple[str, bytes, Callable[[Path], object]]] = {
    "ship": ("ship.toml", SHIP, load_ship),
    "recipe": ("recipe.yml", RECIPE, lambda path: read_recipe("ppo", "rough-sea", path)),
    "column map": ("map.toml", MAP.encode(), load_map),
    "effects": ("effects.toml", EFFECTS.encode(), read_entries),
    "recording": (
        "log.csv",
        PLAIN.encode(),
        lambda path: read_recording(path, input_columns(FRIGATE), {}),
    ),
    "logger's file": (
        "log.csv",
        LOG.encode(),
        lambda path: load_recording(path, FRIGATE, path.with_name("names.toml")),
    ),
}

VALUES = [b"true", b"nan", b"inf", b"-1", b"0", b"1e300", b"-1e300", b"1e-300", b'"text"', b"[1, 2]",
          b"{ a = 1 }", b"1979-05-27", b"9" * 400, b"'" + b"x" * 3000 + b"'", b"m**9**9**9**9", b"",
          b"\x00", b"\xff\xfe"]  # fmt: skip
NUMBER = re.compile(rb"-?\d+(\.\d+)?(e-?\d+)?")


def _too_long(*_: object) -> None:
    raise AssertionError(f"took over {LONGEST_S} s")


@contextmanager
def _bounded() -> Iterator[None]:
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + MORE_BYTES, hard))
    before = signal.signal(signal.SIGALRM, _too_long)
    signal.alarm(LONGEST_S)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def _flipped(content: bytes, draw: Any) -> bytes:
    found = bytearray(content)
    for place, bit in draw(
        st.lists(
            st.tuples(st.integers(0, len(found) - 1), st.integers(0, 7)), min_size=1, max_size=12
        )
    ):
        found[place] ^= 1 << bit
    return bytes(found)


def _cut(content: bytes, draw: Any) -> bytes:
    first, last = sorted((draw(st.integers(0, len(content))), draw(st.integers(0, len(content)))))
    return content[:first] if draw(st.booleans()) else content[:first] + content[last:]


def _swapped(content: bytes, draw: Any) -> bytes:
    places = list(NUMBER.finditer(content))
    if not places:
        return content
    place = draw(st.sampled_from(places))
    value: bytes = draw(st.sampled_from(VALUES))
    return content[: place.start()] + value + content[place.end() :]


@st.composite
def _damaged(draw: Any, content: bytes) -> bytes:
    damage = draw(st.sampled_from([_flipped, _cut, _swapped]))
    return bytes(damage(content, draw))


@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_file_is_read_or_refused(kind: str, tmp_path: Path) -> None:
    name, content, read = KINDS[kind]
    path = tmp_path / name
    path.write_bytes(content)
    (tmp_path / "names.toml").write_text(NAMES, encoding="utf-8")
    read(path)

    @settings(
        max_examples=60,
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(_damaged(content))
    def one(damaged: bytes) -> None:
        path.write_bytes(damaged)
        with _bounded(), np.errstate(all="ignore"):
            try:
                read(path)
            except ValueError as error:
                said = str(error)
            else:
                return
        first = said.splitlines()[0]
        assert first, "a refusal without a reason"
        assert len(first) < WRITTEN_FOR_US + len(str(path)), said
        assert "For further information visit" not in said, said
        assert "<class" not in said, said

    one()
