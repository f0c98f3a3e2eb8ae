"""First page of the report, for a superintendent: what it costs, where it is, what to do next."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from ...plant.columns import drive_column
from ...plant.surroundings import KNOT
from ..identification.parameters import ParameterChange
from ..judge.verdict import EXPLAINED, NOTHING, PARTLY, UNEXPLAINED, Finding
from ..outcome import Outcome
from ..simulate.balances import BALANCE_OF_RESIDUAL
from . import text
from .advice import ADVICE, Advice, advice_of
from .service import (
    ENGINE_POWER,
    EQUAL_COMMAND,
    EQUAL_POWER,
    FUEL,
    METHOD,
    SHAFT_SPEED,
    SHAFT_TORQUE,
    THRUST,
    Quantity,
    Service,
    command_words,
    service_of,
)
from .wording import (
    CHANGED,
    biased_parameter_sentence,
    biased_parameters,
    capitalise,
    changed_since_reference,
    corrected_parameters,
    effect_words,
    join_words,
    number,
    parameter_words,
    values_with_unit,
)

HEALTHY_FUEL = (
    "The fuel is that of an engine in good order at this power; a faulty engine may burn more. A fuel "
    "flow meter would show it."
)
"""Remark on the fuel consumption where the engine itself is the cause."""


MOST_LIMITS = 2  # largest number of limits of the recording on the page


class Tile(NamedTuple):
    """One of the few large numbers of the page."""

    label: str
    value: str
    interval: str  # 95 % interval in words; empty without one
    detail: str


class Row(NamedTuple):
    """One line of the table of both ships."""

    name: str
    before: str
    after: str
    change: str
    interval: str
    unit: str


@dataclass(frozen=True)
class FirstPage:
    """Content of the first page.

    Args:
        headline: result in at most 15 words.
        where: locations on board.
        next_steps: checks to do next, a sentence each.
        doubts: alternatives and reservations, a sentence each.
        tiles: the large numbers; empty where nothing is lost or nothing can be said.
        lead: what to read in place of tiles; else empty.
        rows: table of the nominal and the corrected ship.
        service: numbers and curves.
    """

    headline: str
    where: list[str]
    next_steps: list[str]
    doubts: list[str]
    tiles: list[Tile]
    lead: str
    rows: list[Row]
    service: Service

    @property
    def place(self) -> str:
        """Locations on board as one phrase."""
        return capitalise("; ".join(self.where))

    @property
    def method(self) -> str:
        """Condition of the numbers and origin of their intervals; empty without numbers."""
        if not self.service.quantities:
            return ""
        some = any(q.ci95 is not None for q in self.service.quantities.values())
        some = some and self.service.changes
        return self.service.condition + (f" In brackets, 95 % intervals: {METHOD}." if some else "")

    def to_dict(self) -> dict[str, Any]:
        """Return ``summary`` of ``report.json``."""
        service = self.service
        speed = service.quantities.get(EQUAL_POWER)
        loss = None
        if speed is not None:
            ends = speed.ci95
            loss = {
                "value": speed.percent(speed.change),
                "ci95": None if ends is None else [speed.percent(end) for end in ends],
            }
        return {
            "headline": self.headline,
            "where": self.where,
            "next_steps": self.next_steps,
            "doubts": self.doubts,
            "service_speed_m_s": service.speed_m_s,
            "condition": service.condition,
            "speed_loss_percent": loss,
            "quantities": {name: q.to_dict() for name, q in service.quantities.items()},
            "undetectable_kW": dict(service.hidden),
            "interval": METHOD if self.method != service.condition else "",
            "note": service.note,
        }


def first_page(diagnosis: Outcome) -> FirstPage:
    """Return the first page of a diagnosis."""
    verdict = text.status(diagnosis)
    undecided = verdict not in (EXPLAINED, PARTLY, NOTHING, UNEXPLAINED)
    service = service_of(diagnosis, undecided)
    tiles = list(_tiles(diagnosis, service))
    return FirstPage(
        headline=_headline(diagnosis, service),
        where=_where(diagnosis),
        next_steps=_next_steps(diagnosis),
        doubts=list(_doubts(diagnosis, service)),
        tiles=tiles,
        lead="" if tiles else _lead(diagnosis, service),
        rows=[
            _row(quantity)
            for name, quantity in service.quantities.items()
            if service.changes or name not in (EQUAL_POWER, EQUAL_COMMAND)
        ],
        service=service,
    )


def _advice(diagnosis: Outcome) -> list[Advice]:
    return [advice_of(finding.effect) for finding in diagnosis.findings]


def _balance_advice(balance: str) -> Advice:
    """Return the class of all effects of a balance."""
    balance = BALANCE_OF_RESIDUAL.get(balance, balance)
    return next(a for a in ADVICE if a.balance == balance and not a.keys)


def _is_only_instruments(diagnosis: Outcome) -> bool:
    return all(finding.effect.balance == "sensor" for finding in diagnosis.findings)


def _wrong_in_file(diagnosis: Outcome) -> list[ParameterChange]:
    """Return the parameters in which the ship file is wrong, where no effect is identified."""
    return [] if diagnosis.findings else corrected_parameters(diagnosis, free=True, far=True)


def _headline(diagnosis: Outcome, service: Service) -> str:
    """Return the result in at most :data:`.text.MOST_WORDS` words, with speed and power where known."""
    status, plain = text.status(diagnosis), text.headline(diagnosis)
    costs = _costs(diagnosis, service)
    if diagnosis.findings:
        names = list(dict.fromkeys(effect_words(f.effect) for f in diagnosis.findings))
        if _is_only_instruments(diagnosis):
            if status == EXPLAINED:
                return _fitted("An instrument is wrong, not the ship:", names, "") or plain
            return _fitted("An instrument is wrong:", names, "; a residual remains") or plain
        begin = "Partly due to" if status == PARTLY else ""
        other = " or an alternative" if any(f.rivals for f in diagnosis.findings) else ""
        end = f"{other}: {costs}" if costs else other
        return _fitted(begin, names, end) or _fitted(begin, names, other) or plain
    if wrong := _wrong_in_file(diagnosis):
        if not costs:
            return plain
        begin = CHANGED if changed_since_reference(wrong) else "Not as the ship file says:"
        return _fitted(begin, [costs], "") or plain
    if status == NOTHING:
        return "No loss found: the ship performs as the ship file says."
    if status == UNEXPLAINED and service.sure(ENGINE_POWER) is not None:
        return _fitted("Unexplained:", [costs], ", of unknown cause") or plain
    return plain


def _fitted(begin: str, names: list[str], end: str) -> str:
    """Return a headline with as many names as fit into it; empty if none fits."""
    for count in range(len(names), 0, -1):
        more = len(names) - count
        subject = join_words([*names[:count], *([f"{more} more"] if more else [])])
        line = capitalise(f"{begin} {subject}{end}.".strip())
        if len(line.split()) <= text.MOST_WORDS:
            return line
    return ""


def _costs(diagnosis: Outcome, service: Service) -> str:
    """Return what the effects cost, in words for a headline; empty where nothing is known."""
    if not service.quantities:
        return ""
    if service.speed_m_s is None:
        speed = service.sure(SHAFT_SPEED)
        if speed is None:
            return "no change of shaft speed at a steady command"
        percent = speed.percent(speed.change)
        much = "lower" if percent < 0.0 else "higher"
        return f"shaft speed {number(abs(percent), 2)} % {much} at equal command"
    power, equal = service.sure(ENGINE_POWER), service.quantities.get(EQUAL_POWER)
    knots = f"{number(service.speed_m_s / KNOT)} kn"
    if power is not None and equal is not None:
        percent = equal.percent(equal.change)
        slower = f"{number(abs(percent), 2)} % {'slower' if percent < 0.0 else 'faster'}"
        factor, unit = _scale(power)
        much = f"{number(abs(power.change) * factor)} {unit}"
        return f"{slower}, {much} {'more' if power.change > 0.0 else 'less'} at {knots}"
    command = service.sure(EQUAL_COMMAND)
    if command is not None:
        percent = command.percent(command.change)
        much = "slower" if percent < 0.0 else "faster"
        name = command_words(diagnosis.ship)
        return f"{number(abs(percent), 2)} % {much} at equal {name}"
    if text.has_residual(diagnosis):  # It may hide a loss.
        return f"the loss at {knots} is not determined"
    return f"no loss at {knots}"


def _scale(quantity: Quantity) -> tuple[float, str]:
    """Return factor and unit in which a quantity is shown: kg/d below 1 t/d, W below 1 kW."""
    small = {"t/d": "kg/d", "kW": "W"}
    largest = max(abs(quantity.before), abs(quantity.after))
    if quantity.unit in small and largest < 1.0:
        return 1000.0, small[quantity.unit]
    return 1.0, quantity.unit


def _signed(value: float, digits: int = 3) -> str:
    return f"{'+' if value > 0.0 else ''}{number(value, digits)}"


def _row(quantity: Quantity) -> Row:
    """Return the line of a quantity; without a change only the value of the nominal ship."""
    factor, unit = _scale(quantity)
    before = number(factor * quantity.before, 4)
    name = capitalise(quantity.words)
    if not quantity.differs:
        return Row(name, before, before, "none", "", unit)
    interval = ""
    if quantity.ci95 is not None:
        interval = " to ".join(_signed(factor * end, 3) for end in quantity.ci95)
    after, change = factor * quantity.after, factor * quantity.change
    return Row(name, before, number(after, 4), _signed(change), interval, unit)


def _tiles(diagnosis: Outcome, service: Service) -> Iterator[Tile]:
    """Yield the large numbers: speed, power and fuel, or those of a rig or of an engine."""
    if service.speed_m_s is None:
        for name in (SHAFT_SPEED, SHAFT_TORQUE, ENGINE_POWER, THRUST):
            if (quantity := service.sure(name)) is not None:
                yield _relative_tile(quantity, capitalise(quantity.words))
        return
    if service.sure(ENGINE_POWER) is not None:
        if (speed := service.quantities.get(EQUAL_POWER)) is not None:
            yield _speed_tile(speed)
        yield _extra_tile(service.quantities[ENGINE_POWER], "power")
        if FUEL in service.quantities:
            yield _extra_tile(service.quantities[FUEL], "fuel")
    elif (command := service.sure(EQUAL_COMMAND)) is not None:
        yield _speed_tile(command)
        if (needed := service.sure(drive_column(diagnosis.ship))) is not None:
            yield _extra_tile(needed, needed.words)
        if (power := service.quantities.get(ENGINE_POWER)) is not None:
            same = f"the ship needs {_row(power).before} {_scale(power)[1]} as before"
            yield Tile("Extra power", "none", "", same)


def _speed_tile(speed: Quantity) -> Tile:
    """Return the tile of a speed at equal power or command, as a loss or a gain in per cent."""
    sign = -1.0 if speed.change < 0.0 else 1.0
    ends = sorted(sign * speed.percent(end) for end in speed.ci95 or ())
    interval = " to ".join(number(end, 2) for end in ends)
    where = speed.words.removeprefix("speed ")
    return Tile(
        "Speed loss" if sign < 0.0 else "Speed gain",
        f"{number(sign * speed.percent(speed.change), 2)} %",
        f"95 % interval {interval} %" if ends else "",
        f"{number(speed.after)} in place of {number(speed.before)} kn {where}",
    )


def _extra_tile(quantity: Quantity, word: str) -> Tile:
    """Return the tile of a change of power, fuel or command."""
    factor, unit = _scale(quantity)
    sign = 1.0 if quantity.change > 0.0 else -1.0
    ends = sorted(sign * factor * end for end in quantity.ci95 or ())
    interval = " to ".join(number(end) for end in ends)
    row = _row(quantity)
    percent = _signed(quantity.percent(quantity.change), 2)
    return Tile(
        f"Extra {word}" if sign > 0.0 else f"Less {word}",
        f"{number(abs(factor * quantity.change))} {unit}",
        f"95 % interval {interval} {unit}" if ends else "",
        f"{quantity.words} {row.after} in place of {row.before} {unit} ({percent} %)",
    )


def _relative_tile(quantity: Quantity, label: str) -> Tile:
    """Return the tile of a change in per cent."""
    row = _row(quantity)
    ends = " to ".join(_signed(quantity.percent(end), 2) for end in quantity.ci95 or ())
    return Tile(
        label,
        f"{_signed(quantity.percent(quantity.change), 2)} %",
        f"95 % interval {ends} %" if ends else "",
        f"{row.after} in place of {row.before} {row.unit}",
    )


def _lead(diagnosis: Outcome, service: Service) -> str:
    """Return the sentence in place of the large numbers."""
    if not service.quantities:
        return f"No numbers of power and fuel: {service.note.rstrip('.')}."
    said = "Power, fuel and speed in steady service are those of the ship file"
    if service.speed_m_s is None:
        said = "The steady state is that of the ship file"
    if diagnosis.findings and _is_only_instruments(diagnosis):
        return f"{said}. {' '.join(map(_size_sentence, diagnosis.findings))}"
    if diagnosis.findings:
        return f"{said}: the effect acts in manoeuvres only, or less than this recording can show."
    if not service.hidden:
        return f"{said}."
    hidden = sorted(service.hidden, key=lambda item: item[1])[:4]
    sizes = join_words([f"{number(kW, 2)} kW by {words}" for words, kW in hidden])
    return f"{said}. A smaller loss than {sizes} would not have been found."


def _size_sentence(finding: Finding) -> str:
    """Return which instrument is wrong and by how much."""
    sizes = []
    for e in finding.estimates:
        value, *ends = values_with_unit((e.value, *e.ci95), e.unit)
        interval = "" if finding.unmeasured else f" (95 % interval {' to '.join(ends)})"
        sizes.append(f"{parameter_words(e.name, e.unit)} {value}{interval}")
    return f"The {advice_of(finding.effect).where} has a {join_words(sizes)}."


def _where(diagnosis: Outcome) -> list[str]:
    """Return the locations on board, or that there is none."""
    if diagnosis.findings:
        return list(dict.fromkeys(advice.where for advice in _advice(diagnosis)))
    if wrong := _wrong_in_file(diagnosis):
        where = "ship" if changed_since_reference(wrong) else "ship file or ship"
        return [f"{where}, {change.key}" for change in wrong]
    if text.status(diagnosis) == NOTHING:
        return ["no part differs from the ship file"]
    if diagnosis.shape is not None and text.status(diagnosis) == UNEXPLAINED:
        return [f"{_balance_advice(diagnosis.shape.balance).where}, cause unknown"]
    return ["not located"]


def _next_steps(diagnosis: Outcome) -> list[str]:
    """Return the checks to do next, those of the alternatives included."""
    if diagnosis.findings:
        steps = [advice.next_step for advice in _advice(diagnosis)]
        for finding in diagnosis.findings:
            own = advice_of(finding.effect)
            others = {advice_of(c.effect).next_step: effect_words(c.effect) for c in finding.rivals}
            steps += [
                f"If it is {words} instead: {step[:1].lower()}{step[1:]}"
                for step, words in others.items()
                if step != own.next_step
            ]
        return list(dict.fromkeys(steps))
    if wrong := _wrong_in_file(diagnosis):
        keys = join_words([change.key for change in wrong])
        if changed_since_reference(wrong):
            return [f"Inspect the parts of the ship that {keys} describe: they have changed."]
        return [
            f"Check {keys} of the ship file against its source. If the file is right, the ship has "
            "changed: inspect that part."
        ]
    status = text.status(diagnosis)
    if status == NOTHING:
        return [
            "No work follows from this recording. Keep it as the reference of later ones: "
            "shaftline diagnose --calibrate."
        ]
    if status != UNEXPLAINED:
        return [
            "Record again before any work: 20 minutes or more, with steps of the command over its "
            "range and all channels on. `shaftline plan-trial` computes the commands from report.json."
        ]
    return [
        "Order no work on this evidence: the cause has no name yet. Record more channels, and look in "
        "the technical part for when the difference occurs."
    ]


def _doubts(diagnosis: Outcome, service: Service) -> Iterator[str]:
    """Yield alternatives and reservations."""
    for finding, biased in zip(diagnosis.findings, biased_parameters(diagnosis), strict=True):
        yield from _alternatives(finding)
        if biased is not None:
            yield biased_parameter_sentence(biased)
        if finding.implausible:
            yield f"{capitalise(finding.implausible)}, so another cause is likely."
        if advice_of(finding.effect).where == "hull, for a time":
            yield "The numbers are those of the ship outside the episode."
    if diagnosis.findings and (far := [c for c in diagnosis.parameters if c.is_far]):
        yield _far_sentence(far)
    if text.status(diagnosis) == PARTLY:
        yield from map(
            text.residual_sentence, (b for b in diagnosis.balance_verdicts if b.left is not None)
        )
    if FUEL in service.quantities and any(a.where == "engine" for a in _advice(diagnosis)):
        yield HEALTHY_FUEL
    if service.quantities and service.note:
        yield f"{capitalise(service.note)}."
    for limit in diagnosis.limits[:MOST_LIMITS]:
        yield f"The recording is limited: {limit}."
    if (more := len(diagnosis.limits) - MOST_LIMITS) > 0:
        yield f"{more} more limit{'s' if more > 1 else ''} of the recording: see the technical part."


def _far_sentence(far: list[ParameterChange]) -> str:
    """Return the doubt about effects beside parameters that lie far from the ship file."""
    keys = [f"{change.key} ({change.shifts:+.1f} tolerances)" for change in far]
    advice = (
        "Check them, widen their tolerances in the ship file, or calibrate on a reference period"
    )
    if any(change.source == "calibrated" for change in far):
        advice = "Something changed since the reference period that has no name here"
    else:
        advice += " (shaftline diagnose --calibrate)"
    return (
        f"Sizes and names are less certain, because the recording also moves {join_words(keys)}. "
        f"{advice}."
    )


def _alternatives(finding: Finding) -> Iterator[str]:
    """Yield the effects that a recording cannot distinguish from a finding, and what would."""
    name = capitalise(effect_words(finding.effect))
    rivals = list(dict.fromkeys(effect_words(c.effect) for c in finding.rivals))
    rivals = [rival for rival in rivals if rival != effect_words(finding.effect)]
    if not rivals:
        yield f"{name}: no other effect fits this recording as well."
        return
    split = f" To distinguish them: {finding.effect.split_by}." if finding.effect.split_by else ""
    yield f"{name} is indistinguishable from {join_words(rivals)} in this recording.{split}"
