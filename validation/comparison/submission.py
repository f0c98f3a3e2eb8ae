"""Submission to a challenge: its format, its checks, and how a rival makes one."""

from __future__ import annotations

import difflib
import json
import time
from collections.abc import Mapping
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, FiniteFloat, ValidationError
from threadpoolctl import threadpool_limits

from ...core.discovery import external_class_digest
from ...core.files import LARGEST_RESULT, FileError, read_text, write_json
from ...core.models import FileModel
from ...core.sweep import digest_of, source_digest, sweep
from ...mismatch import catalogue
from ..simulator.effects import EFFECTS
from .rival import GROUP, ChallengeCase, load_rival

Window: TypeAlias = Annotated[list[FiniteFloat], Field(min_length=2, max_length=2)]

BALANCES = tuple(dict.fromkeys(effect.balance for effect in EFFECTS))
"""Balances in which a case may miss physics."""


class ParameterEntry(FileModel):
    """Value of a parameter of an effect with its 95 % interval, in the unit of the catalogue."""

    value: FiniteFloat
    ci95: Window | None = None


class EffectEntry(FileModel):
    """Identified effect: id of the catalogue, indistinguishable alternatives, and parameters."""

    id: str
    equivalent_ids: list[str] = Field(default_factory=list)
    parameters: dict[str, ParameterEntry] = Field(default_factory=dict)


class CaseEntry(FileModel):
    """Entry of one case.

    An entry without a verdict takes part with its predictions only. Effects stand most probable first.
    Predictions are the channels at the held-out rows; an absent channel counts as the simulation of the
    ship file. A verdict ``failed`` has the error in ``error``.
    """

    verdict: (
        Literal["explained", "partly-explained", "nothing-missing", "unexplained", "failed"] | None
    ) = None
    effects: list[EffectEntry] = Field(default_factory=list)
    balances: list[Literal[BALANCES]] = Field(default_factory=list)  # type: ignore[valid-type]
    windows_s: list[Window] = Field(default_factory=list)
    predictions: dict[str, list[FiniteFloat]] = Field(default_factory=dict)
    seconds: FiniteFloat | None = None
    error: str = ""


class Submission(FileModel):
    """Submission of one tool: its name, and an entry for every case."""

    tool: Annotated[str, Field(min_length=1, max_length=60, pattern=r"^[\w .:+-]+$")]
    cases: dict[str, CaseEntry]


@cache
def _known_ids() -> list[str]:
    return sorted({effect.id for effect in catalogue()})


def read_submission(path: Path, held_out: Mapping[str, Mapping[str, int]]) -> Submission:
    """Return a checked submission.

    Args:
        path: JSON file.
        held_out: number of held-out rows of each channel, by case.

    Raises:
        FileError: unreadable, no JSON, or an entry that cannot be scored; names file, case and key.
    """
    try:
        tree = json.loads(read_text(path, LARGEST_RESULT))
    except RecursionError:
        raise FileError(f"{path}: not valid JSON: nested too deeply") from None
    except json.JSONDecodeError as error:
        raise FileError(f"{path}: not valid JSON: {error}") from None
    try:
        found = Submission.model_validate(tree)
    except ValidationError as error:
        raise FileError(f"{path}: {_first_error(error, 'cases')}") from None
    if missing := [name for name in held_out if name not in found.cases]:
        raise FileError(
            f"{path}: {missing[0]}: missing; {len(missing)} of {len(held_out)} cases have no entry. A "
            'case that the tool cannot analyse has the entry {"verdict": "failed"}'
        )
    for name, entry in found.cases.items():
        if name not in held_out:
            raise FileError(
                f"{path}: {name}: no case of this challenge, such as {next(iter(held_out))}"
            )
        if problem := entry_problem(entry, held_out[name]):
            raise FileError(f"{path}: {name}: {problem}")
    return found


def _first_error(error: ValidationError, above: str = "") -> str:
    """Return place and reason of the first error of a validation."""
    first = error.errors(include_url=False)[0]
    place = [str(part) for part in first["loc"]]
    if len(place) > 1 and place[0] == above:
        place = [place[1] + ":", ".".join(place[2:])] if len(place) > 2 else [place[1]]
        where = " ".join(place)
    else:
        where = ".".join(place) or "the file"
    value = repr(first["input"])
    shown = "" if first["type"] == "missing" else f", not {value[:60]}"
    return f"{where}: {first['msg'][0].lower()}{first['msg'][1:]}{shown}"


