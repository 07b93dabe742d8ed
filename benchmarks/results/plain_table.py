"""Tables of a command's output, without their frames."""

from collections.abc import Iterator

_FRAME = "━─┏┓┗┛┡┩└┘├┤┳┻╇┴┼┬"
"""Characters of the horizontal lines of a table's frame."""


def without_frame(output: str, notes: set[str] | None = None) -> str:
    """Output of a command, with tables without box-drawing frames and with columns as narrow as possible.

    A rule remains below each header and between groups of rows. Titles, captions and numbers are unchanged,
    but ` / ` and ` %` within a cell become `/` and `%`.

    Args:
        output: Output of the command.
        notes: Titles and captions that are already on the page: they are omitted. New ones are added.
    """
    lines: list[str] = []
    notes = set() if notes is None else notes
    rows: list[list[str] | None] = []
    for line in output.splitlines():
        if line[:1] in ("┃", "│"):
            rows.append(line[1:-1].replace("┃", "│").split("│"))
        elif line and set(line) <= set(_FRAME):
            if line[0] in "┡├":
                rows.append(None)
            if line[0] == "└":
                lines += _aligned(rows)
                rows = []
        elif "━" not in output:
            lines.append(line)
        elif line.strip() not in notes:
            notes.add(line.strip())
            lines.append(line.strip())
    return "\n".join(lines)


def _aligned(rows: list[list[str] | None]) -> Iterator[str]:
    columns = list(zip(*(row for row in rows if row is not None), strict=True))
    right = [any(cell.startswith("  ") and cell.strip() for cell in column) for column in columns]
    widths = [max(len(_short(cell)) for cell in column) for column in columns]
    for row in rows:
        if row is None:
            yield "─" * (sum(widths) + 2 * len(widths) - 2)
        else:
            yield "  ".join(
                _short(cell).rjust(width) if to_right else _short(cell).ljust(width)
                for cell, width, to_right in zip(row, widths, right, strict=True)
            ).rstrip()


def _short(cell: str) -> str:
    return cell.strip().replace(" / ", "/").replace(" %", "%")
