"""Test whether a residual is larger than the noise of the instruments.

The noise of each channel is estimated from the recording. The balances give the residual that this noise
causes at each frequency. Above a certain frequency waves disturb every balance of a ship that moves,
which is no error of the model; there the residual is not tested.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from ...plant.ship import Ship
from .fitting import Fit, Fitter
from .spectra import band_products

SLOWER_THAN_SEA_HZ = 0.03
"""Frequency [Hz] below which no waves excite a ship."""

MODEL_M, FULL_M = 12.0, 320.0
"""Length [m] below which a hull is a scale model in a basin, and length of the ship to which the limit
belongs. By Froude's law the frequency of waves scales with the inverse square root of the length."""

EXCESS = 2.0
"""Ratio of power to noise power from which a residual is significant; the rms noise has 10 % error."""

CHANCE = 1e-6
DRAWS = 6


@dataclass(frozen=True)
class Colour:
    """Residual that exceeds the noise of the instruments.

    Args:
        band: index of the band with the largest excess.
        balance: index of the balance.
        low_Hz: lower edge of the band.
        high_Hz: upper edge of the band.
        ratio: power of the residual over that of the noise.
    """

    band: int
    balance: int
    low_Hz: float
    high_Hz: float
    ratio: float


class Whiteness:
    """Comparison of residuals with the noise of the instruments.

    Args:
        fitter: fitter of the recording.
        noise_rms: white noise of each measured column, in its unit.
        quantisation: quantisation steps that are larger than the noise; their error is no white noise,
            but as slow as the channel itself.
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
                c: _measure(
                    x, noise_rms.get(c, 0.0) * rng.standard_normal(len(x)), rng.random(),
                    (quantisation or {}).get(c, 0.0),
                )
                for c, x in channels.items()
            }  # fmt: skip
            drawn = bands.transform(balances.residuals(noisy) - base)
            power.append(band_products(bands, drawn, drawn).real)
        self._expected = np.mean(power, axis=0)

    def ratios(self, fit: Fit) -> NDArray[np.float64]:
        """Return residual power over noise power, (bands, balances); 0 for bands without a test."""
        bands, balances = self.fitter.bands, self.fitter.balances
        residual = self.fitter.residual(fit)
        found = band_products(bands, residual, residual).real
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
        """Power ratio from which a band is significant, shape (bands,)."""
        bands = self.fitter.bands
        freedom = 2.0 * np.add.reduceat(bands.weights, bands.edges[:-1])
        return np.asarray(EXCESS * scipy.stats.chi2.isf(CHANCE, freedom) / freedom)

    def coloured_balances(self, fit: Fit) -> list[str]:
        """Return the names of the balances whose residual exceeds the noise."""
        excess = (self.ratios(fit) / self._limit[:, None]).max(axis=0)
        names = self.fitter.balances.names
        return [name for name, most in zip(names, excess, strict=True) if most > 1.0]

    def colour(self, fit: Fit, balance: int | None = None) -> Colour | None:
        """Return the band and balance with the largest excess over the noise; None without an excess.

        Args:
            fit: the model.
            balance: index of the balance to be tested; all balances by default.
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
    """Return the frequency [Hz] below which no waves excite a ship, from its length if it is known."""
    length = ship.manoeuvring.length_m
    if not 0.0 < length < MODEL_M:
        return SLOWER_THAN_SEA_HZ
    return float(SLOWER_THAN_SEA_HZ * np.sqrt(FULL_M / length))


def _measure(
    values: NDArray[np.float64], noise: NDArray[np.float64], phase: float, step: float
) -> NDArray[np.float64]:
    """Return measured values: with noise, or with quantisation if the step is larger than 0.

    Args:
        values: true values, shape (n,).
        noise: noise, shape (n,).
        phase: position of the grid of steps, 0 to 1; it is random, as a simulation is not exact.
        step: quantisation step; 0 for an instrument without one.
    """
    if step <= 0.0:
        return values + noise
    return np.asarray((np.round(values / step + phase) - phase) * step)
