"""Measured figures in the prose of README and docs: each agrees with its source.

**A figure** is a number with a unit of `prose.UNITS`, or a count such as `10 of 11`, outside code and tables.

**It is measured** if it is a share (%, points), or if its section shows results: it has an output, or names a
test or a command that measures (`contactsense bench ...`, `python -m benchmarks...`). All other figures are
settings.
`prose.CONVENTIONS` lists what is never measured, such as `95 %` and the usual noise.

**It is covered** if it is a rounding of a number in an output of its section, or of a chapter that the
section links to; if it stands in a test that the section names; or if `declared.yaml` states its source:

- `command`: the page names this command, which prints the figure; its output is not in docs
- `file`: the figure stands in this file: a setting of a benchmark, the limit of a test
- `is`: the figures of the text, reckoned from numbers of the outputs, one formula for each
- `source`: where somebody else states the figure

**An output** is a fenced block without a language, or a table below a command that measures. A command stands
above it in the same chapter, or before the first one. A chapter is a heading of second level with all below.
"""
