"""`python -m vegtool` is the command line."""

from vegtool.cli import main

main()
