"""Fit one friction and one restitution to half of the 120 real tosses, judge them on the other half.

`python tests/bench/fit_tosses.py [--table FILE.npz] [--save]`; about ten minutes. Every toss is rolled out over a grid of
parameters. A fit takes the point of the grid with the least

    J = mean position error / 0.12 widths + mean rotation error / 15 degrees

over the tosses it is allowed to see; what it is worth is its errors on the others. Halves: even and odd index, each way
round, and random halves. With --table the roll-outs are kept in a file and not repeated; with --save the tables go to
tests/bench/tosses/.

Then: what the answer would be if the start of each toss were off by as little as its measurement is (how much of the
error is chaos), and how far roll-outs move with the step of the contact forces.
"""

from __future__ import annotations

import argparse
import csv
import sys
from itertools import pairwise, product
from pathlib import Path

import numpy as np

import rigidimpulse as ri
from rigidimpulse.core import quaternion as rotation
from rigidimpulse.gallery import tosses as data

FRICTIONS = (0.165, 0.175, 0.185, 0.195)
RESTITUTIONS = (0.0, 0.08, 0.16, 0.24)
BODIES = {
    "as stated": [(8.1e-4, 0.0)],
    "moment of inertia fitted too": [(8.1e-4, 0.0), (8.9e-4, 0.0), (9.7e-4, 0.0)],
    "and corners rounded by 4 mm": [(9.7e-4, 0.004)],
}
"""Refinements: moments of inertia [kg m^2] and radii of the corners [m] to choose from."""
GOALS = np.array([0.12, np.radians(15.0)])
RANDOM_HALVES = 200
POSITION_NOISE, ANGLE_NOISE, NOISE_MEMORY = 6e-5, 5e-4, 0.55
"""m and rad that recorded frames are off the fitted flight by, root mean square, and how much of it the next frame repeats."""
DRAWS = 8
STEPS = (1 / 60, 1 / 240, 1 / 960)
WINDOW, AROUND = 14, 2
"""Frames over which friction is measured, and frames to either side from which velocities at its ends are taken."""
SPEEDS = (0.1, 0.3, 0.5, 0.7, 0.9, 1.1)
"""Bounds of the classes of speed in which it is told, m/s."""
FOLDER = Path(__file__).parent / "tosses"


def errors_of(cube: data.Cube, states: list[data.Flight]) -> np.ndarray:
    """Return the errors (120, 2), widths and rad, of all tosses."""
    rows = []
    for toss, state in zip(data.load_tosses(), states, strict=True):
        _, run = data.roll_out(toss, cube, state)
        if not run.status.ok:
            print(f"toss {toss.number}, {cube}: {run.status.message}")
        rows.append(data.errors(toss, state, run))
    return np.array(rows)


def fill(table: dict[data.Cube, np.ndarray], file: Path | None) -> None:
    """Roll out what the table lacks."""
    states = [data.flight(toss) for toss in data.load_tosses()]
    bodies = sorted(set(body for choice in BODIES.values() for body in choice), key=lambda body: body[::-1])
    for body, friction, restitution in product(bodies, FRICTIONS, RESTITUTIONS):
        cube = data.Cube(friction, restitution, *body)
        if cube in table:
            continue
        table[cube] = errors_of(cube, states)
        width, angle = _mean(table[cube])
        print(f"{tuple(cube)}: {width:.1f} %, {angle:.1f} degrees", flush=True)
        if file is not None:
            np.savez(file, cubes=np.array(list(table)), errors=np.array(list(table.values())))


def fit(table: dict[data.Cube, np.ndarray], bodies: list[tuple[float, float]], seen: np.ndarray) -> data.Cube:
    """Return the cube with the least J over the tosses `seen` (120,)."""
    cubes = [cube for cube in table if cube[2:] in bodies]
    return min(cubes, key=lambda cube: float((table[cube][seen].mean(axis=0) / GOALS).sum()))


