"""The `vobench` command as `python -m vobench`."""

import sys

from vobench.cli import main

if __name__ == "__main__":
    # Messages that name the next command start with this.
    sys.argv[0] = f"{sys.executable} -m vobench"
    main()
