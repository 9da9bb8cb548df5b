"""Print the table of measures: `python tests/architecture/report.py [--where KEY] [--write]`.

--where KEY: also print where the value of a measure comes from. --write: lower the values of `allowed.toml` to what is measured now; values
that have grown are not raised, since the test is there to refuse them.
"""

from __future__ import annotations

import argparse
import re

from rules import ALLOWED, comments, measures, read_allowed


def table() -> str:
    """Return measure, value, aim, line by line."""
    rows = [("measure", "value", "aim", "allowed")]
    allowed, _ = read_allowed()
    for measure in measures().values():
        rows.append((measure.title, f"{measure.value:,}", f"<= {measure.aim:,}", f"{allowed[measure.key]:,}"))
    rows.append(("comment lines in functions, % of all lines", f"{comments():.1f}", "what the code needs; 3 is usual", "-"))
    widths = [max(len(row[k]) for row in rows) for k in range(4)]
    lines = [f"| {row[0]:<{widths[0]}} | {row[1]:>{widths[1]}} | {row[2]:<{widths[2]}} | {row[3]:>{widths[3]}} |" for row in rows]
    rule = f"| {'-' * widths[0]} | {'-' * (widths[1] - 1)}: | {'-' * widths[2]} | {'-' * (widths[3] - 1)}: |"
    return "\n".join([lines[0], rule, *lines[1:]])


def lower_allowed() -> list[str]:
    """Write today's values where they are lower than the allowed ones; return what changed."""
    allowed, _ = read_allowed()
    text, changed = ALLOWED.read_text(encoding="utf-8"), []
    limits, slack = text.split("[slack]")
    for measure in measures().values():
        if measure.value < allowed[measure.key]:
            limits = re.sub(rf"^{measure.key} = [\d_]+", f"{measure.key} = {measure.value}", limits, flags=re.MULTILINE)
            changed.append(f"{measure.key}: {allowed[measure.key]} -> {measure.value}")
    ALLOWED.write_text(f"{limits}[slack]{slack}", encoding="utf-8")
    return changed


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--where", choices=sorted(measures()), help="print where a measure's value comes from")
    parser.add_argument("--write", action="store_true", help="lower the allowed values to today's")
    given = parser.parse_args()
    if given.where:
        print("\n".join(measures()[given.where].places))
        return
    if given.write:
        print("\n".join(lower_allowed()) or "nothing to lower")
    print(table())


if __name__ == "__main__":
    main()
