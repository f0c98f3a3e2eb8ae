"""Figure of a hyperparameter search."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from pandas.api.types import is_numeric_dtype

from .figures import ESTIMATE, PALETTE, THESIS, TRUTH, new_figure

_COLUMNS = 3


def trials_figure(rewards: pd.DataFrame, values: pd.DataFrame) -> Figure:
    """Return a figure of the reward over the trials, and over each value that was tried.

    Args:
        rewards: rows by trial, the given recipe first: ``reward`` at the last evaluation, missing if the
            trial was stopped, and ``last``, the reward at its own last evaluation.
        values: rows by trial, one column for each key.
    """
    rows = math.ceil((len(values.columns) + 1) / _COLUMNS)
    figure, axes = new_figure(rows, _COLUMNS, (12.0, 3.2 * rows))
    whole = rewards["reward"].dropna()
    low, top = float(whole.quantile(0.1)), float(whole.max())
    floor = low - 0.3 * max(top - low, 0.01 * abs(top))  # lower rewards are drawn at the floor
    stopped = rewards.loc[rewards["reward"].isna(), "last"].clip(lower=floor)
    drawn = whole.clip(lower=floor)
    first, *others = axes.flat
    if len(stopped):
        about = "stopped, at its last evaluation"
        first.plot(stopped.index, stopped, "x", color=THESIS, label=about)
    first.plot(drawn.index, drawn, "o", color=PALETTE[1], label="at the last evaluation")
    first.step(whole.index, whole.cummax(), where="post", color=ESTIMATE, label="best")
    first.axhline(whole.iloc[0], color=TRUTH, linestyle="--", linewidth=1, label="as given")
    first.set(xlabel="trial", ylabel="reward", title="trials")
    first.xaxis.get_major_locator().set_params(integer=True)
    first.legend(fontsize=8)
    for axis, key in zip(others, values.columns, strict=False):
        tried = values.loc[whole.index, key].dropna()
        if is_numeric_dtype(tried.infer_objects()):
            places = tried.astype(float)
            if places.min() > 0.0 and places.max() >= 10.0 * places.min():
                axis.set_xscale("log")
        else:
            names = sorted(set(tried.astype(str)))
            places = tried.astype(str).map(names.index)
            axis.set_xticks(np.arange(len(names)), names)
        axis.plot(places, drawn[places.index], "o", color=PALETTE[1])
        best = int(whole.idxmax())
        if best in places.index:
            axis.plot(places[best], drawn[best], "o", color=ESTIMATE, markersize=9)
        axis.set(xlabel=key)
    for axis in others[len(values.columns) :]:
        axis.set_axis_off()
    return figure
