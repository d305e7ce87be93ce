"""`python -m labmate.cli` is labmate-drive."""

from labmate.cli import main

main()
