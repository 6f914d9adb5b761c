"""The start of the command `vegtool`, and of `python -m vegtool`."""

import sys


def main() -> None:
    """The command line; Ctrl-C is answered while it loads, too."""
    try:
        from vegtool import cli
    except KeyboardInterrupt:
        print("interrupted: nothing is left half-written", file=sys.stderr)
        sys.exit(130)
    cli.main()


if __name__ == "__main__":
    main()