def report_fits(table: dict[data.Cube, np.ndarray]) -> list[list[object]]:
    """Print and return a line for each refinement and half."""
    even = np.arange(120) % 2 == 0
    rows: list[list[object]] = []
    for name, bodies in BODIES.items():
        for half, seen in (("even", even), ("odd", ~even)):
            cube = fit(table, bodies, seen)
            rows.append([name, half, *cube, *_mean(table[cube][seen]), *_mean(table[cube][~seen])])
        random = np.random.default_rng(0)
        halves = np.array([random.permutation(120) < 60 for _ in range(RANDOM_HALVES)])
        judged = np.array([_mean(table[fit(table, bodies, seen)][~seen]) for seen in halves])
        own = np.array([errors for cube, errors in table.items() if cube[2:] in bodies])
        best = (own / GOALS).sum(axis=2).argmin(axis=0)
        print(f"{name}: parameters of its own for each toss {np.round(_mean(own[best, np.arange(120)]), 2)}")
        print(f"{name}: random halves {judged.mean(0).round(2)}, standard deviation {judged.std(0).round(2)}")
        rows.append([name, f"{RANDOM_HALVES} random", "", "", "", "", "", "", *judged.mean(axis=0)])
    for row in rows:
        print(*(f"{entry:.5g}" if isinstance(entry, float) else entry for entry in row), sep=", ")
    return rows


def report_chaos(cube: data.Cube) -> None:
    """Print how far roll-outs spread whose starts differ by the noise of the measurement."""
    random = np.random.default_rng(0)
    spread, turned, least = [], [], []
    for toss in data.load_tosses()[1::2]:
        runs = [data.roll_out(toss, cube)] + [data.roll_out(toss, cube, _remeasured(toss, random)) for _ in range(DRAWS)]
        if len({state.start for state, _ in runs}) > 1:
            continue
        positions = np.array([run.position("cube") for _, run in runs])
        orientations = np.array([run.orientation("cube") for _, run in runs])
        spread.append(np.linalg.norm(positions[1:] - positions[0], axis=2).mean() / data.WIDTH)
        turned.append(rotation.angle_between(orientations[1:], orientations[:1]).mean())
        scores = np.array([data.errors(toss, state, run) for state, run in runs])
        least.append([scores[0], scores[1:].mean(axis=0), scores[(scores / GOALS).sum(axis=1).argmin()]])
    print(f"noise of the start, {len(spread)} odd tosses: positions spread by {_quantiles(100 * np.array(spread))} % of the width")
    print(f"  rotations by {_quantiles(np.degrees(turned))} degrees (quartiles, 90 %, all)")
    for what, scores in zip(("fitted start", "drawn starts", "best of all starts"), np.array(least).mean(axis=0)):
        print(f"  {what}: {100 * scores[0]:.1f} %, {np.degrees(scores[1]):.1f} degrees")


def report_steps(cube: data.Cube) -> None:
    """Print how the errors and the paths depend on the step over which contact forces are constant."""
    before = None
    for step in STEPS:
        paths, scores = [], []
        for toss in data.load_tosses()[1::2]:
            state = data.flight(toss)
            duration = (len(toss.position) - 1 - state.start) / data.FPS
            run = ri.simulate(data.toss_scene(state, cube), duration, data.FPS, accuracy=ri.Accuracy(step=step))
            paths.append(run.position("cube"))
            scores.append(data.errors(toss, state, run))
        moved = "" if before is None else _quantiles([100 * _apart(a, b) for a, b in zip(paths, before, strict=True)])
        print(f"step {step:.5f} s: {np.round(_mean(np.array(scores)), 1)}; moved by {moved} % of the width", flush=True)
        before = paths


def report_friction(cube: data.Cube) -> None:
    """Print tangential over normal impulse by speed, |dv_xy| / (g dt + dv_z) over windows that begin 4 frames before the touch.

    It is mu where the cube slides one way all along, and less elsewhere; the simulated cube shows by how much.
    """
    seen: dict[str, list[tuple[float, float]]] = {"recorded": [], "simulated": []}
    for toss in data.load_tosses()[::2]:
        state, run = data.roll_out(toss, cube)
        recorded = toss.position[state.start :]
        for name, position in (("recorded", recorded), ("simulated", run.position("cube"))):
            ends = np.arange(AROUND, len(position) - AROUND, WINDOW)
            velocity = (position[ends + AROUND] - position[ends - AROUND]) * data.FPS / (2 * AROUND)
            change = np.diff(velocity, axis=0)
            normal = data.GRAVITY * WINDOW / data.FPS + change[:, 2]
            speed = np.linalg.norm(0.5 * (velocity[1:] + velocity[:-1])[:, :2], axis=1)
            # Where it has stopped inside the window friction did not act all along.
            slides = np.linalg.norm(velocity[1:, :2], axis=1) > 0.5 * SPEEDS[0]
            ratio = np.linalg.norm(change[:, :2], axis=1) / normal
            seen[name] += zip(speed[slides].tolist(), ratio[slides].tolist(), strict=True)
    for name, pairs in seen.items():
        speed, ratio = np.array(pairs).T
        classes = [ratio[(speed >= low) & (speed < high)] for low, high in pairwise(SPEEDS)]
        print(f"{name}: friction {[round(float(np.median(part)), 3) for part in classes]} at speeds {SPEEDS} m/s")


