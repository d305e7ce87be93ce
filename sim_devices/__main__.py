"""`python -m sim_devices`."""

from sim_devices.cli import main

main()
