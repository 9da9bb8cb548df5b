"""A folder of pages of gallery scenes: an index with pictures, and for each scene its page to play, checks, status and source.

    index.html        a card a scene          NAME.html    checks and source, with the page that plays it inside
    NAME_play.html    the recording's page    NAME.png     a still          NAME.json   what became of it

Every scene is run in a process of its own; one that fails, crashes or takes too long is shown as such. A scene whose results are
newer than all files of the package is not run again.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from time import perf_counter

from rigidimpulse import gallery
from rigidimpulse.core.files import make_folder
from rigidimpulse.gallery.record import GalleryScene
from rigidimpulse.studies.hard_cases import FAILED, PASSED, CaseResult, as_plain, lost_case, run_limited

LIMIT = 900.0
"""s for a scene, all included."""
PACKAGE = Path(__file__).resolve().parent.parent


def make_site(
    folder: Path,
    names: Sequence[str] = (),
    jobs: int = 1,
    limit: float = LIMIT,
    report: Callable[[CaseResult, bool], None] | None = None,
) -> list[CaseResult]:
    """Write the pages of gallery scenes into a folder.

    Args:
        folder: made if it is not there.
        names: of scenes, hard cases included; none: all of the gallery.
        jobs: scenes that run at a time.
        limit: s for each scene.
        report: called with each result as soon as it is there, and whether it was kept from before.

    Returns:
        The results in the order of the names.

    Raises:
        SceneError: an unknown name, or no scene may run at a time.

    """
    from rigidimpulse.core.errors import SceneError
    from rigidimpulse.studies.site_pages import index_page, scene_page

    if jobs < 1:
        raise SceneError(f"jobs is {jobs}", "give the number of scenes that run at a time, >= 1")
    chosen = list(dict.fromkeys(names)) or list(gallery.names())
    entries = [gallery.load(name) for name in chosen]
    make_folder(folder)
    newest = max(path.stat().st_mtime for path in PACKAGE.rglob("*") if path.suffix in (".py", ".js", ".css", ".html"))

    def run(name: str) -> CaseResult:
        kept = _kept(folder, name, newest)
        result = kept or _run_apart(folder, name, limit)
        if report is not None:
            report(result, kept is not None)
        return result

    with ThreadPoolExecutor(jobs) as pool:
        results = list(pool.map(run, chosen))
    for entry, result in zip(entries, results, strict=True):
        (folder / f"{entry.name}.html").write_text(scene_page(entry, result, folder), encoding="utf-8")
    (folder / "index.html").write_text(index_page(results, folder), encoding="utf-8")
    return results


def _kept(folder: Path, name: str, newest: float) -> CaseResult | None:
    """Return the result of a scene from before, if it has pages and is newer than the package."""
    written = folder / f"{name}.json"
    files = (written, folder / f"{name}_play.html", folder / f"{name}.png")
    if not all(path.is_file() for path in files) or written.stat().st_mtime <= newest:
        return None
    try:
        return CaseResult(**json.loads(written.read_text(encoding="utf-8")))
    except (ValueError, TypeError):  # written by another version, or by hand
        return None


def _run_apart(folder: Path, name: str, limit: float) -> CaseResult:
    """Run a scene in a process of its own; what is left of an earlier run is taken away first."""
    for path in (folder / f"{name}.json", folder / f"{name}_play.html", folder / f"{name}.png"):
        path.unlink(missing_ok=True)
    start = perf_counter()
    code, last = run_limited(["rigidimpulse.studies.site", name, str(folder)], limit)
    written = folder / f"{name}.json"
    if code == 0 and written.is_file():
        return CaseResult(**json.loads(written.read_text(encoding="utf-8")))
    return lost_case(gallery.load(name), "", code, last, perf_counter() - start, limit)


def run_scene(entry: GalleryScene, folder: Path) -> CaseResult:
    """Run a scene in this process and write its page, its still and, last, its result."""
    from rigidimpulse.engine.simulate import simulate_whole
    from rigidimpulse.view.page import write_html
    from rigidimpulse.view.picture import draw_picture, png

    start, name = perf_counter(), entry.name
    run = simulate_whole(entry.scene(), entry.duration, entry.fps, accuracy=entry.accuracy)
    found = entry.check(run)
    checks = [as_plain(check) for check in found]
    seconds = perf_counter() - start
    write_html(run, folder / f"{name}_play.html", title=entry.description, checks=found)
    (folder / f"{name}.png").write_bytes(png(draw_picture(run)))
    outcome = PASSED if all(check["passed"] for check in checks) else FAILED
    result = CaseResult(
        name, entry.description, "", outcome, checks, seconds, entry.duration, len(run.impacts), run.status.message, run.state_hash(),
        entry.elsewhere,
    )  # fmt: skip
    (folder / f"{name}.json").write_text(json.dumps(asdict(result), indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return result


if __name__ == "__main__":
    run_scene(gallery.load(sys.argv[1]), Path(sys.argv[2]))
