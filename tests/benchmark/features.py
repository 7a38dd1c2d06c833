"""features.py [--error E] [--runs N] [--samples N] [--output DIR] [NAME...]: what mirrors, glass, paper, lamps with a
size and pictures of the sky cost. Lights the small room with each of them, and its twin without, with the texels that
the program chooses, by turns; and holds what it wrote against the path tracer of the tests, at points of surfaces.
Environment: RADIOSITY_BUILD, the build folder. Writes features.md and features.json."""
import argparse
import json
import math
import os
import pathlib
import resource
import statistics
import subprocess
import sys
import tempfile

# By name: the scene, what else `radiosity solve` gets, and the name of the twin. "SKY4K": a picture made below.
CASES = {
    "plain": ("room_small", [], None),
    "mirror": ("room_small_mirror", [], "plain"),
    "glass": ("room_small_glass", [], "plain"),
    "coloured glass": ("room_small_tinted", [], "plain"),
    "brushed metal": ("room_small_brushed", [], "plain"),
    "paper shade": ("room_small_shade", [], "plain"),
    "point and spot": ("room_lights", [], "plain"),
    "area lights": ("room_area", [], "plain"),
    "even sky": ("room_small_open", [], None),
    "4K sky": ("room_small_open", ["--sky", "SKY4K"], "even sky"),
}

# Where paths find light so seldom that 4,096 leave half of it to chance: points, and paths for each. Of what remains,
# points have a noise of 7 %, which is most of their p95.
JUDGED = {"paper shade": ("400", "131072")}


def write_sky(path, width=4096, height=2048):
    """A Radiance picture of a clear sky with a sun of half a degree, run-length encoded row by row."""
    def rgbe(colour):
        most = max(colour)
        if most < 1e-30:
            return (0, 0, 0, 0)
        mantissa, exponent = math.frexp(most)
        return tuple(int(c * mantissa * 256.0 / most) for c in colour) + (exponent + 128,)
    def runs(row):
        coded, at = bytearray(), 0
        while at < len(row):
            end = at
            while end < len(row) and row[end] == row[at] and end - at < 127:
                end += 1
            coded += bytes((128 + end - at, row[at]))
            at = end
        return coded
    sun = (0.6, math.radians(40.0))  # azimuth as a part of the width, elevation
    with open(path, "wb") as file:
        file.write(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (height, width))
        for y in range(height):
            elevation = math.pi * (0.5 - (y + 0.5) / height)
            up = math.sin(elevation)
            sky = rgbe((700.0 + 500.0 * (1.0 - up), 850.0 + 350.0 * (1.0 - up), 1200.0) if up > 0 else (300.0,) * 3)
            row = [sky] * width
            if abs(elevation - sun[1]) < math.radians(0.25):
                half = math.sqrt(math.radians(0.25) ** 2 - (elevation - sun[1]) ** 2) / math.cos(elevation)
                first, last = (int((sun[0] + sign * half / (2 * math.pi)) * width) for sign in (-1, 1))
                row[first:last + 1] = [rgbe((5e8, 4.8e8, 4.5e8))] * (last + 1 - first)
            file.write(bytes((2, 2, width >> 8, width & 255)))
            for channel in range(4):
                file.write(runs([pixel[channel] for pixel in row]))


def solve(build, scene, folder, error, arguments):
    """Processor seconds, of all processes, and the report."""
    output = folder / "lit.glb"
    command = [build / "client/cli/radiosity", "solve", build / f"scenes/{scene}.glb", "-o", output, "--error", error,
               "--report", folder / "report.json", "--quiet", *arguments]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if run.returncode not in (0, 3):
        sys.exit(f"features: {scene}: {run.stderr}")
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return seconds, json.loads((folder / "report.json").read_text())


def judge(build, scene, folder, judged, arguments):
    """The lit file has the sky that was chosen; else light is traced in the scene as it was."""
    traced = [] if "--sky" in arguments else [build / f"scenes/{scene}.glb"]
    points, samples = judged
    command = [build / "tests/accuracy/compare_lightmap", folder / "lit.glb", *traced, "--points-only", "--json",
               "--points", points, "--reference-samples", samples, "--references", build / "references"]
    run = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=True)
    return json.loads(run.stdout)


def measure(name, build, options, folder):
    """By turns with its twin, so that both meet the same machine."""
    scene, arguments, twin = CASES[name]
    arguments = [str(folder / "sky.hdr") if part == "SKY4K" else part for part in arguments]
    times, times_of_twin = [], []
    for _ in range(options.runs):
        if twin:
            times_of_twin.append(solve(build, CASES[twin][0], folder, options.error, [])[0])
        seconds, report = solve(build, scene, folder, options.error, arguments)
        times.append(seconds)
    found = judge(build, scene, folder, JUDGED.get(name, ("3000", options.samples)), arguments)
    seconds = statistics.median(times)
    return {"name": name, "scene": scene, "seconds": seconds,
            "ofTwin": seconds / statistics.median(times_of_twin) if twin else None,
            "texels": report["patches"],
            "stated": report["error"]["total"], "true": found["total"]["relative_rms"], "p95": report["error"]["p95"] or 0.0,
            "trueP95": found["surface"]["p95"], "meanRatio": found["surface"]["mean_ratio"]}


def table(rows, options):
    lines = [f"| small room with ..., asked for {100 * float(options.error):g} % | processor s | of its twin | texels | "
             "stated | true | p95 stated | p95 true | mean |", "|---|---:|---:|---:|---:|---:|---:|---:|---:|"]
    for row in rows:
        of_twin = f"{row['ofTwin']:.2f}" if row["ofTwin"] else ""
        lines.append(f"| {row['name']} | {row['seconds']:.2f} | {of_twin} | {row['texels']:,} | "
                     f"{100 * row['stated']:.2f} % | {100 * row['true']:.2f} % | {100 * row['p95']:.1f} % | "
                     f"{100 * row['trueP95']:.1f} % | {row['meanRatio']:.4f} |")
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--error", default="0.02", help="asked for (default: %(default)s)")
    parser.add_argument("--runs", type=int, default=3, help="of each solve; the median counts (default: %(default)s)")
    parser.add_argument("--samples", type=int, default=16384, help="paths of the judge a point (default: %(default)s)")
    parser.add_argument("--output", type=pathlib.Path, default=pathlib.Path("."), help="folder for results")
    parser.add_argument("NAME", nargs="*", help=f"of {', '.join(CASES)}; default: all")
    options = parser.parse_args()
    unknown = [name for name in options.NAME if name not in CASES]
    if unknown:
        parser.error(f"no case {', '.join(unknown)}; there are: {', '.join(CASES)}")
    build = pathlib.Path(os.environ["RADIOSITY_BUILD"])
    options.output.mkdir(parents=True, exist_ok=True)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        names = options.NAME or list(CASES)
        if any("SKY4K" in CASES[name][1] for name in names):
            write_sky(folder / "sky.hdr")
        for name in names:
            rows.append(measure(name, build, options, folder))
            (options.output / "features.json").write_text(json.dumps(rows, indent=2) + "\n")
            (options.output / "features.md").write_text(table(rows, options))
            print(f"features: {name}: {rows[-1]['seconds']:.2f} s", file=sys.stderr)
    print(table(rows, options), end="")


if __name__ == "__main__":
    main()
