"""Philox, xoshiro128++ and the logarithm, one by one, in one lane and in sixteen."""

import numpy as np
import pyopencl as cl
import pytest
from freepath import kernel_files
from freepath.source import Source
from scipy import stats

LANES = [1, 16]


class Lanes:
    """Runs a few lines of OpenCL C on arrays, element by element, in lanes."""

    def __init__(self, rig, lanes, logarithm="log_polynomial", arithmetic="float"):
        self._rig, self._lanes = rig, lanes
        self._options = ("-cl-single-precision-constant",)
        shape = "scalar" if lanes == 1 else "vector"
        files = [f"lanes/{shape}", "lanes/common", f"math/{logarithm}", "lanes/rng"]
        defines = f"#define LANES {lanes}\n#define SCALAR {arithmetic}\n#define INTEGER int\n"
        self._head = defines + "\n".join(kernel_files.read(name).code for name in files)

    def __call__(self, body, inputs, outputs, count, draws=1):
        """Run `body`, which reads in0, in1, ... and writes out0, out1, ..., named after their type.

        `outputs` are the types of the results: bits or real; `draws` of each are asked for: the
        body is in a loop over n.
        """
        padded = -(-count // self._lanes) * self._lanes
        names = [f"in{i}" for i in range(len(inputs))] + [f"out{i}" for i in range(len(outputs))]
        kinds = ["uint"] * len(inputs) + [{"bits": "uint", "real": "float"}[o] for o in outputs]
        arguments = ", ".join(f"__global {k} *{n}_" for k, n in zip(kinds, names, strict=True))
        load = "".join(
            f"const bits in{i} = {self._at(f'in{i}_', 'at')};\n" for i in range(len(inputs))
        )
        declare = "".join(f"{kind} out{i};\n" for i, kind in enumerate(outputs))
        place = f"(at * {draws} + n * LANES)"
        store = "".join(self._store(f"out{i}", f"out{i}_", place) for i in range(len(outputs)))
        text = (
            f"{self._head}\n__kernel void track({arguments})\n{{\n"
            f"const uint at = get_global_id(0) * LANES;\n{load}Rng rng;\n"
            f"for (uint n = 0; n < {draws}; ++n) {{\n{declare}{body}\n{store}}}\n}}\n"
        )
        program = self._rig.program(Source(text, self._options))
        device = self._rig.device
        arrays = [np.resize(np.asarray(a, np.uint32), padded) for a in inputs]
        buffers = [device.upload(array) for array in arrays]
        size = 4 * padded * draws
        results = [cl.Buffer(device.context, cl.mem_flags.READ_WRITE, size) for _ in outputs]
        program.launch([*buffers, *results], padded // self._lanes, 1)
        found = []
        for kind, result in zip(outputs, results, strict=True):
            array = np.empty(padded * draws, {"bits": np.uint32, "real": np.float32}[kind])
            cl.enqueue_copy(device.queue, array, result)
            # (work-items, draws, lanes) to (elements, draws)
            array = array.reshape(-1, draws, self._lanes).swapaxes(1, 2).reshape(padded, draws)
            found.append(array[:count])
        return found

    def _at(self, name, place):
        return (
            f"{name}[{place}]" if self._lanes == 1 else f"vload{self._lanes}(0, {name} + {place})"
        )

    def _store(self, value, name, place):
        if self._lanes == 1:
            return f"{name}[{place}] = {value};\n"
        return f"vstore{self._lanes}({value}, 0, {name} + {place});\n"


@pytest.fixture(params=LANES, ids="{} lanes".format)
def lanes(rig, request):
    return Lanes(rig, request.param)


# Random123-1.14, tests/kat_vectors: philox4x32 with 10 rounds; counter, key, result
PHILOX = [
    ([0, 0, 0, 0], [0, 0], [0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8]),
    ([0xFFFFFFFF] * 4, [0xFFFFFFFF] * 2, [0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD]),
    (
        [0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344],
        [0xA4093822, 0x299F31D0],
        [0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1],
    ),
]
WORDS = "out0 = rng.s0; out1 = rng.s1; out2 = rng.s2; out3 = rng.s3;"


def philox(counter, key):
    """Salmon et al. 2011, section 3.3, with Python's integers."""
    counter, key = list(counter), list(key)
    for _ in range(10):
        first, second = 0xD2511F53 * counter[0], 0xCD9E8D57 * counter[2]
        counter = [
            second >> 32 ^ counter[1] ^ key[0],
            second & 0xFFFFFFFF,
            first >> 32 ^ counter[3] ^ key[1],
            first & 0xFFFFFFFF,
        ]
        key = [key[0] + 0x9E3779B9 & 0xFFFFFFFF, key[1] + 0xBB67AE85 & 0xFFFFFFFF]
    return counter


def xoshiro(state):
    """Blackman and Vigna 2021, xoshiro128++, with Python's integers."""

    def rotated(x, k):
        return (x << k | x >> 32 - k) & 0xFFFFFFFF

    s = list(state)
    while True:
        yield (rotated(s[0] + s[3] & 0xFFFFFFFF, 7) + s[0]) & 0xFFFFFFFF
        t = s[1] << 9 & 0xFFFFFFFF
        s[2] ^= s[0]
        s[3] ^= s[1]
        s[1] ^= s[2]
        s[0] ^= s[3]
        s[2] ^= t
        s[3] = rotated(s[3], 11)


@pytest.mark.parametrize(("counter", "key", "expected"), PHILOX)
def test_philox_known_answers(lanes, counter, key, expected):
    assert philox(counter, key) == expected
    body = f"const Rng c = {{in0, in1, in2, in3}}; rng = philox(c, {key[0]}u, {key[1]}u);{WORDS}"
    found = lanes(body, [[word] for word in counter], ["bits"] * 4, 40)
    assert all((words == word).all() for words, word in zip(found, expected, strict=True))


def test_philox_counters_do_not_mix(lanes):
    """Each lane has the answer of its own counter."""
    counters = np.random.default_rng(1).integers(0, 2**32, (4, 48))
    body = f"const Rng c = {{in0, in1, in2, in3}}; rng = philox(c, 1u, 2u);{WORDS}"
    found = np.hstack(lanes(body, counters, ["bits"] * 4, 48))
    assert found.tolist() == [philox(map(int, counter), (1, 2)) for counter in counters.T]


def test_xoshiro_follows_the_published_algorithm(lanes):
    states = np.random.default_rng(2).integers(0, 2**32, (4, 40))
    states[:, 0] = 1, 2, 3, 4
    body = (
        "if (n == 0) { rng.s0 = in0; rng.s1 = in1; rng.s2 = in2; rng.s3 = in3; }"
        "out0 = next_bits(&rng);"
    )
    (found,) = lanes(body, states, ["bits"], 40, draws=100)
    generators = [xoshiro(map(int, state)) for state in states.T]
    expected = [[next(generator) for _ in range(100)] for generator in generators]
    assert found.tolist() == expected
    # the first numbers of the authors' implementation for the state 1, 2, 3, 4
    assert expected[0][:5] == [641, 1573767, 3222811527, 3517856514, 836907274]


def test_streams_are_philox_of_ray_and_sample(lanes):
    rays, offsets = np.array([0, 1, 7, 2**31, 2**32 - 1]), np.array([0, 1, 5, 2**31, 2**32 - 1])
    for first in (0, 2**32 - 3, 2**40 + 2**32 - 1, 2**64 - 2**32):
        body = f"rng = stream({2**63 + 5}ul, in0, {first}ul, in1);{WORDS}"
        found = np.hstack(lanes(body, [rays, offsets], ["bits"] * 4, 5))
        for words, ray, offset in zip(found.tolist(), rays.tolist(), offsets.tolist(), strict=True):
            number = (first + offset) % 2**64
            counter = [ray, number % 2**32, number >> 32, 0]
            assert words == philox(counter, [5, 2**31])


def test_no_two_samples_share_a_stream(lanes):
    """A million samples: of 64 rays, of which every number is used that a run could start at."""
    ray, offset = np.meshgrid(np.arange(64), np.arange(2**13), indexing="ij")
    seen = []
    for first in (0, 2**32 - 2**12):
        body = f"rng = stream(7ul, in0, {first}ul, in1);{WORDS}"
        words = lanes(body, [ray.ravel(), offset.ravel()], ["bits"] * 4, ray.size)
        seen.append(np.hstack(words))
    states = np.ascontiguousarray(np.vstack(seen)).view([("", np.uint32)] * 4)
    assert len(np.unique(states)) == len(states)


LOGARITHMS = {"log_polynomial": 1.0, "log_builtin": 3.0}


@pytest.mark.parametrize("count", LANES)
@pytest.mark.parametrize("name", LOGARITHMS)
def test_logarithm_over_all_of_its_domain(rig, name, count):
    """All 2^24 values of 1 - u. OpenCL grants its own log 3 ulp; ours is off by 0.83 at most."""
    k = np.arange(2**24, dtype=np.uint32)
    body = "out0 = logarithm((SCALAR)1 - to_real(in0) * 0x1p-24f);"
    (found,) = Lanes(rig, count, name)(body, [k], ["real"], len(k))
    found = found[:, 0].astype(np.float64)
    exact = np.log1p(-k.astype(np.float64) * 2.0**-24)
    assert found[0] == 0.0
    ulp = np.spacing(np.abs(exact[1:]).astype(np.float32)).astype(np.float64)
    error = np.abs(found[1:] - exact[1:]) / ulp
    assert error.max() <= LOGARITHMS[name]
    assert (np.diff(found) <= 0.0).all()  # it never falls where its argument rises


UNIFORM = """
if (n == 0) { rng.s0 = (bits)0; rng.s1 = rng.s2 = (bits)1; rng.s3 = in0; }
Rng copy = rng;
out0 = uniform(&rng);
out1 = exponential(&copy);
"""


def test_extremes(lanes):
    """The smallest and largest random bits: in [0, 1), and nothing infinite, nothing cut off."""
    # from s0 = 0 the generator returns s3 rotated by 7
    bits = np.array([0, 0xFFFFFFFF, 1 << 1, 0xFE])
    uniform, exponential = lanes(UNIFORM, [bits], ["real", "real"], 4)
    exact = np.array([rotated_bits(b) >> 8 for b in bits.tolist()])
    assert (uniform[:, 0] == exact * 2.0**-24).all()
    assert uniform[1, 0] == 1.0 - 2.0**-24
    assert exponential[0, 0] == 0.0
    assert exponential[1, 0] == pytest.approx(24.0 * np.log(2.0), rel=1e-6)


def rotated_bits(word):
    return (word << 7 | word >> 25) & 0xFFFFFFFF


SAMPLED = """
if (n == 0) rng = stream(3ul, in0, 0ul, in1);
Rng copy = rng;
out0 = uniform(&rng);
out1 = exponential(&copy);
"""


def test_distributions(lanes):
    """Sixteen million draws: uniform, exponential, and with the whole of its tail."""
    streams, draws = 2**16, 2**8
    ray = np.arange(streams)
    uniform, exponential = lanes(SAMPLED, [ray, ray % 7], ["real", "real"], streams, draws)
    assert uniform.min() >= 0.0
    assert uniform.max() < 1.0
    total = streams * draws
    counts = np.histogram(uniform, 1024, (0.0, 1.0))[0]
    assert stats.chisquare(counts).pvalue > 1e-4
    # successive draws of a stream, and the same draw of neighbouring streams, are independent
    for one, other in ((uniform[:, 1:], uniform[:, :-1]), (uniform[1:], uniform[:-1])):
        correlation = np.corrcoef(one.ravel(), other.ravel())[0, 1]
        assert abs(correlation) < 4.0 / np.sqrt(one.size)
    for limit in (1.0, 5.0, 10.0, 13.0):
        # -log(1 - u) of multiples of 2^-24 exceeds the limit this often, exactly
        share = (np.ceil(np.exp(-limit) * 2.0**24) - 1) * 2.0**-24
        excess = np.count_nonzero(exponential > limit) - total * share
        assert abs(excess) < 4.0 * np.sqrt(total * share), limit
    assert exponential.max() > 14.0
    assert np.isfinite(exponential).all()
