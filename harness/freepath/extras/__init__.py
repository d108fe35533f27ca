"""What is built on the rest: a look at a volume, what is fastest in it, a new tracker, drivers.

Each is a module that a command calls; `python -m freepath.extras.device_setup` is one of its own.
They may use every part to their left, and of the others only commands may use them.
"""
