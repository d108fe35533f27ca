"""What is built on sweeps: recommending for a volume, trying a new tracker, installing drivers.

Each is a module that a command calls; `python -m freepath.extras.device_setup` is one of its own.
They may use every part to their left, and of the others only commands may use them.
"""
