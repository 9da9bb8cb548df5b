"""Work-precision charts of a study: a picture (matplotlib) and a page that answers the mouse (plotly). Extra `study` installs both.

Cost to the right, error upwards, both logarithmic: down and left is better. Families are lines, other engines dashed; the front is the
thick line below which nothing was found. Guides show what a method of order p pays, error ~ cost^-p. Errors below what the reference can
tell are drawn at its uncertainty.
"""

from __future__ import annotations

import math
import textwrap
from pathlib import Path
from typing import Any

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.scene.stages import STAGES
from rigidimpulse.studies.row import ERRORS, Row

TITLES = {
    "position": "largest error of the place, m", "angle": "largest error of the attitude, rad", "energy": "error of the energy, relative",
    "impact_time": "largest error of an impact's time, s", "penetration": "deepest overlap, m",
}  # fmt: skip
"""Error measures that are charted."""
PALETTE = ("#2f6fb2", "#d1662f", "#3b8a5a", "#8d5fb0", "#b23a48", "#5a7d8c", "#a5812c", "#d6649b", "#4c9fb0", "#7a6f52", "#6b8e23")
PEER_COLOURS = {"mujoco": "#444444", "pybullet": "#999999"}
STAGE_COLOURS = ("#4878a8", "#d1662f", "#8d5fb0", "#b23a48", "#3b8a5a", "#a5812c", "#777777")
INK, FRONT = "#22262b", "#111111"
LEAST = float(np.finfo(float).eps)
"""Error that stands for zero."""
CHEAPEST = 1e-5
"""s: cost that stands for none. A scene in which nothing can happen has no loop."""
GUIDES = (1, 2)
"""Orders of the guides."""
NEAR = 2.0
"""Ratio of costs below which names are written together."""
SHOWN_STAGES = 6
"""Rows whose stages are drawn."""


