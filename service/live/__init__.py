"""The 500 Hz pipeline and its supervision.

`pipeline_process` is the pipeline, in a process of its own: it reads a source of samples, calls the localizer
and the listeners (`listener`), and sends estimates to the service. There `supervisor` starts it, judges it by
its messages (`status`, `silence`, `loading`, `latest_estimate`), and passes estimates to the `hub`, which
distributes them. `locate_process` answers single requests beside it.
"""
