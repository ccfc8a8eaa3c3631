"""`python -m formup` is the command line."""

from .apps.main import main

main()
