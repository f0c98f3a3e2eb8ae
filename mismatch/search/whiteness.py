"""Is what is left more than the instruments' noise?

The noise of each channel is known from the recording itself; carried through the balances it says how
large a residual must be at each frequency. From some frequency on the sea disturbs every balance of a
ship that moves, which is no fault of the model: there only what is slower is judged.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from ...plant.ship import Ship
from .fitting import Fit, Fitter
from .spectra import moments

SLOWER_THAN_SEA_HZ = 0.03
"""What a ship does more slowly than this, no sea of any length does."""

MODEL_M, FULL_M = 12.0, 320.0
"""Length below which a hull is a model, sailed in a basin or on a pond: waves that move it are as much
shorter as it is than a ship, and by Froude's law as much quicker as the root of that."""

EXCESS = 2.0
"""Power over that of the instruments' noise that counts; their rms is known within a tenth."""

CHANCE = 1e-6
DRAWS = 6


@dataclass(frozen=True)
class Colour:
    """A residual that is more than noise.

    Args:
        band: index of the band in which it stands out most.
        balance: index of the balance.
        low_Hz: lower edge of the band.
        high_Hz: its upper edge.
        ratio: power over that of the instruments' noise.
    """

    band: int
    balance: int
    low_Hz: float
    high_Hz: float
    ratio: float


class Whiteness:
    """Residuals judged against the instruments' noise.

    Args:
        fitter: of the recording.
        noise_rms: white noise of each measured column, in its unit.
        quantisation: steps of the columns that are coarser than their noise: what is lost between steps
            is then no white noise, but as slow as the channel itself.
    """

    def __init__(
        self,
        fitter: Fitter,
        noise_rms: Mapping[str, float],
        quantisation: Mapping[str, float] | None = None,
    ) -> None:
        self.fitter = fitter
        bands, balances = fitter.bands, fitter.balances
        channels = balances.nominal
        base = balances.residuals(channels)
        rng = np.random.default_rng(0)
        power = []
        for _ in range(DRAWS):
            noisy = {
                c: _read(
                    x, noise_rms.get(c, 0.0) * rng.standard_normal(len(x)), rng.random(),
                    (quantisation or {}).get(c, 0.0),
                )
                for c, x in channels.items()
            }  # fmt: skip
            drawn = bands.transform(balances.residuals(noisy) - base)
            power.append(moments(bands, drawn, drawn).real)
        self._expected = np.mean(power, axis=0)

    def ratios(self, fit: Fit) -> NDArray[np.float64]:
        """Power of a model's residual over the noise's, shape (bands, balances); 0 where not judged."""
        bands, balances = self.fitter.bands, self.fitter.balances
        residual = self.fitter.left(fit)
        found = moments(bands, residual, residual).real
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.nan_to_num(
                np.diagonal(found, axis1=1, axis2=2)
                / np.diagonal(self._expected, axis1=1, axis2=2),
                posinf=0.0,
            )
        if balances.moving:
            slower = slower_than_waves_hertz(balances.replay.ship)
            ratio[bands.frequency_Hz[bands.edges[1:] - 1] > slower] = 0.0
        return np.asarray(ratio)

    @property
    def _limit(self) -> NDArray[np.float64]:
        """Power over the noise's from which on a band is coloured, shape (bands,)."""
        bands = self.fitter.bands
        freedom = 2.0 * np.add.reduceat(bands.weights, bands.edges[:-1])
        return np.asarray(EXCESS * scipy.stats.chi2.isf(CHANCE, freedom) / freedom)

    def coloured(self, fit: Fit) -> list[str]:
        """Names of the balances in which a model leaves more than noise."""
        excess = (self.ratios(fit) / self._limit[:, None]).max(axis=0)
        names = self.fitter.balances.names
        return [name for name, most in zip(names, excess, strict=True) if most > 1.0]

    def colour(self, fit: Fit, balance: int | None = None) -> Colour | None:
        """Where a model's residual exceeds the noise most; None where it is noise.

        Args:
            fit: the model.
            balance: index of the one that is looked at; all by default.
        """
        bands = self.fitter.bands
        ratios = self.ratios(fit)
        excess = ratios / self._limit[:, None]
        if balance is not None:
            excess[:, [row for row in range(excess.shape[1]) if row != balance]] = 0.0
        band, row = np.unravel_index(int(np.argmax(excess)), excess.shape)
        if excess[band, row] <= 1.0:
            return None
        edges = bands.edges
        low, high = bands.frequency_Hz[edges[band]], bands.frequency_Hz[edges[band + 1] - 1]
        return Colour(int(band), int(row), float(low), float(high), float(ratios[band, row]))


def slower_than_waves_hertz(ship: Ship) -> float:
    """Frequency [Hz] below which no wave moves a ship; without a length that of a large one."""
    length = ship.manoeuvring.length_m
    if not 0.0 < length < MODEL_M:
        return SLOWER_THAN_SEA_HZ
    return float(SLOWER_THAN_SEA_HZ * np.sqrt(FULL_M / length))


def _read(
    values: NDArray[np.float64], noise: NDArray[np.float64], phase: float, step: float
) -> NDArray[np.float64]:
    """A channel as an instrument reads it; where its steps are coarse, they are its noise.

    Args:
        values: true, shape (n,).
        noise: likewise.
        phase: of the steps, 0 to 1, for a simulation lies a little beside the truth.
        step: 0 of an instrument without any.
    """
    if step <= 0.0:
        return values + noise
    return np.asarray((np.round(values / step + phase) - phase) * step)
