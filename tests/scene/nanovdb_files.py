"""A writer of small NanoVDB files, and a reader that looks up one voxel after the other."""

import struct
import zlib

import numpy as np

UPPER, LOWER, LEAF = 1 << 12, 1 << 7, 1 << 3
NODES = {UPPER: (32, LOWER, 8256), LOWER: (16, LEAF, 1088)}
"""By the voxels along a node's side: children along it, voxels of a child, where its table is."""
NUMBERS = {"float": 1, "double": 2, "int16": 3, "int32": 4, "int64": 5, "uint32": 10}
NUMBERS |= {"Fp4": 13, "Fp8": 14, "Fp16": 15, "FpN": 16}
BITS = {13: 4, 14: 8, 15: 16}
META = struct.Struct("<4Q2I6d6i3dI4I3I2HI")
CODES = {1: "<f4", 2: "<f8", 3: "<i2", 4: "<i4", 5: "<i8", 10: "<u4"}


def written(path, values, kind="float", **options):
    """Write values [x, y, z] as a grid called density; where a node's are all equal, as a tile."""
    path.write_bytes(segment([grid(values, kind, **options)], **options))


def segment(grids, *, codec=0, name="density", grid_class=2, magic=b"NanoVDB0", abi=32, **_):
    """A segment of grids (their memory, type and box), all of one name."""
    text, metas, blocks = name.encode() + b"\0", [], []
    for memory, number, low, high in grids:
        block = memory
        if codec == 1:
            packed = zlib.compress(memory)
            block = struct.pack("<Q", len(packed)) + packed
        elif codec == 2:
            import imagecodecs

            packed = imagecodecs.blosc_encode(memory, typesize=4)
            block = struct.pack("<Q", len(packed)) + packed
        head = struct.pack("<4Q2I6d", len(memory), len(block), 0, 0, number, grid_class, *[0.0] * 6)
        tail = struct.pack("<3dI4I3I2HI", 1, 1, 1, len(text), *[0] * 7, codec, 0, abi << 21)
        metas.append(head + struct.pack("<6i", *low, *high) + tail + text)
        blocks.append(block)
    return struct.pack("<8sI2H", magic, abi << 21, len(grids), codec) + b"".join(metas + blocks)


