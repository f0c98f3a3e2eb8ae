"""``shaftline challenge``: a user-defined rival from make to score, and refusals."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pandas as pd
import pytest

from shaftline.cli import challenge_command

from .conftest import Command
from .test_bad_input import nothing_written, refused

EXAMPLE = "examples.challenge_rival:LaggedResidual"
ROOT = Path(__file__).parents[2]


@pytest.fixture
def in_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the examples be imported, as in the checkout's folder."""
    monkeypatch.setattr(sys, "path", [*sys.path, str(ROOT)])


@pytest.mark.usefixtures("in_checkout")
def test_a_user_defined_rival_is_made_run_and_scored(shaftline: Command, tmp_path: Path) -> None:
    place, own, simple = tmp_path / "c", tmp_path / "own.json", tmp_path / "ship.json"
    one = ("--jobs", 1)
    made = shaftline("challenge", "make", "--seed", 112, "--cases", 2, "--out", place, *one)
    assert made.exit_code == 0, made.output
    seal = (place / "seal.txt").read_text().split()[0]
    assert f"seal (SHA-256 of the truth): {seal}" in made.output
    ran = shaftline("challenge", "run", place, EXAMPLE, "--out", own, *one)
    assert ran.exit_code == 0, ran.output
    assert "2 of 2 cases analysed, 0 failed" in ran.output
    assert shaftline("challenge", "run", place, "ship-file", "--out", simple, *one).exit_code == 0
    scored = shaftline("challenge", "score", place, own, simple, "--out", tmp_path / "s")
    assert scored.exit_code == 0, scored.output
    table = pd.read_csv(tmp_path / "s" / "challenge.csv").set_index(["figure", "tool"])["value"]
    gain = "held-out gain with an effect (median, quartiles)"
    assert table[gain, EXAMPLE] == pytest.approx(0.114, abs=0.005)
    assert table[gain, "ship-file"] == 0.0
    page = (tmp_path / "s" / "challenge.md").read_text()
    assert f"`shaftline challenge score {place} {own} {simple} --out {tmp_path / 's'}`" in page
    tree = json.loads((tmp_path / "s" / "challenge.json").read_text())
    assert (tree["cases"], tree["variant"]) == (2, "plain")
    refused(shaftline("challenge", "make", "--seed", 1, "--out", place), "is not empty")
    truth = tmp_path / "c-truth.json"
    truth.write_text(truth.read_text() + " ")
    refused(shaftline("challenge", "score", place, own), "differs from the seal")


def test_the_practice_set_is_copied_run_and_scored(shaftline: Command, tmp_path: Path) -> None:
    place, own = tmp_path / "c", tmp_path / "own.json"
    copied = shaftline("challenge", "copy", "--out", place)
    assert copied.exit_code == 0, copied.output
    assert f"practice set of 6 cases in {place}" in copied.output
    assert f"truth: {tmp_path / 'c-truth.json'}" in copied.output
    ran = shaftline("challenge", "run", place, "stepwise-bic", "--out", own, "--jobs", 1)
    assert "6 of 6 cases analysed, 0 failed" in ran.output
    scored = shaftline("challenge", "score", place, own, "--out", tmp_path / "s")
    assert scored.exit_code == 0, scored.output
    assert "6 cases, variant 1-hz" in scored.output
    table = pd.read_csv(tmp_path / "s" / "challenge.csv").set_index(["figure", "tool"])
    name = "F1 of the time in which the effect acts (median, quartiles)"
    assert table.loc[(name, "stepwise-bic"), "cases"] == 5
    bound = table.loc[(name, "bound: every row marked"), "value"]
    assert 0.5 < table.loc[(name, "stepwise-bic"), "value"] <= bound < 1.0
    refused(shaftline("challenge", "copy", "--out", place), "is not empty")
    again = tmp_path / "again"
    (tmp_path / "again-truth.json").write_text("{}")
    refused(shaftline("challenge", "copy", "--out", again), "again-truth.json: exists already")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("copy out", ("copy out: give the new folder as --out out",)),
        ("make out", ("give the new folder as --out out",)),
        ("make --variant windy", ("--variant windy: unknown", "1-hz")),
        ("make --cases 477 --variant 100-hz", ("--cases 477: at most 476",)),
        ("run c", ("needs a folder and a RIVAL", "challenge run DIR RIVAL")),
        ("run c lisdd", ("c: no challenge", "shaftline challenge make --out c")),
        ("run c lisdd pysindy", ("one rival at a time, not 2: lisdd, pysindy",)),
        ("score c", ("needs a folder and a SUBMISSION.json",)),
        ("score c a.json", ("c: no challenge: it has no seal.txt",)),
        ("stop c", ("'copy', 'make', 'run', 'score'",)),
    ],
)
def test_what_cannot_be_done_is_refused(
    shaftline: Command,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    line: str,
    words: tuple[str, ...],
) -> None:
    monkeypatch.chdir(tmp_path)
    result = shaftline("challenge", *line.split())
    assert result.exit_code == 2, result.output
    # Errors of the parser are in a frame.
    said = " ".join(result.output.replace("│", " ").split())
    for word in words:
        assert word in said, said
    nothing_written(tmp_path)


def test_a_seed_that_is_not_given_is_drawn_and_printed(
    shaftline: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seeds: list[int] = []

    def make(folder: Path, seed: int, *_: object) -> str:
        seeds.append(seed)
        return "0" * 64

    monkeypatch.setattr(challenge_command, "make_challenge", make)
    for _ in range(2):
        output = shaftline("challenge", "make", "--out", tmp_path / "c").output
        assert f"seed: {seeds[-1]};" in output
    assert seeds[0] != seeds[1]
