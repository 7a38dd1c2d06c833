#!/usr/bin/env python3
"""Carries out docker/Dockerfile where there is no Docker: each stage becomes a folder made by debootstrap, and RUN steps
are run in it by chroot. Needs root and debootstrap. What it understands is what our Dockerfile uses; anything else is an
error, so that nothing is passed over.

  docker/without_docker.py --root FOLDER                       builds into FOLDER/0, FOLDER/1, ...
  docker/without_docker.py --root FOLDER -- COMMAND...         then runs COMMAND in the last stage, as its USER
  docker/without_docker.py --list                              only prints the steps
"""
import argparse
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent
IMAGES = {"debian:bookworm-slim": "bookworm"}
#: Of this machine, for steps that reach the network behind a proxy.
NETWORK = ("http_proxy", "https_proxy", "no_proxy", "HTTP_PROXY", "HTTPS_PROXY", "NO_PROXY", "NODE_EXTRA_CA_CERTS",
           "SSL_CERT_FILE")
NETWORK_FILES = ("/etc/resolv.conf", "/etc/hosts", "/etc/apt/sources.list", "/etc/apt/sources.list.d",
                 "/etc/apt/apt.conf.d", "/etc/apt/auth.conf.d", "/etc/apt/trusted.gpg.d", "/usr/share/keyrings",
                 "/etc/ssl/certs", "/usr/local/share/ca-certificates", "/etc/npmrc", "/usr/etc/npmrc")


class Step:
    """One instruction: its name in capitals, its text, and the line on which it begins."""

    def __init__(self, name, text, line):
        self.name, self.text, self.line = name, text, line

    def words(self):
        return json.loads(self.text) if self.text.startswith("[") else shlex.split(self.text)

    def __str__(self):
        return f"{self.name} {self.text}"


def parse(text):
    """The steps of a Dockerfile; lines that end in a backslash are joined, comments left out."""
    steps, pending, start = [], "", 0
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith("#") or (not pending and not line.strip()):
            continue
        start = start if pending else number
        pending += line.rstrip()
        if pending.endswith("\\"):
            pending = pending[:-1] + " "
            continue
        name, _, rest = pending.strip().partition(" ")
        steps.append(Step(name.upper(), re.sub(r"\s+", " ", rest.strip()), start))
        pending = ""
    if pending:
        raise ValueError(f"line {start}: the file ends in the middle of an instruction")
    return steps


class Stage:
    """A folder that stands for the file system of an image, and what the instructions said of it."""

    def __init__(self, folder, name):
        self.folder, self.name = Path(folder), name
        self.environment = {"PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", "LANG": "C.UTF-8"}
        self.user, self.workdir, self.command = "0:0", "/", None

    def create(self, base, suite):
        """`base`: a bare system, made where it is not there yet."""
        if not base.exists():
            subprocess.run(["debootstrap", "--variant=minbase", "--include=ca-certificates", suite, str(base)], check=True,
                           stdout=subprocess.DEVNULL)
        self.folder.parent.mkdir(parents=True, exist_ok=True)
        subprocess.run(["cp", "-a", str(base), str(self.folder)], check=True)
        files = [(Path(name), self.folder / name[1:]) for name in NETWORK_FILES]
        files.append((Path.home() / ".npmrc", self.folder / "root" / ".npmrc"))
        for source, target in files:
            if source.exists():
                target.parent.mkdir(parents=True, exist_ok=True)
                subprocess.run(["cp", "-aT", str(source), str(target)], check=True)

    def run(self, command, network=True):
        """Runs a list of words in the stage. Its devices and processes are mounted where nobody else sees them, and are
        gone with it, however it ends: whoever removes the folder then removes no device of the machine."""
        environment = {"HOME": "/root" if self.user == "0:0" else "/tmp", **self.environment}
        if network:
            environment.update({key: os.environ[key] for key in NETWORK if key in os.environ})
        for mounted in ("proc", "dev"):
            (self.folder / mounted).mkdir(exist_ok=True)
        inner = f"cd {shlex.quote(self.workdir)} && exec {shlex.join(command)}"
        mounts = 'mount -t proc proc "$0/proc" && mount --rbind /dev "$0/dev" && exec chroot --userspec="$1" "$0" /bin/sh -c "$2"'
        return subprocess.run(["unshare", "--mount", "--propagation", "private", "/bin/sh", "-c", mounts, str(self.folder),
                               self.user, inner], env=environment, check=False).returncode


