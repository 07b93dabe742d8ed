"""`python -m benchmarks.truth make`: ground truth from the repository and the package index alone."""

from .command import main

if __name__ == "__main__":
    main(prog_name="python -m benchmarks.truth")