def entry_problem(entry: CaseEntry, held_out: Mapping[str, int]) -> str:
    """Return the reason why an entry cannot be scored, with its key; empty if it can.

    Args:
        entry: entry of a case.
        held_out: number of held-out rows of each channel.
    """
    names = entry.verdict in ("explained", "partly-explained")
    if entry.verdict == "explained" and not entry.effects:
        return "effects: is empty, but the verdict is explained; name at least one effect"
    if entry.effects and not names:
        return f"effects: must be empty with the verdict {entry.verdict}"
    for i, effect in enumerate(entry.effects):
        for key, ids in (("id", [effect.id]), ("equivalent_ids", effect.equivalent_ids)):
            if unknown := [one for one in ids if one not in _known_ids()]:
                near = difflib.get_close_matches(unknown[0], _known_ids(), 1)
                hint = f"did you mean {near[0]}?" if near else "see `shaftline list --effects`"
                return f"effects.{i}.{key}: {unknown[0]!r} is no effect of the catalogue; {hint}"
        for name, parameter in effect.parameters.items():
            if parameter.ci95 and parameter.ci95[0] > parameter.ci95[1]:
                return f"effects.{i}.parameters.{name}.ci95: the lower end is above the upper end"
    for i, (begin, end) in enumerate(entry.windows_s):
        if not begin < end:
            return (
                f"windows_s.{i}: begins at {begin:g} s and ends at {end:g} s; the end must be later"
            )
    for channel, values in entry.predictions.items():
        if channel not in held_out:
            return f"predictions.{channel}: no channel of this case: {', '.join(held_out)}"
        if len(values) != held_out[channel]:
            rows = f"{len(values)} values, but the held-out part has {held_out[channel]} rows"
            return f"predictions.{channel}: has {rows}"
    return ""


def analyse_case(rival: str, folder: Path) -> dict[str, Any]:
    """Return the checked entry of one case; an exception of the rival is an entry, too.

    Args:
        rival: name or ``module:Class``.
        folder: folder of the case.

    Raises:
        ValueError: the entry has a key or a value that cannot be scored.
    """
    case, begin = ChallengeCase(folder), time.perf_counter()
    method = load_rival(rival)()
    try:
        # Threads slow small matrices down, on a busy machine by a factor of 150.
        with threadpool_limits(1, "blas"):
            entry = dict(method.analyse(case))
    except Exception as error:  # any exception of a rival is a result
        entry = {"verdict": "failed", "error": f"{type(error).__name__}: {error}"[:500]}
    entry["seconds"] = round(time.perf_counter() - begin, 3)
    plain = json.loads(json.dumps(entry, default=lambda value: value.tolist()))
    try:
        checked = CaseEntry.model_validate(plain)
    except ValidationError as error:
        raise ValueError(f"{case.name}: {_first_error(error)}") from None
    if problem := entry_problem(checked, dict.fromkeys(case.channels, len(case.inputs))):
        raise ValueError(f"{case.name}: {problem}")
    rounded = {
        name: [float(f"{value:.6g}") for value in values]
        for name, values in checked.predictions.items()
    }
    return checked.model_copy(update={"predictions": rounded}).model_dump(exclude_defaults=True)


def run_rival(
    folder: Path, rival: str, out: Path, jobs: int | None = None, tick: Any = lambda: None
) -> dict[str, dict[str, Any]]:
    """Run a rival on every case of a challenge, resumably, and write its submission.

    Args:
        folder: folder of the challenge.
        rival: name of a rival of the package, or ``module:Class``.
        out: file of the submission; finished cases are kept in the folder ``cells`` beside it, until
            the rival's module or one that it imports changes.
        jobs: processes, by default one for each core.
        tick: called after each case.

    Returns:
        The entries by case.

    Raises:
        ValueError: no challenge, unknown rival, or an entry that cannot be scored.
    """
    seal = folder / "seal.txt"
    cases = {place.name: place for place in sorted(folder.glob("case-*")) if place.is_dir()}
    if not cases or not seal.is_file():
        raise ValueError(
            f"{folder}: no challenge; `shaftline challenge make --out {folder}` makes one"
        )
    load_rival(rival)  # refuses an unknown rival before work begins
    code = external_class_digest(rival, GROUP)
    own = source_digest("core", "plant", "mismatch", "validation")
    key = digest_of("/".join([rival, code, own, read_text(seal)]))
    cells = {f"{name}-{key}": place for name, place in cases.items()}
    found = sweep(partial(analyse_case, rival), cells, out.parent / "cells", jobs=jobs, tick=tick)
    entries = {name: found[f"{name}-{key}"] for name in cases}
    write_json(out, {"tool": rival, "cases": entries})
    return entries
