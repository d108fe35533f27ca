"""Defects of OpenCL drivers, a kernel each: what a word of the output is, and what it must be."""

import sys

import numpy as np
import pyopencl as cl

KERNELS = {
    "loops": ("uint n = 0; while (n < 100000) { ++n; out[1] = n; } out[0] = n;", 100000),
    "by value": ("S a = {1, 2}; const S b = copied(&a); out[1] = b.x; out[0] = a.x;", 1),
    "rotate": ("const uint x = out[0]; out[0] = (x << 7 | x >> 25) + 5;", 5),
    "halves": ("int16 m = (int16)(1); int8 h = m.lo + m.hi; if (h.s3) out[0] = 1;", 1),
    "struct": ("const W a = {(int8)0}; W b = a; if (!b.y.s0) out[0] = 1;", 1),
}
COMMON = """
typedef struct { uint x, y; } S;
typedef struct { int8 x, y; } W;
static S changed(S s) { for (int i = 0; i < 3; ++i) { s.x += s.y; s.y = s.x; } return s; }
static S copied(const S *s) { return changed(*s); }
"""
wanted, options = sys.argv[1], sys.argv[2:]
body, right = KERNELS[wanted]
devices = [device for platform in cl.get_platforms() for device in platform.get_devices()]
context = cl.Context(devices[:1])
queue = cl.CommandQueue(context)
text = f"{COMMON}__kernel void k(__global uint *out) {{ {body} }}"
kernel = cl.Kernel(cl.Program(context, text).build(options), "k")
out = cl.Buffer(context, cl.mem_flags.COPY_HOST_PTR, hostbuf=np.zeros(2, np.uint32))
kernel.set_args(out)
cl.enqueue_nd_range_kernel(queue, kernel, (1,), (1,)).wait()
found = np.empty(2, np.uint32)
cl.enqueue_copy(queue, found, out)
device = devices[0]
print(f"{device.platform.name} {device.driver_version}: {wanted}: {found[0]}, expected {right}")
