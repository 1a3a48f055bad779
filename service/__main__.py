"""`python -m service` is the command `uavdepth`."""

from service.cli import main

main()
