"""Runs parts of the kernels alone, on arrays, so that a generator is checked and nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from freepath.checks.rig import Rig
from freepath.compose import kernel_files
from freepath.compose.source import Source


class Lanes:
    """Runs a few lines of OpenCL C on arrays, element by element, in lanes."""

    def __init__(self, rig: Rig, lanes: int, logarithm: str = "log_polynomial", more: str = ""):
        self._rig, self._lanes = rig, lanes
        self._options = ("-cl-single-precision-constant",)
        shape = "scalar" if lanes == 1 else "vector"
        files = [f"lanes/{shape}", "lanes/common", f"math/{logarithm}", "lanes/rng"]
        defines = f"#define LANES {lanes}\n#define SCALAR float\n#define INTEGER int\n"
        self._head = defines + "\n".join(kernel_files.read(name).code for name in files)
        self._head += f"\n{more}"

    def __call__(
        self, body: str, inputs: Any, outputs: Sequence[str], count: int, draws: int = 1
    ) -> list[np.ndarray]:
        """Run `body`, which reads in0, in1, ... and writes out0, out1, ..., named after their type.

        `outputs` are the types of the results: bits or real; `draws` of each are asked for: the
        body is in a loop over n. It may read `seed`, that of the rig: an argument, as a source of
        each seed would be compiled in each repeat.
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
            f"{self._head}\n__kernel void track({arguments}, const ulong seed)\n{{\n"
            f"const uint at = get_global_id(0) * LANES;\n{load}Rng rng;\n"
            f"for (uint n = 0; n < {draws}; ++n) {{\n{declare}{body}\n{store}}}\n}}\n"
        )
        program = self._rig.program(Source(text, self._options))
        device = self._rig.device
        arrays = [np.resize(np.asarray(a, np.uint32), padded) for a in inputs]
        buffers = [device.upload(array) for array in arrays]
        size = 4 * padded * draws
        results = [device.allocate(size) for _ in outputs]
        seed = np.uint64(self._rig.seed)
        program.launch([*buffers, *results, seed], padded // self._lanes, 1)
        found = []
        for kind, result in zip(outputs, results, strict=True):
            dtype = {"bits": np.uint32, "real": np.float32}[kind]
            array = device.read(result, (padded * draws,), dtype)
            # (work-items, draws, lanes) to (elements, draws)
            array = array.reshape(-1, draws, self._lanes).swapaxes(1, 2).reshape(padded, draws)
            found.append(array[:count])
        return found

    def _at(self, name: str, place: str) -> str:
        return (
            f"{name}[{place}]" if self._lanes == 1 else f"vload{self._lanes}(0, {name} + {place})"
        )

    def _store(self, value: str, name: str, place: str) -> str:
        if self._lanes == 1:
            return f"{name}[{place}] = {value};\n"
        return f"vstore{self._lanes}({value}, 0, {name} + {place});\n"
