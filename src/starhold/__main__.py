"""`python -m starhold`."""

from starhold.cli.main import main

main()
