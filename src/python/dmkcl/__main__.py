"""`python -m dmkcl`: the command-line tool, which the package carries."""

import os
import sys
from pathlib import Path


def main() -> None:
    """Become the tool: its options, its messages, its exit code."""
    tool = Path(__file__).with_name("dmkcl")
    os.execv(tool, ["dmkcl", *sys.argv[1:]])


if __name__ == "__main__":
    main()
