"""Which figures are measured, and which of them are covered."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from tests.figures.declared import Declaration, stands_in
from tests.figures.page import Page, Section
from tests.figures.prose import SHARES, Figure, figures, is_shown


def measured(section: Section) -> Iterator[Figure]:
    """The measured figures of a section."""
    for figure in figures(section.prose):
        if section.shows_results or figure.unit in SHARES:
            yield figure


def outputs_of(section: Section, page: Page, pages: dict[Path, Page]) -> list[str]:
    """The outputs of the section, and of the chapters that it links to."""
    chapters = [[section]]
    for link in section.links:
        name, _, anchor = link.partition("#")
        there = (page.path.parent / name).resolve() if name else page.path
        if there in pages:
            chapters.append(pages[there].chapter(anchor))
    return [output for chapter in chapters for one in chapter for output in one.outputs]


def is_asserted(figure: Figure, section: Section, root: Path) -> bool:
    """Whether the figure stands in a test that the section names, a file or a folder below `root`."""
    named = [root / test for test in section.tests]
    files = [file for test in named for file in ([test] if test.suffix else sorted(test.glob("*.py")))]
    return any(stands_in(figure, file.read_text(encoding="utf-8")) for file in files)


def is_declared(figure: Figure, section: Section, declarations: Iterable[Declaration]) -> bool:
    """Whether the figure is within the text of a declaration of its page."""
    begins = ((section.prose.find(one.text), len(one.text)) for one in declarations)
    return any(0 <= begin <= figure.place < begin + length for begin, length in begins)


def uncovered(
    page: Page, pages: dict[Path, Page], declarations: list[Declaration], root: Path
) -> Iterator[tuple[Section, Figure]]:
    """The measured figures of a page that have no source, with their sections.

    Args:
        page: One page.
        pages: All pages, for links between them.
        declarations: Those of the page.
        root: Folder of the tests that the page names.
    """
    for section in page.sections:
        outputs = outputs_of(section, page, pages)
        for figure in measured(section):
            if not (
                any(is_shown(figure, output) for output in outputs)
                or is_asserted(figure, section, root)
                or is_declared(figure, section, declarations)
            ):
                yield section, figure
