"""docs/results.md and docs/further_results.md: every number on them is printed by a command."""