def _remeasured(toss: data.Toss, random: np.random.Generator) -> data.Flight:
    """Return the start of a toss whose frames have the noise of the measurement once more."""
    noise = random.normal(size=(len(toss.position), 6))
    for i in range(1, len(noise)):
        noise[i] = NOISE_MEMORY * noise[i - 1] + np.sqrt(1.0 - NOISE_MEMORY**2) * noise[i]
    turn = rotation.quaternion_from_rotation_vector(ANGLE_NOISE * noise[:, 3:])
    return data.flight(
        data.Toss(toss.number, toss.position + POSITION_NOISE * noise[:, :3], rotation.multiply(turn, toss.orientation))
    )


def _apart(a: np.ndarray, b: np.ndarray) -> float:
    """Return the mean distance of two paths, widths."""
    return float(np.linalg.norm(a - b, axis=1).mean()) / data.WIDTH


def _mean(errors: np.ndarray) -> tuple[float, float]:
    """Return the mean errors, % of the width and degrees."""
    return float(100.0 * errors[:, 0].mean()), float(np.degrees(errors[:, 1].mean()))


def _quantiles(values) -> np.ndarray:
    return np.percentile(values, [25, 50, 75, 90, 100]).round(2)


def save(table: dict[data.Cube, np.ndarray], rows: list[list[object]]) -> None:
    """Write the fits, the grid and the errors of each toss with the shipped parameters."""
    FOLDER.mkdir(exist_ok=True)
    columns = ["body", "fitted on", "friction", "restitution", "inertia", "corner radius", "position fitted", "rotation fitted",
               "position judged", "rotation judged"]  # fmt: skip
    grid = [[*cube, *_mean(errors[::2]), *_mean(errors[1::2])] for cube, errors in table.items()]
    states = [data.flight(toss) for toss in data.load_tosses()]
    shipped = errors_of(data.FITTED, states) * [100.0, np.degrees(1.0)]
    each = [[toss.number, state.start, *row] for toss, state, row in zip(data.load_tosses(), states, shipped.tolist(), strict=True)]
    tables = {
        "fits.csv": (columns, rows),
        "grid.csv": ([*data.Cube._fields, "position even", "rotation even", "position odd", "rotation odd"], grid),
        "each.csv": (["number", "start", "position", "rotation"], each),
    }
    for name, (head, lines) in tables.items():
        with (FOLDER / name).open("w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(head)
            writer.writerows([f"{entry:.5g}" if isinstance(entry, float) else entry for entry in line] for line in lines)
    print(f"wrote {', '.join(tables)} to {FOLDER}; positions in % of the width, rotations in degrees")


def main() -> int:
    """Fit, judge, print, save if asked to."""
    parser = argparse.ArgumentParser(description="Fit one friction and one restitution to half of the tosses.")
    parser.add_argument("--table", type=Path, help="keep roll-outs in this .npz file and do not repeat them")
    parser.add_argument("--save", action="store_true", help=f"write tables to {FOLDER.name}/")
    arguments = parser.parse_args()
    table: dict[data.Cube, np.ndarray] = {}
    if arguments.table is not None and arguments.table.is_file():
        with np.load(arguments.table) as stored:
            table = {data.Cube(*cube): errors for cube, errors in zip(stored["cubes"].tolist(), stored["errors"])}
    fill(table, arguments.table)
    rows = report_fits(table)
    report_friction(data.FITTED)
    report_chaos(data.FITTED)
    report_steps(data.FITTED)
    if arguments.save:
        save(table, rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
