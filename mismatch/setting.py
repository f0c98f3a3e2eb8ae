"""How recordings are looked at: up to which frequency, in how many rows, with demands held or drawn.

None of it may follow from how the logger was set. What is judged ends at the highest frequency that
tells of any effect of the catalogue, and rows that are faster than that asks for are averaged: the same
recording comes to the same verdict raw or filtered, at any rate that holds those frequencies.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass

from ..plant.ship import Ship
from .judge.held_out import Segments, bands_of, set_aside
from .recordings.joint import JointRecordings
from .search.band import catalogue_hertz, rows_averaged
from .search.catalogue import Effect
from .search.fitting import Fitter
from .search.selection import TELL_APART, Selection
from .search.whiteness import Whiteness
from .simulate.balances import Balances
from .simulate.joint_replay import JointReplay

ALIKE = 0.005
"""Of a period at the highest frequency: where half an interval is less, both ways are the same."""


DOUBTED = 0.05
"""Of a period at the highest frequency: half an interval that is more leaves it open when a drawn demand
moved between two rows."""


@dataclass(frozen=True)
class Setting:
    """One way to look at recordings.

    Args:
        whiteness: of the residuals on the part that is fitted, with its fitter.
        held: the part that is set aside.
    """

    whiteness: Whiteness
    held: Segments

    @property
    def fitter(self) -> Fitter:
        """Of the part that is fitted."""
        return self.whiteness.fitter

    @property
    def balances(self) -> Balances:
        """Of ship and recordings."""
        return self.fitter.balances

    @property
    def segments(self) -> Segments:
        """Return the rows that are fitted, as segments."""
        bands = self.fitter.bands
        return list(zip(bands.starts, bands.ends, strict=True))

    @property
    def line(self) -> bool:
        """Whether demands are straight lines between rows instead of held."""
        return self.balances.replay.line


class Settings:
    """Both ways to take the demands, the likelier first.

    Args:
        ship: the nominal ship.
        together: the recordings.
        effects: that will be tried.
        tolerance: factor on the tolerances of the ship's numbers.
    """

    def __init__(
        self, ship: Ship, together: JointRecordings, effects: list[Effect], tolerance: float
    ) -> None:
        balances = Balances(JointReplay(ship, *together.tables, steady=together.steady))
        replay = balances.replay
        part = set_aside(replay, together.held_out)[0][0]
        highest = catalogue_hertz(balances, effects, part)
        every = rows_averaged(replay.interval_s, highest)
        if every > 1:
            averaged = JointReplay(ship, *together.tables, every=every, steady=together.steady)
            balances = Balances(averaged)
        first = Setting(*_parted(balances, together.held_out, tolerance, highest))
        self.tried = [first]
        self._gain, self._settled, self._tolerance = 0.0, False, tolerance
        if not together.steady and 0.5 * replay.interval_s * highest > ALIKE:
            drawn = Balances(JointReplay(ship, *together.tables, line=True, every=every))
            bands = bands_of(drawn, first.segments, highest)
            whiteness = _whiteness(Fitter(drawn, bands, tolerance))
            self.tried.append(Setting(whiteness, first.held))
            # held ones, which a controller's are, unless it is clear
            now, other = (setting.fitter.null.score for setting in self.tried)
            self._exchanged(now, other, TELL_APART)

    @functools.cached_property
    def _doubted(self) -> Setting:
        """Drawn demands, the times of whose moves between two rows are not known."""
        drawn = next(setting for setting in self.tried if setting.line)
        plain = drawn.fitter
        replay = plain.balances.replay
        if 0.5 * replay.interval_s / replay.every * plain.bands.highest_Hz < DOUBTED:
            return drawn
        fitter = Fitter(plain.balances, plain.bands, self._tolerance, doubt=True)
        return Setting(_whiteness(fitter), drawn.held)

    @property
    def best(self) -> Setting:
        """The likelier one."""
        return self._doubted if self.tried[0].line else self.tried[0]

    def corrected(self, selection: Selection) -> bool:
        """Whether the other way is the likelier one after all, now that effects are known.

        Both are given what the search asked for, and its first effect alone: a later one may only make
        up for demands that are taken wrongly, as a delay does.

        Args:
            selection: what a search on the best way has found.
        """
        if len(self.tried) < 2 or self._settled or not selection.fit.effects:
            return False
        self._settled = True
        now, other = (_worth(setting.fitter, selection) for setting in self.tried)
        return self._exchanged(now, other, 0.0)

    def _exchanged(self, now: float, other: float, margin: float) -> bool:
        exchanged = other - now > margin
        if exchanged:
            self.tried.reverse()
        self._gain = abs(other - now)
        return exchanged

    def remarks(self) -> Iterator[str]:
        """What a reader is told of it."""
        if self.best.line:
            yield (
                "the demands are taken as straight lines between rows, which fits better than held "
                f"ones: 2 log L is {self._gain:.0f} higher"
            )


def _worth(fitter: Fitter, selection: Selection) -> float:
    """Score of what a search asked for, or of its first effect alone, less what it had to gain."""
    effects, thresholds = selection.fit.effects, selection.thresholds
    first = fitter.refined(fitter.fitted(effects[:1]), 0)
    whole = fitter.fitted(effects)
    return max(first.score - thresholds[0], whole.score - sum(thresholds))


def _parted(
    balances: Balances, runs: int, tolerance: float, highest_Hz: float = math.inf
) -> tuple[Whiteness, Segments]:
    """Set data aside; not a part that alone holds all that is missing, for nothing could be learnt."""
    parted = []
    for train, held in set_aside(balances.replay, runs):
        fitter = Fitter(balances, bands_of(balances, train, highest_Hz), tolerance)
        parted.append((_whiteness(fitter), held))
        if parted[-1][0].colour(fitter.null) is not None:
            return parted[-1]
    return parted[0]


def _whiteness(fitter: Fitter) -> Whiteness:
    replay = fitter.balances.replay
    return Whiteness(fitter, replay.noise_rms, replay.quantisation)
