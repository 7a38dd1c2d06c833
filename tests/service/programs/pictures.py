"""PNG, read and written as far as the tests need."""
import struct
import zlib


def brightness(png):
    """Mean of all samples of a PNG of 8 bits a channel, none interlaced."""
    width, height, depth, colour, _, _, interlaced = struct.unpack(">2I5B", png[16:29])
    assert depth == 8 and interlaced == 0, (depth, interlaced)
    at, packed = 8, b""
    while at < len(png):
        size, kind = struct.unpack(">I4s", png[at:at + 8])
        packed += png[at + 8:at + 8 + size] if kind == b"IDAT" else b""
        at += 12 + size
    step = {0: 1, 2: 3, 6: 4}[colour]
    raw, stride = zlib.decompress(packed), width * step
    above, total = bytearray(stride), 0
    for y in range(height):
        kind, row = raw[y * (stride + 1)], bytearray(raw[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
        for x in range(stride):
            left, up, corner = (row[x - step] if x >= step else 0), above[x], (above[x - step] if x >= step else 0)
            paeth = min((abs(up - corner), 0, left), (abs(left - corner), 1, up), (abs(left + up - 2 * corner), 2, corner))[2]
            row[x] = (row[x] + (0, left, up, (left + up) // 2, paeth)[kind]) & 255
        total += sum(row)
        above = row
    return total / (stride * height)


def onePixel(colour):
    """A PNG of one RGB pixel."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">2I5B", 1, 1, 8, 2, 0, 0, 0)) + \
        chunk(b"IDAT", zlib.compress(b"\0" + bytes(colour))) + chunk(b"IEND", b"")