def ignored(path):
    """What Dockerfile.dockerignore keeps out of COPY, beyond the folders it lets in."""
    return {"node_modules", "dist"} & set(path.parts)


def copy(stage, stages, words):
    source_root = CHECKOUT
    if words[0].startswith("--from="):
        name = words.pop(0)[len("--from="):]
        source_root = next(s.folder for s in stages if s.name == name)
    *sources, target = words
    place = stage.folder / os.path.join(stage.workdir, target).lstrip("/")
    into = target.endswith("/") or len(sources) > 1
    for source in sources:
        origin = source_root / source.lstrip("/")
        if origin.is_dir():
            shutil.copytree(origin, place, dirs_exist_ok=True, symlinks=True,
                            ignore=lambda folder, names: [n for n in names if source_root == CHECKOUT and ignored(Path(folder, n).relative_to(CHECKOUT))])
        else:
            goal = place / origin.name if into or place.is_dir() else place
            goal.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(origin, goal)


def build(steps, root, base):
    stages = []
    for step in steps:
        print(f"without_docker: {step}"[:200], file=sys.stderr, flush=True)
        stage = stages[-1] if stages else None
        words = step.words() if step.name in ("FROM", "COPY", "CMD") else []
        if step.name == "FROM":
            stages.append(Stage(root / str(len(stages)), words[2] if words[1:2] == ["AS"] else str(len(stages))))
            stages[-1].create(base or root / "base", IMAGES[words[0]])
        elif step.name == "ENV":
            key, _, value = step.text.partition("=")
            stage.environment[key] = value
        elif step.name == "RUN":
            if (status := stage.run(["/bin/sh", "-c", step.text])) != 0:
                raise SystemExit(f"line {step.line}: ended with status {status}: {step}")
        elif step.name == "COPY":
            copy(stage, stages, words)
        elif step.name == "WORKDIR":
            stage.workdir = step.text
            (stage.folder / step.text.lstrip("/")).mkdir(parents=True, exist_ok=True)
        elif step.name == "USER":
            stage.user = step.text
        elif step.name == "CMD":
            stage.command = words
        elif step.name not in ("EXPOSE", "HEALTHCHECK", "STOPSIGNAL"):
            raise SystemExit(f"line {step.line}: {step.name} is not understood here")
    return stages


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, help="folder for the stages; must not exist yet")
    parser.add_argument("--base", type=Path, help="folder with a bare Debian 12 to begin with, made if need be; default: in --root")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("command", nargs="*")
    options = parser.parse_args()
    steps = parse((CHECKOUT / "docker/Dockerfile").read_text(encoding="utf-8"))
    if options.list:
        print("\n".join(map(str, steps)))
        return 0
    if options.root is None or options.root.exists():
        parser.error("--root must name a folder that does not exist yet")
    if not (options.base and options.base.exists()) and shutil.which("debootstrap") is None:
        parser.error("debootstrap is not installed (apt-get install debootstrap); or --base names a bare Debian 12")
    if os.geteuid() != 0:
        parser.error("needs root: debootstrap and chroot do")
    options.root.mkdir(parents=True)
    stages = build(steps, options.root.resolve(), options.base and options.base.resolve())
    return stages[-1].run(options.command, network=False) if options.command else 0


if __name__ == "__main__":
    sys.exit(main())
