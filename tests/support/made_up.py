"""Drivers that nobody has."""

from freepath.device.drivers import Driver


def made_up(name="made-up", found="yes", **given):
    return Driver(name, "A driver", "Maker", ("apt-get install it",), lambda: found, **given)
