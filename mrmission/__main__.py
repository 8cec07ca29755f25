"""``python -m mrmission``."""

from mrmission.cli.main import main

main()
