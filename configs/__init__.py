"""Sweeps that ship with freepath; `freepath run NAME` finds them by name."""