def write_png(study: Any, path: Path) -> None:
    """Draw the chart of positions, the overlap beside it if there is any, and the stages of the presets and the front.

    Raises:
        SceneError: matplotlib is not installed.

    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise SceneError("charts need matplotlib and plotly", "pip install 'rigidimpulse[study]'") from None
    figure = Figure(figsize=(15.0, 8.0), dpi=110, facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 2, width_ratios=(2.4, 1.0), height_ratios=(1.0, 0.8))
    chart, bars, names = figure.add_subplot(grid[:, 0]), figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
    figure.suptitle(_title(study), fontsize=14, color=INK, x=0.01, ha="left")
    _draw_families(chart, study)
    _draw_guides(chart, study)
    chart.set_xscale("log")
    chart.set_yscale("log")
    chart.set_xlabel("CPU time of the loop, s")
    chart.set_ylabel(TITLES["position"])
    chart.grid(True, which="major", color="#e3e6ea")
    chart.set_axisbelow(True)
    _draw_stages(bars, study)
    for axes in (chart, bars):
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(colors=INK, labelsize=9)
    names.axis("off")
    names.legend(*chart.get_legend_handles_labels(), fontsize=9, ncols=2, frameon=False, loc="upper left", borderaxespad=0.0)
    names.text(0.0, 0.0, _same(study), fontsize=8.5, color="#7b828b", va="bottom", wrap=True)
    figure.savefig(path)


def _same(study: Any) -> str:
    """Which families make no difference in this scene."""
    still = [family for family in dict.fromkeys(row.family for row in study.rows if row.ran) if not _differs(study, family)]
    return textwrap.fill(f"The same motion, to the bit, as settings that are drawn: {'; '.join(still)}", 62) if still else ""


def _differs(study: Any, family: str) -> bool:
    """Whether a family has a motion of its own; the presets always count."""
    return family == "presets" or any(not row.same_as for row in study.rows if row.family == family and row.ran)


def _title(study: Any) -> str:
    return f"{study.name}, {study.duration:g} s: what accuracy costs\nreference: {study.reference.describe()}"


def _families(study: Any, error: str) -> dict[str, list[Row]]:
    """Rows of each family that have the error, by cost."""
    families: dict[str, list[Row]] = {}
    for row in study.rows:
        if row.ran and math.isfinite(getattr(row.whole, error)) and _differs(study, row.family):
            families.setdefault(row.family, []).append(row)
    return {family: sorted(rows, key=lambda row: -row.knob) for family, rows in families.items()}


def _colour(family: str, number: int) -> str:
    return PEER_COLOURS.get(family, PALETTE[number % len(PALETTE)])


def _cost(row: Row) -> float:
    """What is drawn of a cost."""
    return max(row.cost, CHEAPEST)


def _drawn(row: Row, error: str, floor: float) -> float:
    return max(getattr(row.whole, error), floor)


def _floor(study: Any, error: str) -> float:
    """The least error that is told apart from zero."""
    uncertainty = study.reference.uncertainty
    return max(LEAST, uncertainty) if error == "position" and math.isfinite(uncertainty) else LEAST


def _draw_families(chart: Any, study: Any) -> None:
    floor, number = _floor(study, "position"), 0
    for family, rows in _families(study, "position").items():
        cost, error = [_cost(row) for row in rows], [_drawn(row, "position", floor) for row in rows]
        if family == "presets":
            chart.plot(cost, error, "*", markersize=15, color=FRONT, markeredgecolor="white", label="presets", zorder=5)
            for (where, height), label in _labels(rows, error):
                chart.annotate(label, (where, height), xytext=(9, 7), textcoords="offset points", fontsize=9.5, color=INK, zorder=6)
            continue
        style = "--s" if rows[0].is_peer else "-o"
        chart.plot(cost, error, style, markersize=5, linewidth=1.4, color=_colour(family, number), label=family, zorder=3)
        number += not rows[0].is_peer
    front = study.front()
    if front:
        chart.step(
            [_cost(row) for row in front], [_drawn(row, "position", floor) for row in front], where="post", color=FRONT, linewidth=4,
            alpha=0.25, label="front", zorder=2,
        )  # fmt: skip
    chart.axhspan(floor / 10.0, floor, color="#eef0f3", zorder=0)
    told = "what the reference can tell "
    chart.text(0.99, floor / 3.0, told, ha="right", va="center", fontsize=8, color="#7b828b", transform=chart.get_yaxis_transform())


def _labels(rows: list[Row], heights: list[float]) -> list[tuple[tuple[float, float], str]]:
    """Names of the presets, those that lie on each other together, and where to write them."""
    groups: list[list[tuple[Row, float]]] = []
    for row, height in sorted(zip(rows, heights, strict=True), key=lambda pair: pair[0].cost):
        last = groups[-1][-1] if groups else None
        if last is not None and _cost(row) < NEAR * _cost(last[0]) and abs(math.log10(height / last[1])) < 0.3:
            groups[-1].append((row, height))
        else:
            groups.append([(row, height)])
    return [((_cost(group[-1][0]), group[-1][1]), ", ".join(row.name for row, _ in group)) for group in groups]


def _draw_guides(chart: Any, study: Any) -> None:
    """Lines of slope -p in a corner."""
    rows = [row for row in study.rows if row.ran and math.isfinite(row.whole.position)]
    if not rows:
        return
    cost = np.array([_cost(row) for row in rows])
    start, top = float(np.sqrt(cost.min() * cost.max())), max(_drawn(row, "position", LEAST) for row in rows)
    along = start * np.array([1.0, 10.0])
    for order in GUIDES:
        chart.plot(along, top * (along / start) ** -order, ":", color="#aab0b8", linewidth=1.2, zorder=1)
        chart.annotate(
            f"order {order}", (along[1], top * 10.0**-order), fontsize=8, color="#7b828b", xytext=(3, -3), textcoords="offset points"
        )


def _draw_stages(bars: Any, study: Any) -> None:
    """Stages of the presets and the front, as shares of the loop."""
    front = [row for row in study.front() if row.family != "presets"]
    rows = ([row for row in study.rows if row.family == "presets" and row.ran] + front)[:SHOWN_STAGES]
    for height, row in enumerate(reversed(rows)):
        left, whole = 0.0, sum(row.stages.values()) or 1.0
        for stage, colour in zip(STAGES, STAGE_COLOURS, strict=True):
            share = row.stages.get(stage, 0.0) / whole
            bars.barh(height, share, left=left, height=0.5, color=colour, label=stage if height == 0 else None)
            left += share
        bars.text(0.0, height + 0.32, f"{row.name}, {row.cost:.2g} s", fontsize=9, color=INK)
    bars.set_yticks([])
    bars.set_xlim(0.0, 1.0)
    bars.set_ylim(-0.6, max(len(rows), 4) - 0.3)
    bars.set_xlabel("share of the loop's time, by stage")
    if rows:
        bars.legend(fontsize=8.5, ncols=4, frameon=False, loc="upper left", bbox_to_anchor=(0.0, -0.16))


def write_html(study: Any, path: Path) -> None:
    """Write a page with the chart of every error measure; the mouse tells all figures of a run. One file, offline.

    Raises:
        SceneError: plotly is not installed.

    """
    try:
        import plotly.graph_objects as plotly
    except ImportError:
        raise SceneError("charts need matplotlib and plotly", "pip install 'rigidimpulse[study]'") from None
    traces, shown_by = [], []
    for error in TITLES:
        traces += _traces(plotly, study, error)
        shown_by += [error] * (len(traces) - len(shown_by))
    buttons = [
        {"label": title, "method": "update", "args": [{"visible": [who == error for who in shown_by]}, {"yaxis.title.text": title}]}
        for error, title in TITLES.items() if error in shown_by
    ]  # fmt: skip
    for trace, who in zip(traces, shown_by, strict=True):
        trace.visible = who == shown_by[0]
    figure = plotly.Figure(traces)
    figure.update_layout(
        template="plotly_white", title=_title(study).replace("\n", "<br>"), hovermode="closest", font={"color": INK},
        xaxis={"type": "log", "title": "CPU time of the loop, s", "exponentformat": "power"},
        yaxis={"type": "log", "title": TITLES[shown_by[0]] if shown_by else "", "exponentformat": "power"},
        updatemenus=[{"buttons": buttons, "x": 1.0, "xanchor": "right", "y": 1.12}] if buttons else [],
    )  # fmt: skip
    figure.write_html(path, include_plotlyjs=True, full_html=True, default_height="96vh", config={"displaylogo": False})


def _traces(plotly: Any, study: Any, error: str) -> list[Any]:
    """Lines of one error measure: families, and the front below them."""
    floor, number, traces = _floor(study, error), 0, []
    front = study.front(error)
    if front:
        traces.append(plotly.Scatter(
            x=[_cost(row) for row in front], y=[_drawn(row, error, floor) for row in front], name="front", mode="lines", hoverinfo="skip",
            line={"color": FRONT, "width": 8, "shape": "hv"}, opacity=0.2,
        ))  # fmt: skip
    for family, rows in _families(study, error).items():
        star = family == "presets"
        traces.append(plotly.Scatter(
            x=[_cost(row) for row in rows], y=[_drawn(row, error, floor) for row in rows], name=family, text=[_told(row) for row in rows],
            hovertemplate="%{text}<extra></extra>", mode="markers" if star else "lines+markers",
            line={"color": FRONT if star else _colour(family, number), "dash": "dash" if rows[0].is_peer else "solid"},
            marker={"size": 15 if star else 8, "symbol": "star" if star else "square" if rows[0].is_peer else "circle"},
        ))  # fmt: skip
        number += not (star or rows[0].is_peer)
    return traces


def _told(row: Row) -> str:
    """All figures of a run, for the mouse."""
    errors = [f"{name} {getattr(row.whole, name):.3g}" for name in ERRORS if not math.isnan(getattr(row.whole, name))]
    whole = sum(row.stages.values())
    stages = [f"{stage} {100.0 * spent / whole:.0f} %" for stage, spent in row.stages.items() if whole and spent > 0.005 * whole]
    return "<br>".join([f"<b>{row.name}</b>", f"loop {row.cost:.3g} s, in all {row.seconds:.3g} s", *errors, *stages, row.status])
