"""The commands of `freepath`, one module each: `add` declares its arguments, `execute` runs it.

What a command needs beside its arguments is imported when it runs: `--help`, `list` and completion
do without the rest. No command computes: what can be called from Python is elsewhere.
"""