class Writer:
    """The memory of a grid's nodes, of values [x, y, z] that begin at `first`."""

    def __init__(self, values, number, first, background, bits):
        self.values, self.number, self.bits = values, number, bits
        self.code = np.dtype(CODES.get(number, "<f4"))
        self.background = self.code.type(background)
        self.low, self.high = np.array(first), np.array(first) + values.shape - 1

    def children(self, origin, side, count):
        """Places and origins of a node's children in the box."""
        begin = np.maximum((self.low - origin) // side, 0)
        end = np.minimum((self.high - origin) // side, count - 1) + 1
        for place in np.ndindex(*np.maximum(end - begin, 0)):
            yield begin + place, origin + side * (begin + place)

    def within(self, origin, side):
        """Where a cube meets the box: slices of the values, and of the cube."""
        begin, end = np.maximum(origin, self.low), np.minimum(origin + side, self.high + 1)
        return (tuple(map(slice, begin - at, end - at)) for at in (self.low, origin))

    def leaf(self, origin):
        inside = np.full((LEAF,) * 3, self.background)
        there, here = self.within(origin, LEAF)
        inside[here] = self.values[there]
        start = bytearray(128 if self.code.itemsize == 8 else 96)
        if self.number in CODES:
            return bytes(start) + inside.tobytes()
        least, width = inside.min(), self.bits or BITS.get(self.number, 8)
        quantum = np.float32((inside.max() - least) / (2**width - 1)) or np.float32(1)
        start[15] = width.bit_length() - 1 << 5
        start[80:88] = struct.pack("<2f", least, quantum)
        codes = np.rint((inside.ravel().astype(float) - least) / quantum).astype(int)
        ones = (codes[:, None] >> np.arange(width) & 1).astype(np.uint8)
        return bytes(start) + np.packbits(ones.ravel(), bitorder="little").tobytes()

    def node(self, origin, side):
        if side == LEAF:
            return self.leaf(origin)
        count, child, table = NODES[side]
        mask, entries = np.zeros((count,) * 3, np.uint8), np.zeros(count**3, "<i8")
        values = entries.view(self.code)[:: 8 // self.code.itemsize].reshape(mask.shape)
        values[:] = self.background
        offsets, nodes = entries.reshape(mask.shape), b""
        for place, at in self.children(origin, child, count):
            part = self.values[next(self.within(at, child))]
            if part.size == child**3 and (part == part.flat[0]).all():
                values[tuple(place)] = part.flat[0]
            else:
                mask[tuple(place)], offsets[tuple(place)] = 1, table + entries.nbytes + len(nodes)
                nodes += self.node(at, child)
        masks = bytes(count**3 // 8) + np.packbits(mask.ravel(), bitorder="little").tobytes()
        return (bytes(32) + masks).ljust(table, b"\0") + entries.tobytes() + nodes

    def root(self):
        """The root with its table, and all that comes after."""
        wide = self.code.itemsize == 8
        size = 96 if wide else 64
        start = UPPER * (self.low // UPPER)
        origins = [at for _, at in self.children(start, UPPER, 9)]
        root = np.array([self.low, self.high], "<i4").tobytes() + struct.pack("<I", len(origins))
        root = (root + bytes(4 * wide) + self.background.tobytes()).ljust(size, b"\0")
        tiles, nodes = b"", b""
        for origin in origins:
            offset = size + 32 * len(origins) + len(nodes)
            tiles += struct.pack("<Qq", key_of(origin), offset).ljust(32, b"\0")
            nodes += self.node(origin, UPPER)
        return root + tiles + nodes


def key_of(ijk):
    """What a root's table calls the upper node that a voxel is in."""
    x, y, z = (int(part) % 2**32 >> 12 for part in ijk)
    return x << 42 | y << 21 | z


def grid(values, kind="float", *, first=(0, 0, 0), background=0, to_world=None, bits=None, **_):
    """The memory of a grid, its type, and the first and the last voxel."""
    writer = Writer(values, NUMBERS[kind], first, background, bits)
    to_world = np.eye(3, 4) if to_world is None else np.asarray(to_world)
    head = bytearray(672 + 64)
    root = writer.root()
    head[:8], head[40:47] = b"NanoVDB0", b"density"
    head[16:40] = struct.pack("<4IQ", 32 << 21, 0, 0, 1, len(head) + len(root))
    head[384:456] = to_world[:, :3].astype("<f8").tobytes()
    head[528:552] = to_world[:, 3].astype("<f8").tobytes()
    head[632:640] = struct.pack("<2I", 2, writer.number)
    head[696:704] = struct.pack("<Q", 64)  # the root comes after the tree
    return bytes(head) + root, writer.number, writer.low, writer.high


class Lookup:
    """Voxels of the first grid in a file, each from the root down."""

    def __init__(self, content):
        meta = META.unpack_from(content, 16)
        start = 16 + META.size + meta[21]
        for _ in range(1, struct.unpack_from("<H", content, 12)[0]):
            start += META.size + META.unpack_from(content, start)[21]
        self.memory = content[start : start + meta[1]]
        if meta[29] == 1:
            self.memory = zlib.decompress(self.memory[8:])
        self.number = meta[4]
        self.code = np.dtype(CODES.get(self.number, "<f4"))
        self.wide = self.code.itemsize == 8
        self.root = 672 + self.at(696, "<u8")
        table = self.root + (96 if self.wide else 64)
        tiles = [table + 32 * n for n in range(self.at(self.root + 24, "<u4"))]
        self.tiles = {self.at(at, "<u8"): at for at in reversed(tiles)}
        box = np.frombuffer(self.memory, "<i4", 6, self.root)
        self.low, self.shape = box[:3].tolist(), (box[3:] - box[:3] + 1).tolist()

    def at(self, place, kind=None):
        """The number at a place of the memory, which nothing leads before."""
        assert place >= 0
        found = np.frombuffer(self.memory, kind or self.code, 1, place)[0]
        return found if kind is None or kind == "<f4" else int(found)

    def value(self, ijk):
        tile = self.tiles.get(key_of(ijk))
        if tile is None:
            return self.at(self.root + (32 if self.wide else 28))
        child = self.at(tile + 8, "<i8")
        if not child:
            return self.at(tile + (24 if self.wide else 20))
        node, side = self.root + child, UPPER
        while side > LEAF:
            across, child_side, table = NODES[side]
            n = 0
            for part in ijk:
                n = n * across + part % side // child_side
            if not self.at(node + 32 + across**3 // 8 + n // 8, "u1") >> n % 8 & 1:
                return self.at(node + table + 8 * n)
            node, side = node + self.at(node + table + 8 * n, "<i8"), child_side
        n = 64 * (ijk[0] % 8) + 8 * (ijk[1] % 8) + ijk[2] % 8
        if self.number in CODES:
            return self.at(node + (128 if self.wide else 96) + self.code.itemsize * n)
        width = BITS.get(self.number) or 1 << min(self.at(node + 15, "u1") >> 5, 4)
        packed = int.from_bytes(self.memory[node + 96 : node + 96 + 64 * width], "little")
        step = np.float32(packed >> width * n & (1 << width) - 1)
        return step * self.at(node + 84, "<f4") + self.at(node + 80, "<f4")


def looked_up(path):
    """The voxels [z, y, x] of the first grid."""
    found = Lookup(path.read_bytes())
    ijk = ([a + b for a, b in zip(found.low, p, strict=True)] for p in np.ndindex(*found.shape))
    return np.array([found.value(one) for one in ijk]).reshape(found.shape).T
