"""Choose the frequency range, the averaging of rows and the interpolation of the commands.

The verdict must not depend on the settings of the logger. The range therefore ends at the highest
frequency at which any effect of the catalogue is identifiable, and faster rows are averaged. The same
recording then gets the same verdict raw or filtered, at any sampling rate that covers this range.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass

from ..plant.ship import Ship
from .estimate import Tick, ignore_progress
from .judge.held_out import Segments, bands_of, split_held_out
from .recordings.joint import JointRecordings
from .search.catalogue import Effect
from .search.fitting import Fitter, Whiteness
from .search.selection import INDISTINGUISHABLE, Selection
from .search.spectra import highest_informative_frequency, rows_per_average
from .simulate.balances import Balances
from .simulate.joint_replay import JointReplay, map_threaded

ALIKE = 0.005
"""Share of a period at the highest frequency. Where half a sampling interval is shorter, held and
linearly interpolated commands are equivalent."""

DOUBTED = 0.05
"""Share of a period at the highest frequency. Where half a sampling interval is longer, the time at
which a linearly interpolated command moved between two rows is uncertain."""

LOCATE = "locating the mismatch"
"""Stage of the progress, in three steps: frequency range, held commands, commands on lines."""

LINES = (
    "the commands are interpolated linearly between rows, which fits better than held commands: "
    "2 log L is {gain:.0f} higher"
)
"""Remark on linearly interpolated commands."""


@dataclass(frozen=True)
class Setting:
    """Recordings with one interpolation of the commands, split into fitted and held-out data."""

    whiteness: Whiteness  # whiteness test of the residuals on the fitted data, with its fitter
    held: Segments  # segments of the held-out data

    @classmethod
    def of(cls, fitter: Fitter, held: Segments) -> Setting:
        """Return the setting of a fitter, with the noise of its recordings."""
        replay = fitter.balances.replay
        return cls(Whiteness(fitter, replay.noise_rms, replay.quantisation), held)

    @property
    def fitter(self) -> Fitter:
        """Fitter of the fitted data."""
        return self.whiteness.fitter

    @property
    def balances(self) -> Balances:
        """Balances of the ship and the recordings."""
        return self.fitter.balances

    @property
    def segments(self) -> Segments:
        """Segments of the fitted data."""
        bands = self.fitter.bands
        return list(zip(bands.starts, bands.ends, strict=True))

    @property
    def line(self) -> bool:
        """Whether the commands are interpolated linearly between rows; otherwise they are held."""
        return self.balances.replay.line


class Settings:
    """Settings with held and with linearly interpolated commands, the likelier first.

    Args:
        ship: nominal ship.
        together: recordings.
        effects: candidate effects.
        tolerance: factor on the tolerances of the ship's parameters [-].
        start_over_s: duration over which the first state is averaged [s]; see :class:`.JointReplay`.
        tick: progress callback ``tick(stage, done, total)``.
    """

    def __init__(
        self,
        ship: Ship,
        together: JointRecordings,
        effects: list[Effect],
        tolerance: float,
        start_over_s: float | None = None,
        tick: Tick = ignore_progress,
    ) -> None:
        tick(LOCATE, 0, 3)
        replayed = functools.partial(JointReplay, ship, *together.tables, start_over_s=start_over_s)
        balances = Balances(replayed(steady=together.steady))
        replay = balances.replay
        part = split_held_out(replay, together.held_out)[0][0]
        highest = highest_informative_frequency(balances, effects, part)
        tick(LOCATE, 1, 3)
        every = rows_per_average(replay.interval_s, highest)
        if every > 1:
            balances = Balances(replayed(every=every, steady=together.steady))
        first = _hold_out(balances, together.held_out, tolerance, highest)
        tick(LOCATE, 2, 3)
        self.tried = [first]
        self._gain, self._tolerance = 0.0, tolerance
        if not together.steady and 0.5 * replay.interval_s * highest > ALIKE:
            drawn = Balances(replayed(line=True, every=every))
            bands = bands_of(drawn, first.segments, highest)
            self.tried.append(Setting.of(Fitter(drawn, bands, tolerance), first.held))
            # Commands of a controller are held, so lines must be clearly likelier.
            now, other = (setting.fitter.null.score for setting in self.tried)
            self._exchange(now, other, INDISTINGUISHABLE)
        tick(LOCATE, 3, 3)

    @functools.cached_property
    def _doubted(self) -> Setting:
        """Setting with linearly interpolated commands whose times between two rows are uncertain."""
        drawn = next(setting for setting in self.tried if setting.line)
        bands, replay = drawn.fitter.bands, drawn.balances.replay
        if 0.5 * replay.interval_s / replay.every * bands.highest_Hz < DOUBTED:
            return drawn
        fitter = Fitter(drawn.balances, bands, self._tolerance, doubt=True)
        return Setting.of(fitter, drawn.held)

    @property
    def best(self) -> Setting:
        """The likelier setting."""
        return self._doubted if self.tried[0].line else self.tried[0]

    def exchange(self, selection: Selection) -> bool:
        """Exchange the settings if the other one is likelier with effects; return whether it is.

        Both are compared with the effects that a search has chosen and with the first effect alone,
        because a later effect such as a delay may only compensate for a wrong interpolation. The less
        likely one is dropped, because its regressors take much memory.
        """
        exchanged = False
        if len(self.tried) > 1 and selection.fit.effects:
            fitters = [setting.fitter for setting in self.tried]
            now, other = map_threaded(lambda fitter: _worth(fitter, selection), fitters)
            exchanged = self._exchange(now, other, 0.0)
        del self.tried[1:]
        return exchanged

    def _exchange(self, now: float, other: float, margin: float) -> bool:
        exchanged = other - now > margin
        if exchanged:
            self.tried.reverse()
        self._gain = abs(other - now)
        return exchanged

    def remarks(self) -> Iterator[str]:
        """Yield a remark if the commands are interpolated linearly."""
        if self.best.line:
            yield LINES.format(gain=self._gain)


def _worth(fitter: Fitter, selection: Selection) -> float:
    """Return the score of the chosen effects, or of the first one alone, less their thresholds."""
    effects, thresholds = selection.fit.effects, selection.thresholds
    first = fitter.refine_effect(fitter.evaluate(effects[:1]), 0)
    return max(first.score - thresholds[0], fitter.evaluate(effects).score - sum(thresholds))


def _hold_out(balances: Balances, runs: int, tolerance: float, highest_Hz: float) -> Setting:
    """Hold data out; the fitted data must contain a mismatch if any part of the recordings does."""
    settings = []
    for train, held in split_held_out(balances.replay, runs):
        fitter = Fitter(balances, bands_of(balances, train, highest_Hz), tolerance)
        settings.append(Setting.of(fitter, held))
        if settings[-1].whiteness.colour(fitter.null) is not None:
            return settings[-1]
    return settings[0]
