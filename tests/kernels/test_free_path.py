"""Where a path ends does not depend on what is asked of it."""

from freepath.checks.cases import check_distribution


def test_delta_in_a_transmittance_kernel(rig):
    flight = rig.flight(tracker="delta", medium="trilinear", majorant="grid", lanes=16)
    samples = flight.record(1024)
    check_distribution(flight, samples, 1e-4)
    other = rig.flight(
        tracker="delta", medium="trilinear", majorant="grid", lanes=16, estimand="free_path"
    )
    assert (samples.t == other.record(1024).t).all()
