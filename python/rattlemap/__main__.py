"""`python -m rattlemap`: the program."""

from .program import main

main()
