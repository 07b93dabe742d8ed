"""Live samples on their way to the disk.

`recorder` writes what the sensors deliver, `clip_listener` clips of the last minutes and the service's
recording, both through `segment_writer`; `oldest_files` keeps the space limited.
"""
