"""Plots of what benchmarks/paper.py measured."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ahf_ros.filtering.genetic import DELTA

DPI = 150

FITNESSES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""Marked on the axis."""


def draw_all(report: dict[str, Any], folder: Path) -> None:
    """Draw recall.png, fitness.png and errors.png.

    Parameters
    ----------
    report : dict
        What benchmarks/paper.py writes as JSON.
    folder : Path
        Made where it is not there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in (('recall', recall), ('fitness', fitness), ('errors', errors)):
        draw(report).savefig(folder / f'{name}.png', dpi=DPI, bbox_inches='tight', pad_inches=0.2)


def recall(report: dict[str, Any]) -> Figure:
    """Return recall (decoded right, of N) against the ambient ratio, a panel a light."""
    records = report['records']
    lights = [light for light in _values(records, 'light') if light != 'normal'] or ['normal']
    figure, panels = _panels(len(lights), 4.2)
    for panel, light in zip(panels, lights, strict=True):
        for number, method in enumerate(_values(records, 'method')):
            chosen = [it for it in records if (it['method'], it['light']) == (method, light)]
            ratios = sorted({it['ambient'] for it in chosen})
            shares = [_decoding([it for it in chosen if it['ambient'] == at]) for at in ratios]
            driven = method.startswith('AHF-')
            style = (
                {'linestyle': '-', 'linewidth': 3, 'alpha': 0.6} if driven else {'linestyle': '--'}
            )
            panel.plot(ratios, shares, color=f'C{number}', marker='o', label=method, **style)
        panel.set(title=light, xscale='log', ylim=(-2, 102), xlabel='ambient light / projected')
        panel.set_xticks(ratios, [f'{ratio:g}' for ratio in ratios])
        panel.minorticks_off()
        panel.grid(alpha=0.3)
    panels[0].set_ylabel('decoded right, % of N')
    panels[-1].legend(fontsize=7, loc='center left', bbox_to_anchor=(1, 0.5))
    return figure


def fitness(report: dict[str, Any]) -> Figure:
    """Return the best fitness against the filters tried, a panel a method that AHF drives."""
    searches = [record for record in report['records'] if len(record['tried']) > 1]
    methods = _values(searches, 'method') or ['no search was needed']
    figure, panels = _panels(len(methods), 4.2)
    for panel, method in zip(panels, methods, strict=True):
        own = [record for record in searches if record['method'] == method]
        colours: dict[str, str] = {}
        for record in own:
            light = f'{record["light"]} {record["ambient"]:g}'
            label = None if light in colours else light
            colour = colours.setdefault(light, f'C{len(colours)}')
            missed = np.abs(np.array(record['tried']) - record['expected'])
            best = 1 / (np.minimum.accumulate(missed) + DELTA)
            panel.step(np.arange(len(best)), best, color=colour, alpha=0.7, label=label)
            panel.plot(len(best) - 1, best[-1], 'o', color=colour, markersize=4)
        panel.set(title=method, xlabel='filters tried', yscale='log', ylim=(0.015, 1.2))
        panel.set_yticks(FITNESSES, [f'{value:g}' for value in FITNESSES])
        panel.minorticks_off()
        panel.grid(alpha=0.3)
        if own:
            panel.legend(fontsize=7)
    panels[0].set_ylabel(f'best fitness, 1 / (|N - n| + {DELTA:g})')
    return figure


def errors(report: dict[str, Any]) -> Figure:
    """Return the errors of the centres of all images, a panel with a scale of its own a method."""
    vectors = {
        method: np.array([row for it in report['records'] if it['method'] == method
                          for row in it['vectors']]).reshape(-1, 4)
        for method in _values(report['records'], 'method')
    }  # fmt: skip
    vectors = {method: rows for method, rows in vectors.items() if len(rows)}
    width, height = report['width'], report['height']
    figure, panels = _panels(len(vectors) or 1, 3.2, columns=4, ratio=height / width + 0.15)
    for panel, (method, rows) in zip(panels, vectors.items(), strict=False):
        x, y, across, down = rows.T
        shown = max(float(np.percentile(np.hypot(across, down), 95)), 1e-6)
        style = {'angles': 'xy', 'scale_units': 'xy', 'scale': shown / (0.08 * width)}
        arrows = panel.quiver(x, y, across, down, **style, width=0.004)
        rmse = float(np.sqrt((rows[:, 2:] ** 2).sum(axis=1).mean()))
        panel.set_title(f'{method}\n{len(rows)} targets, RMSE {rmse:.3f} px', fontsize=8)
        panel.quiverkey(
            arrows, 0.7, -0.05, shown, f'{shown:.3f} px', labelpos='E', fontproperties={'size': 7}
        )
    for panel in panels:
        panel.set(xlim=(0, width), ylim=(height, 0), aspect='equal', xticks=[], yticks=[])
    return figure


def _decoding(records: Sequence[dict[str, Any]]) -> float:
    expected = sum(record['score']['expected'] for record in records)
    return 100 * sum(record['score']['right'] for record in records) / max(expected, 1)


def _values(records: Sequence[dict[str, Any]], name: str) -> list[Any]:
    """Return the different values of one entry, in the order of the records."""
    return list(dict.fromkeys(record[name] for record in records))


def _panels(
    count: int, side: float, columns: int = 3, ratio: float = 0.8
) -> tuple[Figure, list[Any]]:
    columns = min(count, columns)
    rows = -(-count // columns)
    figure = Figure(figsize=(side * columns, side * ratio * rows), layout='constrained')
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for panel in panels[count:]:
        panel.set_visible(False)
    return figure, list(panels[:count])
