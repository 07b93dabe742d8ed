"""A page of docs as sections, each with its prose, commands, outputs and links."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

COMMAND = re.compile(r"contactsense [a-z]|python -m (?:contactsense|benchmarks)\.")
"""Begin of a command of ours."""
MEASURES = re.compile(r"contactsense bench [a-z]|python -m (?:contactsense\.)?benchmarks\.(?!truth make)")
"""Begin of a command that measures."""


@dataclass
class Section:
    """From one heading to the next one of any level."""

    chapter: int = 0
    """Number of the heading of second level that it belongs to; 0 before the first."""
    anchor: str = ""
    prose: str = ""
    """Text without tables, outputs and blocks of code, in one line."""
    commands: list[str] = field(default_factory=list)
    outputs: list[str] = field(default_factory=list)
    links: list[str] = field(default_factory=list)
    tests: list[str] = field(default_factory=list)
    """Files and folders of tests that it names."""

    @property
    def shows_results(self) -> bool:
        """Whether it has an output, or names a test or a command that measures."""
        return bool(self.outputs or self.tests) or any(MEASURES.search(command) for command in self.commands)


@dataclass
class Page:
    """A page of docs."""

    path: Path
    sections: list[Section] = field(default_factory=lambda: [Section()])
    without_command: list[str] = field(default_factory=list)
    """First lines of the outputs that no command stands above."""

    def chapter(self, anchor: str) -> list[Section]:
        """The sections of the chapter that has a heading; all where `anchor` is empty."""
        numbers = {section.chapter for section in self.sections if anchor in ("", section.anchor)}
        return [section for section in self.sections if section.chapter in numbers]

    def has_above(self, kind: re.Pattern[str]) -> bool:
        """Whether such a command stands so far in the last chapter, or before the first one."""
        commands = [
            command
            for section in self.sections
            if section.chapter in (0, self.sections[-1].chapter)
            for command in section.commands
        ]
        return any(kind.search(command) for command in commands)


def read_page(path: Path) -> Page:
    """Divide a page."""
    page = Page(path)
    for kind, text in _parts(path.read_text(encoding="utf-8")):
        section = page.sections[-1]
        if kind == "heading":
            anchor = re.sub(r"[^\w\- ]", "", text.strip("# \n").lower()).replace(" ", "-")
            page.sections.append(Section(section.chapter + text.startswith("## "), anchor))
        elif kind == "code":
            lines = text.replace("\\\n", " ").splitlines()
            section.commands += [line.strip() for line in lines if COMMAND.search(line)]
        elif kind == "output":
            section.outputs.append(text)
            if not page.has_above(COMMAND):
                page.without_command.append(text.splitlines()[0])
        elif kind == "table":
            section.outputs += [text] * page.has_above(MEASURES)
        else:
            section.commands += [span for span in re.findall(r"`([^`]+)`", text) if COMMAND.match(span)]
            section.tests += re.findall(r"`(tests/[\w/.]+)`", text)
            section.links += re.findall(r"\]\(([^)\s]+)\)", text)
            section.prose = f"{section.prose} {' '.join(text.split())}".strip()
    return page


def _parts(text: str) -> Iterator[tuple[str, str]]:
    """Kind and text of all parts of a page: heading, code, output, table, prose."""
    part = re.compile(
        r"^```(?P<language>\w*)\n(?P<fenced>.*?)^```\n"
        r"|^(?P<heading>#+ [^\n]*\n)"
        r"|(?P<table>(?:^\|[^\n]*\n)+)"
        r"|(?P<code>(?:^ {4}\S[^\n]*\n)+)"
        r"|(?P<prose>(?:^(?!```|#+ |\|| {4}\S)[^\n]*\n)+)",
        re.MULTILINE | re.DOTALL,
    )
    for found in part.finditer(re.sub(r"<!--.*?-->\n", "", text).rstrip() + "\n"):
        if found["fenced"] is not None:
            yield "code" if found["language"] else "output", found["fenced"]
        else:
            kind = found.lastgroup or ""
            yield kind, found[kind]
