"""Text of others as Markdown: it is shown as it is, and no part of it acts on the page."""

from dataclasses import replace
from html import escape

import pytest
from markdown_it import MarkdownIt

from contactsense.service.viewer.literal_text import literal
from contactsense.service.viewer.words import in_words
from tests.service.viewer.estimates import POSTURE, contact, estimate
from tests.service.viewer.test_words import POINT, SCENE

READER = MarkdownIt("commonmark").enable(["strikethrough"])


@pytest.mark.parametrize(
    "text",
    [
        "<urlopen error [Errno 111] Connection refused>",
        "it printed <iframe srcdoc='<script>go()</script>'></iframe>",
        "tell_the_line and *_any_* of **these** ~~two~~ ~three~",
        "_private_ __init__ a_ _b",
        r"C:\*\_x\run.parquet",
        "AT&amp;T [link](http://127.0.0.1) ![x](y) a | b",
        "one ` alone",
    ],
)
def test_it_is_shown_as_it_is(text: str) -> None:
    assert READER.renderInline(literal(text)) == escape(text).replace("&#x27;", "'")


def test_a_command_is_shown_as_code() -> None:
    assert READER.renderInline(literal("`check a_b <c>` finds _it_")) == (
        "<code>check a_b &lt;c&gt;</code> finds _it_"
    )


def test_names_that_need_nothing_stay() -> None:
    assert literal("base_wrench: wrist_1, 20 N (98 %); https://example.com/a_b") == (
        "base_wrench: wrist_1, 20 N (98 %); https://example.com/a_b"
    )


def test_a_link_of_any_name_stays_in_its_cell() -> None:
    touched = replace(contact(SCENE, POSTURE, 3, POINT), link="left|arm<1>")
    words = in_words(estimate(SCENE, touched))
    assert r"**left\|arm\<1\>** is touched." in words
    assert r"| left\|arm\<1\> | 20.0 N |" in words
