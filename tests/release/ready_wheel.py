"""A wheel that need not compile: the package with its kernels, compiled for one Python, one numba and a class of processors.

    python tests/release/ready_wheel.py WORK [--python 3.12.1] [--keep]

WORK: a folder for what is built. Builds the plain wheel, installs it in a clean environment, has it compile all that `rigidimpulse warmup`
and the gallery need for the baseline, and packs what lies in the cache. Then it installs the new wheel in another clean environment, and
makes the first picture with an empty cache there, three times: nothing may be compiled. The hashes of the gallery must be the pinned ones.
`--keep` keeps the numbers for the results page "Release". Takes a quarter of an hour with two cores, and less in a folder where it has
run: what is compiled there stays.
"""

from __future__ import annotations

import argparse
import csv
import json
import platform
import shutil
import sys
from pathlib import Path

from environments import NEWEST, PLAIN, Environment, build_wheel, clean_variables, find_pythons, find_uv, make_environment, run, said
from matrix import DURATION, HASHES, PINNED, RESULTS, SMOKE, versions

TIMES = 3
"""How often the first picture is made."""
COLLECT = Path(__file__).with_name("collect_kernels.py")
BASELINES = {
    ("Linux", "x86_64"): (
        "x86-64-v3",
        "+64bit,+avx,+avx2,+bmi,+bmi2,+cmov,+cx16,+cx8,+f16c,+fma,+fxsr,+lzcnt,+mmx,+movbe,+popcnt,+sahf,+sse,+sse2,+sse3,+sse4.1,+sse4.2,"
        "+ssse3,+xsave",
        "manylinux_2_17_x86_64",
    ),
}
"""By system and machine: LLVM's name and features of the class of processors, and the tag of the wheel. Kernels take from the system what
every glibc has: functions such as `sin`. The class has what processors of 2013 (Haswell) and later have."""


def compile_all(environment: Environment, variables: dict[str, str], place: Path) -> dict[str, str]:
    """Compile all kernels that there are for scenes of the gallery; return the hashes of their beginnings."""
    python, pinned = environment.python, [line.split()[0] for line in PINNED.read_text().splitlines()]
    run([python, "-m", "rigidimpulse", "warmup"], env=variables, cwd=place)
    told = json.loads(run([python, SMOKE], env=variables, cwd=place).splitlines()[-1])
    assert set(told["steps"].values()) == {"ok"}, told["steps"]
    out = run([python, HASHES, *pinned, "--duration", DURATION, "--limit", "1500"], env=variables, cwd=place)
    (place / "hashes.txt").write_text(out)
    return {line.split()[0]: line.split()[1] for line in out.splitlines()}


def pack(plain: Path, kernels: Path, tag: str, folder: Path, uv: Path) -> Path:
    """Put kernels into a plain wheel, and give it a tag of its own; return its path."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    wheel = [uv, "tool", "run", "--quiet", "wheel"]
    run([*wheel, "unpack", plain, "--dest", folder / "unpacked"])
    (tree,) = (folder / "unpacked").iterdir()
    shutil.copytree(kernels, tree / "rigidimpulse" / "ready_kernels")
    (about,) = tree.glob("*.dist-info/WHEEL")
    about.write_text(
        about.read_text().replace("Root-Is-Purelib: true", "Root-Is-Purelib: false").replace("Tag: py3-none-any", f"Tag: {tag}")
    )
    run([*wheel, "pack", tree, "--dest-dir", folder])
    (made,) = folder.glob("*.whl")
    return made


def first_picture(environment: Environment, work: Path) -> dict:
    """Make the first picture where nothing has run yet, and where nothing but its Python and the package is: the median of three."""
    told = []
    (package,) = environment.folder.glob("lib/python*/site-packages/rigidimpulse")
    for _ in range(TIMES):
        place = work / "first"
        shutil.rmtree(place, ignore_errors=True)
        shutil.rmtree(package / "__pycache__" / "rigidimpulse_kernels", ignore_errors=True)
        (place / "home").mkdir(parents=True)
        told.append(json.loads(run([environment.python, SMOKE, "first"], env=clean_variables(place / "home"), cwd=place).splitlines()[-1]))
        assert told[-1]["steps"] == {"first_picture": "ok"}, told
        print(told[-1])
    return sorted(told, key=lambda each: each["seconds"])[TIMES // 2]


def main() -> int:
    """Build, check and print; the exit code is 1 where a hash differs or a kernel was compiled."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("work", type=Path)
    parser.add_argument("--python", default=platform.python_version(), help="version of a Python of this machine")
    parser.add_argument("--keep", action="store_true", help="keep the numbers as data of the results page")
    options = parser.parse_args()
    machine = (platform.system(), platform.machine())
    if machine not in BASELINES:
        sys.exit(f"no class of processors is known for {' on '.join(machine)}: the kernels are compiled there")
    processor, features, system = BASELINES[machine]
    work = options.work.resolve()
    work.mkdir(parents=True, exist_ok=True)
    (python,) = (python for python in find_pythons() if python.version == options.python)
    uv = find_uv(work)
    plain = build_wheel(uv, work / "dist")
    builder = make_environment(uv, python, NEWEST, plain, work / "builder")
    place = work / "building"
    # What an earlier version of the package left there, a cache of a run for one, would be refused. Only compiled code may stay.
    cache = work / "compiled"
    shutil.rmtree(place, ignore_errors=True)
    (place / "home").mkdir(parents=True)
    for_baseline = {"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": features}
    variables = clean_variables(place / "home", NUMBA_CACHE_DIR=str(cache), **for_baseline)
    hashes = compile_all(builder, variables, place)
    run([builder.python, COLLECT, place / "kernels"], env=variables, cwd=place)
    short = "".join(python.version.split(".")[:2])
    wheel = pack(plain, place / "kernels", f"cp{short}-cp{short}-{system}", work / "ready", uv)
    installed = make_environment(uv, python, PLAIN, wheel, work / "installed")
    told = first_picture(installed, work)
    pinned = dict(line.split()[:2] for line in PINNED.read_text().splitlines())
    differing = sorted(name for name in pinned if hashes.get(name) != pinned[name])
    size = sum(path.stat().st_size for path in (place / "kernels").rglob("*") if path.is_file())
    row = {
        "wheel": wheel.name, "megabytes": f"{wheel.stat().st_size / 1e6:.1f}", "megabytes_installed": f"{size / 1e6:.1f}",
        "plain_megabytes": f"{plain.stat().st_size / 1e6:.1f}", "dependencies": versions(installed), "processor": processor,
        "seconds": told["seconds"], "processor_seconds": told["processor seconds"], "compiled": told["compiled"],
        "hashes": f"{len(pinned) - len(differing)} of {len(pinned)} pinned",
    }  # fmt: skip
    print(row)
    if differing:
        print("other hashes than the pinned ones:", *differing)
    if options.keep:
        keep(row, said(work))
    return bool(differing or told["compiled"])


def keep(row: dict[str, object], command: str) -> None:
    """Write the numbers to the data of the results pages, with machine, commit and command."""
    path = RESULTS / "data" / "ready_wheel.csv"
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([row, row.values()])
    run([sys.executable, RESULTS / "provenance.py", path, command])


if __name__ == "__main__":
    sys.exit(main())
