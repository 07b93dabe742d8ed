"""Contacts in recordings that were meant to be free of them.

`contact_test` finds them in the residuals of a `trimmed_fit`, `rest_test` in torques that change at rest.
"""
